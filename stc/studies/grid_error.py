"""The discretisation error of a solution: one estimate for the objective, one for the motion.

If there is a solution close by on twice as many frames, the estimate is the difference (:mod:`stc.studies.doubled`).
If not, and within searches, the estimate comes from the steps themselves, without a solve:

A solution satisfies the nonlinear program of its grid.  Between the frames, :mod:`stc.studies.discretisation` computes
the local error of every step: the state reached by the equations minus the state of the motion.

*Objective*: moving the right-hand side of a row by an amount changes the least objective by minus its multiplier times
that amount (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, section 12.8).  The local error of a step is
such an amount, for the row that links the step's ends, so that its effect on the objective is known (dual weighted
residuals: R. Becker and R. Rannacher, An optimal control approach to a posteriori error estimation, Acta Numerica 10,
2001).  The difference between the objective's integrals and the method's sums is added.

*Motion*: the local errors of a quantity, added up along the motion with their signs, those of a rate integrated as
well; half of the distance between the largest and the smallest sum, since given ends constrain it on either side.  The
error of a control that switches within a step is added: its curve is a ramp there, and the states have an error of up
to a quarter of the step times the jump of their rate.  Such corners are detected in the rates, if these change from
step to step as no smooth curve on this grid would.

Neither estimate is a bound.  They do not account for a system that amplifies errors, a flat optimum, or another optimum
that exists only on a finer grid (docs/grid_error.md has statistics).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.phases import named_cuts, resolved
from stc.problem import Problem, Rotation, VariableRef
from stc.records import dataclass
from stc.solution import MultiplierBlock, Solution
from stc.studies.difference_gaps import ends_of_sums, gaps_of, moved_rows, moved_terms
from stc.studies.discretisation import States, local_errors, quadrature_errors
from stc.studies.doubled import NotFoundError, change_when_doubled, sizes
from stc.symbolic.expr import symbols
from stc.trajectory import Channel

__all__ = [
    "GROSS",
    "NO_GUESS",
    "GridError",
    "determined",
    "grid_error",
    "local_grid_error",
    "problem_of_solution",
]

FloatArray = NDArray[np.float64]

GROSS = 0.01
"""An error above this share of the objective, or of the range of a variable, is gross."""
NO_GUESS = 0.1
"""Above this share, the solution is not usable as a guess."""
CORNER, WIGGLE = 1.0 / 12.0, 0.2
"""Average error of the states, as a share of the step times the change of a rate that has a kink within the step."""
_LOST = (
    "a solve on twice the frames that started from this motion found no solution: the error of the grid may be larger "
    "than the estimate. Give n a larger value, or let `--refine 1e-3` add frames"
)
WHOLE = 1.0
"""Estimates are cut off at this share: the whole range, or the whole objective."""


@dataclass(frozen=True, slots=True)
class GridError:
    """The estimated discretisation error of a solution.

    Attributes:
        objective: error of the objective, relative to it; 0 without an objective.
        motion: the largest error of a variable that equations of motion determine, relative to its range, 1 at most.
        variable: which one that is; "" where no variable has a derivative.
        lost: whether a solve on twice the frames started from the solution and found none.  Both figures are then
            estimates from the steps of this grid, and may be far below the error.
    """

    objective: float
    motion: float
    variable: str
    lost: bool = False

    @property
    def largest(self) -> float:
        """The larger one of the errors of objective and motion."""
        return max(self.objective, self.motion)

    @property
    def gross(self) -> bool:
        """Whether the motion may visibly differ from that on a finer grid."""
        return not self.largest <= GROSS

    def to_dict(self) -> dict[str, Any]:
        """The figures by name."""
        return {**asdict(self), "gross": self.gross}

    def __str__(self) -> str:
        parts = [f"{self.objective:.1e} of the objective"] if self.objective else []
        parts += [f"{self.motion:.1e} of the range of {self.variable}"] if self.variable else []
        return ", ".join(parts) or "none"

    @property
    def warning(self) -> str:
        """The note for a gross or unknown error; "" if there is nothing to report."""
        if self.lost:
            return _LOST
        if not self.gross:
            return ""
        what = []
        if not self.objective <= GROSS:
            what.append(f"the objective by about {_share(self.objective)}")
        if not self.motion <= GROSS:
            what.append(f"{self.variable} by {_of_range(self.motion)}")
        return (
            f"the grid is coarse for this motion: more frames are likely to change {' and '.join(what)}. The status "
            "refers to this grid alone; `--refine 1e-3` adds frames until they change little, or set a larger n"
        )


def grid_error(solution: Solution) -> GridError | None:
    """Estimate the discretisation error of a solution, from its change on twice the frames if that can be computed.

    Args:
        solution: any optimal one.

    Returns:
        As :func:`local_grid_error`.

    Raises:
        SpecError: the text that the solution carries is not a spec.
    """
    local = local_grid_error(solution)
    if local is None:
        return None
    problem = problem_of_solution(solution)
    try:
        change = change_when_doubled(solution, determined(problem, solution))
    except NotFoundError:
        return replace(local, lost=True)
    if change is None:
        return local
    objective, moved = change
    variable = max(moved, key=lambda name: moved[name], default="")
    return GridError(
        min(objective, WHOLE) if problem.objective else 0.0, min(moved.get(variable, 0.0), WHOLE), variable
    )


def local_grid_error(solution: Solution) -> GridError | None:
    """Estimate the discretisation error of a solution from the local errors of its steps, without a solve.

    Args:
        solution: any optimal one.

    Returns:
        The estimate; None for a motion that is not optimal, has a single frame or was found by time stepping.

    Raises:
        SpecError: the text that the solution carries is not a spec.
    """
    if solution.status != "optimal" or not solution.n or not (np.diff(solution.time) > 0.0).all():
        return None
    if solution.is_sketch:
        return None
    problem = problem_of_solution(solution)
    with np.errstate(all="ignore"):
        if problem.method == "central":
            gaps = gaps_of(problem, solution)
            missed: States = {(name, order - 1): gap for (name, order), gap in gaps.by_step().items()}
            priced = moved_rows(problem, solution, gaps) + moved_terms(problem, solution, gaps)
        else:
            missed = {key: _told(error) for key, error in local_errors(problem, solution).items()}
            priced = _price(problem, solution, missed)
        priced += float(quadrature_errors(problem, solution).sum()) + ends_of_sums(problem, solution)
        motion, variable = _motion(problem, solution, missed)
    objective = abs(priced) / max(abs(solution.objective), 1e-9) if problem.objective else 0.0
    return GridError(min(_known(objective), WHOLE), motion, variable)


def problem_of_solution(solution: Solution) -> Problem:
    """The problem of a solution: from its model, else built from the text in it."""
    if solution.origin is not None:
        stated: Problem = solution.origin.transcription(solution.method, **solution.overrides)[0]
        return stated
    from stc.solution_restated import problem_of

    return problem_of(solution)


def _told(errors: FloatArray) -> FloatArray:
    """Local errors, (n,), with unknown ones replaced by the largest known one."""
    known = np.isfinite(errors)
    largest = float(np.abs(errors[known]).max(initial=0.0))
    return errors if known.all() else np.where(known, errors, largest if known.any() else np.inf)


def _known(error: float) -> float:
    """An error, or the largest possible one if it is not known."""
    return error if np.isfinite(error) else np.inf


def _of_range(error: float) -> str:
    return f"about {_share(error)} of its range" if error < WHOLE else "about its whole range"


def _share(error: float) -> str:
    """A share in words, with one digit."""
    return (
        f"{100.0 * error:.1g} %"
        if error < 0.1
        else f"{100.0 * error:.2g} %"
        if error < WHOLE
        else "all of it"
    )


# ------------------------------------------------------------------ objective


def _price(problem: Problem, solution: Solution, missed: States) -> float:
    """The change of the objective due to the local errors of all steps."""
    prices = {block.label: block for block in solution.multipliers if block.kind == "link"}
    total = 0.0
    turning = {name for rotation in problem.rotations for name in rotation.quaternion}
    for (name, order), error in missed.items():
        block = prices.get(f"link of {name}{chr(39) * order}")
        if block is not None and name not in turning:
            total -= float(_of_steps(block, solution.n)[:, 0] @ np.where(np.isfinite(error), error, 0.0))
    for rotation in problem.rotations:
        of = f"link of {rotation.quaternion[0]} to {rotation.quaternion[3]}"
        if of in prices and all((name, 0) in missed for name in rotation.quaternion):
            total -= float(
                (_of_steps(prices[of], solution.n)[:, :3] * _turned(rotation, solution, missed)).sum()
            )
    return total


def _of_steps(block: MultiplierBlock, n: int) -> FloatArray:
    """Multipliers by step, and in each in the order of its rows. (n, rows)"""
    return block.values.reshape(n, -1)


def _turned(rotation: Rotation, solution: Solution, missed: States) -> FloatArray:
    """The local error of an orientation in the form of its links: relative to an orientation within the step. (n, 3)"""
    channels = [solution.trajectories[name, 0] for name in rotation.quaternion]
    a = [c.after[:-1] if c.mid is None else c.mid for c in channels]
    e = [missed[name, 0] for name in rotation.quaternion]
    return np.stack(
        [
            a[0] * e[1] - a[1] * e[0] - a[2] * e[3] + a[3] * e[2],
            a[0] * e[2] + a[1] * e[3] - a[2] * e[0] - a[3] * e[1],
            a[0] * e[3] - a[1] * e[2] + a[2] * e[1] - a[3] * e[0],
        ],
        axis=1,
    )


# ------------------------------------------------------------------ motion


def _motion(problem: Problem, solution: Solution, missed: States) -> tuple[float, str]:
    """The largest error of a variable relative to its range, and its name."""
    cuts = set(named_cuts(problem)) | set(solution.frames_that_jump().tolist())
    worst, variable = 0.0, ""
    for name, size in sizes(solution, determined(problem, solution)).items():
        error = _known((_accumulated(solution, missed, name) + _switches(solution, name, cuts)) / size)
        if error > worst or not variable:
            worst, variable = error, name
    return min(worst, WHOLE), variable


def determined(problem: Problem, solution: Solution) -> Iterator[str]:
    """The variables that equations of motion determine; if there are none, all variables with a rate."""
    found = set()
    for relation in problem.relations:
        if relation.is_equality and relation.range.first < relation.range.last:
            bodies = [relation.body] if relation.lower is None else [relation.body, relation.lower]
            for body in bodies:
                keys = symbols(resolved(problem, body, relation.range.first))
                found |= {key.name for key in keys if isinstance(key, VariableRef) and key.order}
    found |= {name for rotation in problem.rotations for name in rotation.quaternion}
    for name in solution.variables:
        if name in found if found else (name, 1) in solution.trajectories:
            yield name


def _accumulated(solution: Solution, missed: States, name: str) -> float:
    """Half the spread of a variable's local errors, added up along the motion, those of its rates integrated."""
    lengths = np.diff(solution.time)
    total = np.zeros(solution.n)
    for order in sorted((k for v, k in missed if v == name), reverse=True):
        own = np.cumsum(missed[name, order])
        total = own + np.cumsum(lengths * (total - total.mean())) if total.any() else own
    if not np.isfinite(total).all():
        return np.inf
    return 0.5 * float(max(total.max(initial=0.0), 0.0) - min(total.min(initial=0.0), 0.0))


def _switches(solution: Solution, name: str, cuts: set[int]) -> float:
    """The error of a variable due to changes of its highest rate within steps; frames that the spec names do not
    count.
    """
    top = max(order for variable, order in solution.trajectories if variable == name)
    if not top:
        return 0.0
    rate, lengths = solution.trajectories[name, top], np.diff(solution.time)
    steps, odd = (2, _ramps(rate)) if rate.mid is None else (4, _wiggles(rate))
    if not len(odd):
        return 0.0
    named = np.zeros(len(odd), bool)
    for cut in cuts:
        named[max(cut - steps + 1, 0) : max(cut, 0)] = True
    size = np.max([lengths[j : j + len(odd)] for j in range(steps)], axis=0) ** top
    return float(np.where(named, 0.0, odd * size).max(initial=0.0))


def _ramps(rate: Channel) -> FloatArray:
    """The error of each inner frame as a share of a step, times the change of the rate there, (n-1,).

    A switch between two frames is a ramp over the two steps beside the frame whose rate is neither the one before nor
    the one after it: of these two changes the smaller one, times half a step, is what the ramp leaves at that frame.
    A frame whose rate stands out from both of its neighbours is off by half as much.  A corner where the slope alone
    changes is somewhere within a step.
    """
    change = rate.before[1:] - rate.after[:-1]
    size = np.abs(change)
    around = np.concatenate([[0.0], size, [0.0]])
    one, other = change[:-1], change[1:]
    smaller = np.minimum(size[:-1], size[1:])
    ramp = 0.5 * np.maximum(smaller - np.maximum(around[:-3], around[3:]), 0.0)
    bend = np.abs(other - one)
    corner = (
        CORNER
        * bend
        * np.minimum(1.0, bend / np.maximum(np.ptp([0.0 * one, one, one + other], axis=0), 1e-300))
    )
    apart = np.concatenate([[False], one * other < 0.0, [False]])
    alternating = apart[1:-1] & (apart[:-2] | apart[2:])
    return np.where(alternating, 0.25 * smaller, np.maximum(ramp, corner))


def _wiggles(rate: Channel) -> FloatArray:
    """The deviation of the mean rates of four steps from a parabola, minus their larger changes. (n-3,)

    Means over the steps: what a control does at the midpoints alone moves no state.
    """
    assert rate.mid is not None
    mean = (rate.after[:-1] + 4.0 * rate.mid + rate.before[1:]) / 6.0
    if len(mean) < 4:
        return np.zeros(0)
    four = np.array([mean[k : len(mean) - 3 + k] for k in range(4)])
    jumps = np.abs(four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0]) / 3.0
    return WIGGLE * jumps * np.sqrt(np.minimum(1.0, jumps / np.maximum(np.ptp(four, axis=0), 1e-300)))
