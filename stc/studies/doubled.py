"""The change of a solution on twice as many frames, from a short solve that starts from it.

Local errors show the error of each step, but not the change of the optimum: a system may amplify them, and a flat
optimum can move far while its cost hardly changes.  A finer grid shows both.  From a good solution its solve takes a
few iterations; a solve that takes many is stopped without a result.  Its limit is in processor time, so that the load
of the machine has no influence.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np

from stc.deadline import spent
from stc.errors import StcError
from stc.solution import Solution
from stc.solution_origin import model_of
from stc.solving.same_motion import check_same_motion
from stc.studies.frames import ORDER, Spread
from stc.trajectory import Channel

__all__ = ["FROM_COARSER", "NotFoundError", "apart", "change_when_doubled", "sizes"]

FROM_COARSER = 100
"""Limit of iterations from the solution on fewer frames. Near a solution it takes two or three, or some tens."""
LEAST_RANGE = 1e-6
"""A variable whose range is below this share of the largest range counts as constant."""
STILL = 1e-4
"""A coordinate of a model stands still if it moves by less than this, in m or rad: 1 % of it, 1e-6, is the least drift
that the validation allows."""
SHARE_OF_TIME, LEAST_TIME = 0.25, 1.0
"""Limits of the finer solve's processor time: a share of that of the solution, and a least number of seconds."""
FEW, LATE = 20, 2.0
"""The number of iterations expected of the finer solve, which is not begun if these exceed its time limit; once begun,
it may take this multiple of the limit, so that the result does not depend on small differences of speed."""


class NotFoundError(Exception):
    """The solve on twice the frames ended without a motion, though it had the time that it asked for."""


def change_when_doubled(solution: Solution, names: Iterable[str]) -> tuple[float, dict[str, float]] | None:
    """The errors that follow from the change to a grid with twice as many frames.

    A method of order p leaves ``2^-p`` of an error on the finer grid; so the whole error is the change over
    ``1 - 2^-p`` (L. F. Richardson's extrapolation).

    Args:
        solution: an optimal one.
        names: of the variables to compare.

    Returns:
        The error of the objective, relative to it, and of each variable, relative to its range; None where the finer
        solve was not started or was stopped, or if the spec does not define the same motion on more frames.

    Raises:
        NotFoundError: the finer grid has no solution close by.
        SpecError: the text that the solution carries is not a spec.
    """
    allowed = max(SHARE_OF_TIME * solution.seconds.get("processor", 0.0), LEAST_TIME)
    if _expected(solution) > allowed:
        return None
    model = model_of(solution)
    callback = spent(LATE * allowed)
    try:
        spread = Spread.of(model, solution.method, solution.overrides)
        constants = {**solution.overrides, **spread.multiplied(2)}
        ends = np.array([0, solution.n])
        if (
            check_same_motion(spread.problem, model.problem(solution.method, **constants), ends, 2 * ends)
            != 1.0
        ):
            return None  # a sum over all frames is another objective on other frames
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what there is to warn of was said of the solution itself
            finer = model.solve(
                method=solution.method,
                constants=constants,
                warm_start=solution,
                max_iterations=FROM_COARSER,
                callback=callback,
            )
    except StcError:
        return None
    if finer.status == "interrupted" or finer.n != 2 * solution.n:
        return None
    if finer.status != "optimal":
        raise NotFoundError
    whole = 1.0 / (1.0 - 0.5 ** ORDER[solution.method])
    objective = abs(solution.objective - finer.objective) / max(abs(finer.objective), 1e-9)
    return whole * objective, {name: whole * error for name, error in apart(solution, finer, names).items()}


def _expected(solution: Solution) -> float:
    """The least processor time of a solve on twice the frames, in seconds.

    The spec is read once more, and an iteration takes twice as long; derivatives and kernels are reused.
    """
    seconds = solution.seconds
    total = seconds.get("total", 0.0)
    if not total > 0.0:
        return 0.0
    wall = seconds.get("parse", 0.0) + 2.0 * FEW * seconds.get("solve", 0.0) / max(solution.iterations, 1)
    return seconds.get("processor", 0.0) * wall / total


def apart(coarse: Solution, finer: Solution, names: Iterable[str]) -> dict[str, float]:
    """The largest difference of each variable between two grids, one of which contains the frames of the other.

    Returns:
        Relative to the size of the variable on the finer grid (:func:`sizes`).
    """
    times = finer.n // coarse.n
    found = {}
    for name, size in sizes(finer, names).items():
        one, other = coarse.trajectories[name, 0], finer.trajectories[name, 0]
        gaps = [np.abs(one.before - other.before[::times]), np.abs(one.after - other.after[::times])]
        found[name] = float(np.max(gaps)) / size
    return found


def sizes(solution: Solution, names: Iterable[str]) -> dict[str, float]:
    """The range to which the error of each variable is relative; for a variable that stands still, a least range."""
    ranges = {name: _range(solution.trajectories[name, 0]) for name in names}
    least = max(LEAST_RANGE * max(ranges.values(), default=0.0), 1e-9)
    return {
        name: max(size, least, STILL if name.startswith("joint.") else 0.0) for name, size in ranges.items()
    }


def _range(channel: Channel) -> float:
    """The range of a quantity; at least a thousandth of its size."""
    values = np.concatenate([channel.before, channel.after])
    return max(float(np.ptp(values)), 1e-3 * float(np.abs(values).max()))
