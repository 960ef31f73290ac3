"""Ringing: controls that alternate from node to node because the objective does not determine them.

On a singular arc the Hamiltonian is linear in a control, and only its effect over a step or two matters to the
objective.  Between the nodes it can alternate: under the trapezoidal rule from frame to frame, under hermite-simpson
from midpoint to frame as well.  The solution is right except for the control (J. T. Betts, Practical methods for
optimal control and estimation using nonlinear programming, 2010, section 4.14).  A variable that alternates at every
node for several steps is recognised as ringing.  A control that switches or oscillates keeps its value or its
direction over some nodes.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import stretches_of
from stc.phases import resolved
from stc.problem import Problem, Relation, VariableRef
from stc.records import dataclass
from stc.solution import Solution
from stc.studies.grid_error import problem_of_solution
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import ZERO, symbols

__all__ = ["Ringing", "ringing"]

FloatArray = NDArray[np.float64]

LEAST_NODES = 8
"""Least number of successive nodes at which a control that rings alternates."""
LEAST = 0.05
"""Alternations below this share of the control's range are not reported."""
ALIKE = 0.25
"""Least ratio of neighbouring alternations."""
COST = 1e-4
"""Cost of the proposed rate term, as a share of the objective, for a control that crosses its range in one step."""


@dataclass(frozen=True, slots=True)
class Ringing:
    """A variable that alternates.

    Attributes:
        variable: its name.
        statement, place: the first equation of motion that contains it, and its position; "" if there is none.
        frames: intervals, first and last frame, plus one half at midpoints.
        change: the largest change between neighbouring nodes.
        term: a term to add to the objective.
        alone: whether there is no other objective.
    """

    variable: str
    statement: str
    place: str
    frames: tuple[tuple[float, float], ...]
    change: float
    term: str
    alone: bool = False

    def to_dict(self) -> dict[str, Any]:
        """The attributes by name."""
        return asdict(self)

    def __str__(self) -> str:
        where = [f"{first:g} to {last:g}" for first, last in self.frames[:3]]
        where += ["others"] if len(self.frames) > 3 else []
        stands = f" in `{self.statement}` ({self.place})" if self.statement else ""
        rings = (
            f"{self.variable}{stands} alternates from node to node, by up to {self.change:.2g}, at frames "
            f"{' and '.join(where)}: ringing"
        )
        if self.alone:
            return (
                f"{rings}, since no objective determines it. Add the rate term `{self.term}` as an objective"
            )
        return (
            f"{rings}, as on a singular arc, where the objective does not determine it. A rate term in the objective "
            f"stops it and costs about {COST:g} of the objective: `{self.term}`. `--method central` often helps as well"
        )


def ringing(solution: Solution) -> list[Ringing]:
    """The controls of a solution that ring.

    Args:
        solution: a solution; the result is empty if it is not optimal, uses central differences or has very few frames.

    Raises:
        SpecError: the text that the solution carries is not a spec.
    """
    if (
        solution.status != "optimal"
        or 2 * solution.n < LEAST_NODES
        or solution.method in ("central", "stepping")
    ):
        return []
    alternating = [
        (name, *found) for name in solution.variables if (found := _alternation(solution, name))[0]
    ]
    if not alternating:
        return []
    problem = problem_of_solution(solution)
    held = _held(problem)
    return [
        _told(problem, solution, name, stretches, change)
        for name, stretches, change in alternating
        if name not in held
    ]


def _alternation(solution: Solution, name: str) -> tuple[list[tuple[float, float]], float]:
    """The intervals on which a variable alternates, and the largest change there.

    Under hermite-simpson that may be from node to node, or from frame to frame with the midpoints between them.
    """
    channel = solution.trajectories[name, 0]
    frames = np.arange(solution.n + 1.0)
    ways = [(channel.after, frames)]
    if channel.mid is not None:
        both = np.empty(2 * solution.n + 1)
        both[::2], both[1::2] = channel.after, channel.mid
        ways = [(both, np.arange(2 * solution.n + 1) / 2), *ways, (channel.mid, frames[:-1] + 0.5)]
    size = float(np.ptp(ways[0][0]))
    if not size > 1e-9 * float(np.abs(ways[0][0]).max(initial=0.0)):
        return [], 0.0
    apart = channel.frames_apart()
    for values, at in ways:
        change = np.diff(values)
        stretches = _alternating(change, size, [int(np.searchsorted(at, frame)) for frame in apart])
        if stretches:
            largest = max(float(np.abs(change[first:last]).max()) for first, last in stretches)
            return [(float(at[first]), float(at[last])) for first, last in stretches], largest
    return [], 0.0


def _alternating(change: FloatArray, size: float, jumps: list[int]) -> list[tuple[int, int]]:
    """First and last index of each interval that alternates, given the changes and the possible jumps."""
    if len(change) < LEAST_NODES:
        return []
    part = 0.25 * np.diff(change)  # what a value differs by from the mean of itself and its neighbours' mean
    one, other = np.abs(part[:-1]), np.abs(part[1:])
    smaller = np.minimum(one, other)
    alternates = (part[:-1] * part[1:] < 0.0) & (smaller > ALIKE * np.maximum(one, other))
    alternates &= smaller > LEAST * size
    for node in jumps:
        alternates[max(node - 2, 0) : node + 1] = False
    return [
        (first + 1, last + 2) for first, last in stretches_of(alternates) if last - first >= LEAST_NODES - 2
    ]


def _held(problem: Problem) -> set[str]:
    """The variables that are not controls, or whose alternation has a cost.

    That is those that equations of motion determine, those whose squares the objective has, contact forces, which
    the ground shares out among its points as it likes, and unknowns of the transcription's own.
    """
    held = set(problem.at_nodes) | {name for one in problem.corrections for name in one.unknowns}
    held |= {name for rotation in problem.rotations for name in (*rotation.quaternion, *rotation.velocity)}
    for relation in _equations(problem):
        keys = symbols(resolved(problem, relation.body, relation.range.first))
        held |= {key.name for key in keys if isinstance(key, VariableRef) and key.order}
    for term in problem.objective:
        body = resolved(problem, term.body, term.range.first)
        for key in symbols(body):
            if isinstance(key, VariableRef) and (
                key.order or derivative(derivative(body, key), key) is not ZERO
            ):
                held.add(key.name)
    for line in problem.replay:
        if line.kind == "contact":
            held |= {key.name for key in symbols(line.body) if isinstance(key, VariableRef)}
    return held


def _equations(problem: Problem) -> list[Relation]:
    return [r for r in problem.relations if r.is_equality and r.range.first < r.range.last]


def _told(
    problem: Problem, solution: Solution, name: str, stretches: list[tuple[float, float]], change: float
) -> Ringing:
    statement = place = ""
    for relation in _equations(problem):
        keys = symbols(resolved(problem, relation.body, relation.range.first))
        if VariableRef(name) in keys:
            statement, place = relation.text, relation.span.location
            break
    channel = solution.trajectories[name, 0]
    size = float(np.ptp(np.concatenate([channel.after, [] if channel.mid is None else channel.mid])))
    weight = COST * max(abs(solution.objective), 1e-9) * solution.duration / solution.n / size**2
    factor = f"{float(f'{weight:.0e}'):g}*" if problem.objective else ""
    term = f"[0, n]: integral({factor}{name}'^2);"
    return Ringing(name, statement, place, tuple(stretches), change, term, not problem.objective)
