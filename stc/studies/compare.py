"""Several optimizers on one and the same nonlinear program."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from stc.errors import UsageError
from stc.pipeline import solve
from stc.records import dataclass
from stc.solver.optimizers import optimizer_of
from stc.solver.options import given_options

if TYPE_CHECKING:
    from stc.pipeline import Model

__all__ = ["Run", "compare"]


@dataclass(frozen=True, slots=True)
class Run:
    """What one optimizer found.

    Attributes:
        optimizer: its name.
        status: as in a solution, or ``refused`` where the optimizer cannot do what the problem needs.
        message: the same in words.
        objective, violation, optimality: judged in the same way for all, in the spec's own units.
        iterations: what the optimizer counts as such.
        evaluations: evaluations of objective and constraints together, those for judging points included.
        derivatives: evaluations of the derivatives.
        seconds: wall time of the solve; reading and compiling are not in it.
    """

    optimizer: str
    status: str
    message: str
    objective: float = float("nan")
    violation: float = float("nan")
    optimality: float = float("nan")
    iterations: int = 0
    evaluations: int = 0
    derivatives: int = 0
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def compare(
    model: Model,
    optimizers: Sequence[str],
    *,
    method: str | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    time_limit: float | None = None,
    callback: Callable[[Any], bool | None] | None = None,
    announce: Callable[[str, int, int], None] | None = None,
    **constants: float,
) -> list[Run]:
    """Solves a model with each optimizer, from the same start; each has the limits to itself.

    Args:
        model: the spec.
        optimizers: names as :func:`stc.solver.optimizers.optimizer_of` takes them.
        method: of transcription instead of the spec's own.
        tolerance, max_iterations, time_limit, callback: as for :meth:`stc.pipeline.Model.solve`.
        announce: told before each solve the optimizer's name, which one it is, from 1, and of how many.
        **constants: values of constants.

    Returns:
        One record per optimizer, in the same order.

    Raises:
        UsageError: no optimizer, or one that does not exist; a tolerance or limit that cannot be meant.
        SpecError, EvaluationError: mistakes in the spec.
    """
    if not optimizers:
        raise UsageError("name at least one optimizer", "for example: sqp,nlopt:slsqp")
    for name in optimizers:
        optimizer_of(name)
    options = given_options(tolerance, max_iterations, time_limit)
    problem, transcription = model.transcription(method, **constants)
    if transcription.kernels is None:
        transcription.compile()
    runs = []
    for number, name in enumerate(optimizers, 1):
        if announce is not None:
            announce(name, number, len(optimizers))
        begin = time.perf_counter()
        try:
            bound, result = solve(transcription, problem.constants, options, None, callback, name)
        except UsageError as error:
            runs.append(Run(name, "refused", error.message))
            continue
        runs.append(
            Run(
                name,
                result.status.value,
                result.message,
                result.objective,
                result.violation,
                result.optimality,
                result.iterations,
                bound.evaluations,
                bound.derivative_evaluations,
                time.perf_counter() - begin,
            )
        )
    return runs
