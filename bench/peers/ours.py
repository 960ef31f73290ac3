"""This project, from the text of the spec."""

from __future__ import annotations

from bench.peers.problems import constants_of, spec_of
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    """All but the solve is done before: parsed, differentiated, compiled and bound."""
    import stc

    overrides = constants_of(case.problem, case.n)
    model = stc.load(spec_of(case.problem, case.rods))
    prepared = model.prepare(max_iterations=case.max_iterations, time_limit=case.time_limit, **overrides)

    def task() -> Outcome:
        result = prepared.run()
        status = str(result.status.value)
        return Outcome(result.objective, result.iterations, status == "optimal", status, result.x)

    return Task(task)
