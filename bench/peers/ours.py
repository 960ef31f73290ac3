"""This project, from the text of the spec."""

from __future__ import annotations

from bench.peers.problems import spec_of
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    """Parsed, differentiated, compiled and bound: what is left is the solver's call."""
    import stc
    from stc.solver import Options, minimize

    overrides = {"k": case.n // 60} if case.problem == "P5" else {"n": case.n}
    model = stc.load(spec_of(case.problem, case.rods))
    problem, transcription = model.transcription(**overrides)
    transcription.compile()
    bound = transcription.bind(problem.constants)
    options = Options(max_iterations=case.max_iterations, time_limit=case.time_limit)

    def solve() -> Outcome:
        result = minimize(bound, options)
        status = str(result.status.value)
        return Outcome(result.objective, result.iterations, status == "optimal", status, result.x)

    return Task(solve)
