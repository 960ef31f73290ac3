"""This project, from the text of the spec."""

from __future__ import annotations

from bench.peers.problems import spec_of
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    """Parsed, differentiated and compiled: what is left is the solve, by way of fewer frames where there are many.

    That includes binding the numbers and reading the motion off, but for quadratic programs, which are bound here.
    """
    import stc
    from stc.solver import Options, minimize

    overrides = {"k": case.n // 60} if case.problem == "P5" else {"n": case.n}
    model = stc.load(spec_of(case.problem, case.rods))
    model.prepare(**overrides)
    problem, transcription = model.transcription(**overrides)
    limits = {"max_iterations": case.max_iterations, "time_limit": case.time_limit}
    bound = transcription.bind(problem.constants)

    def program() -> Outcome:
        result = minimize(bound, Options(**limits))
        status = str(result.status.value)
        return Outcome(result.objective, result.iterations, status == "optimal", status, result.x)

    def motion() -> Outcome:
        found = model.solve(**limits, **overrides)
        return Outcome(found.objective, found.iterations, found.status == "optimal", found.status, found.x)

    return Task(program if transcription.is_quadratic else motion)
