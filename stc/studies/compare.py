"""Several optimizers on one and the same nonlinear program."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from stc.errors import EndedError, UsageError
from stc.optimizers import caution, has_long_steps, optimizer_of
from stc.pipeline import solve
from stc.records import dataclass
from stc.solver.options import given_options

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.problem import Problem
    from stc.solver.options import Options
    from stc.transcription import Transcription

__all__ = ["Run", "compare"]


@dataclass(frozen=True, slots=True)
class Run:
    """The result of one optimizer.

    Attributes:
        optimizer: its name.
        status: as in a solution, or ``refused`` if the optimizer cannot handle the problem, or ``skipped``.
        message: the same in words.
        objective, violation, optimality: judged in the same way for all, in the spec's own units.
        iterations: as the optimizer counts them.
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
    on_run: Callable[[Run], None] | None = None,
    skip_slow: bool = False,
    **constants: float,
) -> list[Run]:
    """Solve a model with each optimizer, from the same start and with the full limits for each.

    Args:
        model: the spec.
        optimizers: names as :func:`stc.optimizers.optimizer_of` takes them.
        method: of transcription instead of the spec's own.
        tolerance, max_iterations, time_limit, callback: as for :meth:`stc.pipeline.Model.solve`.
        announce: called before each solve with the optimizer's name, its number from 1, and the number of optimizers.
        on_run: called with each record as soon as it is known.
        skip_slow: whether to skip optimizers whose single steps may take minutes on a problem of this size.
        **constants: values of constants.

    Returns:
        One record per optimizer, in the same order; none for those after one that was interrupted.

    Raises:
        UsageError: no optimizer, or an unknown one; an invalid tolerance or limit.
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
    bound = transcription.bind(problem.constants) if skip_slow else None
    runs: list[Run] = []
    for number, name in enumerate(optimizers, 1):
        if announce is not None:
            announce(name, number, len(optimizers))
        if bound is not None and has_long_steps(name, bound):
            run = Run(name, "skipped", f"{caution(name, bound)}; --optimizers {name} runs it all the same")
        else:
            run = _run(transcription, problem, options, callback, name)
        runs.append(run)
        if on_run is not None:
            on_run(run)
        if run.status == "interrupted":
            break
    return runs


def _run(
    transcription: Transcription,
    problem: Problem,
    options: Options,
    callback: Callable[[Any], bool | None] | None,
    name: str,
) -> Run:
    """The result of one optimizer."""
    begin = time.perf_counter()
    try:
        bound, result = solve(transcription, problem.constants, options, None, callback, name)
    except UsageError as error:
        return Run(name, "refused", error.message)
    except EndedError as ended:
        return Run(name, ended.status, ended.message)
    return Run(
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
