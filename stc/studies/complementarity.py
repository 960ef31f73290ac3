"""The kind of stationary point of a solution with complementary pairs, and the frames where both sides are zero.

With multipliers ``u`` and ``v`` of ``a = 0`` and ``b = 0`` in the program where each side that is zero is an equation,
a point is strongly stationary if both are at least 0 wherever both sides are zero, M-stationary if both are or one is
0, and C-stationary if their product is at least 0 (H. Scheel and S. Scholtes, Mathematical programs with
complementarity constraints: stationarity, optimality, and sensitivity, Math. Oper. Res. 25, 2000).  Strongly stationary
points are B-stationary: no direction in which the statements hold, linearised, lowers the objective.  For other points
this is tested for each choice of sides.

Each test is a linear program at the point, whose duals are the multipliers.  Those of the solver do not tell: where
the smaller sides were held, the sign of a multiplier may be wrong, and the product's multiplier hides it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.problem import Problem
from stc.records import dataclass
from stc.solution import Solution
from stc.solution_origin import model_of
from stc.solution_restated import stated_again
from stc.solver.pairs import Pairs
from stc.studies.explain import frames_in_words
from stc.symbolic.expr import ZERO
from stc.transcription.bind import BoundProgram
from stc.transcription.layout import Layout
from stc.transcription.ownership import Ownership
from stc.transcription.transcription import Transcription

__all__ = ["Complementarity", "Degenerate", "complementarity"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer]

NOTHING = 1e-5
"""A side below this counts as 0. It is ten times the remainder where multipliers are unbounded."""
CLOSE = 1e-6
SIGN = 1e-4
"""Multipliers below this share of the largest one count as 0, and so do descents below this share of the largest
slope.
"""
KINDS = ("strong", "M", "C", "weak", "unknown")
MOST_SIDES, MOST_UNKNOWNS, MOST_SECONDS = 8, 20_000, 10.0
"""Largest numbers of pairs and of unknowns for which both choices of sides are tried, and the time for each choice."""


@dataclass(frozen=True, slots=True)
class Degenerate:
    """The frames at which both sides of a pair are zero.

    Attributes:
        statement, place: its text and position.
        frames: frame indices, plus one half at midpoints; empty in a problem without frames.
    """

    statement: str
    place: str
    frames: list[float]

    def __str__(self) -> str:
        where = f" at frames {frames_in_words(self.frames)}" if self.frames else ""
        return f"`{self.statement}` ({self.place}){where}"


@dataclass(frozen=True, slots=True)
class Complementarity:
    """The residual and stationarity of the complementary pairs of a solution.

    Attributes:
        pairs: number of pairs.
        residual: the largest of the smaller sides, relative to max(1, larger side).
        stationarity: ``"strong"``, ``"M"``, ``"C"``, ``"weak"`` or ``"unknown"``.
        b_stationary: whether no direction lowers the objective to first order; None if it is not known.
        degenerate: the statements of which both sides are zero somewhere.
    """

    pairs: int
    residual: float
    stationarity: str
    b_stationary: bool | None
    degenerate: list[Degenerate]

    def to_dict(self) -> dict[str, Any]:
        """The attributes by name."""
        return asdict(self)

    def __str__(self) -> str:
        kind = {
            "strong": "strongly stationary",
            "weak": "weakly stationary",
            "unknown": "the kind of stationary point is not known",
        }.get(self.stationarity, f"{self.stationarity}-stationary")
        also = {
            True: "B-stationary",
            False: "not B-stationary: another choice of sides lowers the objective",
            None: "not known to be B-stationary",
        }[self.b_stationary]
        pairs = "1 complementary pair" if self.pairs == 1 else f"{self.pairs} complementary pairs"
        text = f"{pairs} within {self.residual:.1g}: {kind}, {also}"
        return text + (
            "; both sides are zero in " + ", ".join(map(str, self.degenerate)) if self.degenerate else ""
        )


def complementarity(solution: Solution) -> Complementarity | None:
    """The residual and stationarity of the pairs of an optimal solution, and of its contacts that nobody schedules;
    None if it has none, or is not optimal.

    Raises:
        SpecError: the text is not a spec.
    """
    if solution.status != "optimal":
        return None
    model = model_of(solution)
    problem, transcription = model.transcription(solution.method, **solution.overrides)
    if not problem.free_contacts and not any(relation.complementary for relation in problem.relations):
        return None
    bound = transcription.bind(problem.constants, check=False)
    if len(solution.x) != bound.n or len(solution.row_multipliers) != bound.m:
        return None
    found = list(_of_contacts(solution, problem))
    if len(bound.pairs):
        found.append(_of_pairs(solution, transcription, bound))
    return _together(found) if found else None


def _together(found: Sequence[Complementarity]) -> Complementarity:
    """Combine the findings on parts of a motion: the weakest kind, and B-stationarity only if all parts have it."""
    known = [one.b_stationary for one in found]
    return Complementarity(
        sum(one.pairs for one in found),
        max(one.residual for one in found),
        max((one.stationarity for one in found), key=KINDS.index),
        False if False in known else None if None in known else True,
        [degenerate for one in found for degenerate in one.degenerate],
    )


def _of_pairs(solution: Solution, transcription: Transcription, bound: BoundProgram) -> Complementarity:
    pairs: Pairs = bound.pairs
    rows = bound.values(solution.x)[1].copy()
    spare = pairs.spare(bound, solution.x, rows)
    both = (spare <= NOTHING).all(axis=1)
    kind, b_stationary = _stationarity(bound, transcription.layout, solution.x, rows, spare)
    ownership = Ownership(transcription, bound)
    return Complementarity(
        len(pairs),
        float(pairs.shares(spare).max()),
        kind,
        b_stationary,
        list(_degenerate(ownership, pairs.product[both])),
    )


def _of_contacts(solution: Solution, problem: Problem) -> Iterator[Complementarity]:
    """What is known of contacts whose laws are relaxed by a constant e.

    Products of a force, in weights, and of what has to be zero where it acts are at most e: the smaller factor is at
    most its root.  A frame at which one factor is larger has been decided, and as e goes to zero a KKT point with all
    frames decided becomes one of the program in which the other factors are equations: it is strongly stationary.  At
    other frames nothing is known (S. Scholtes, Convergence properties of a regularization scheme for mathematical
    programs with complementarity constraints, SIAM J. Optim. 11, 2001).
    """
    contacts = [contact for contact in problem.free_contacts if contact.relaxed]
    if not contacts:
        return
    from stc.language.model.free import RATE  # which most specs do without

    relaxation = solution.constants[problem.relaxation]
    recovery = stated_again(solution).recovery(solution.x, solution.constants)
    for contact in contacts:
        push = np.abs(recovery.channel(contact.pressure).before[1:]) / contact.weight
        gap = np.abs(np.sum([recovery.channel(one).before[1:] for one in contact.gaps], axis=0))
        open_ = np.maximum(push, gap) <= np.sqrt(relaxation)
        if contact.sticks:
            rates = [recovery.channel(rate).before[1:] for rate in contact.slip if rate is not ZERO]
            speed = np.max(np.abs(rates), axis=0, initial=0.0) if rates else np.zeros(len(push))
            if len(contact.gaps) == 1:  # a point stands still until it has left
                speed = np.maximum(speed, np.append(speed[1:], 0.0))
            open_ &= speed <= np.sqrt(RATE * relaxation)
        decided = contact.sticks and not open_.any()
        frames = (1.0 + np.flatnonzero(open_)).tolist()
        where = Degenerate(f"free: {contact.name}", contact.span.location, frames)
        yield Complementarity(
            len(push),
            float(np.max(np.minimum(push, gap) / np.maximum(1.0, np.maximum(push, gap)))),
            "strong" if decided else "unknown",
            True if decided else None,
            [where] if frames else [],
        )


def _stationarity(
    bound: BoundProgram, layout: Layout, x: FloatArray, rows: FloatArray, spare: FloatArray
) -> tuple[str, bool | None]:
    """The kind of stationary point, and whether it is B-stationary; None if that is not known.

    Args:
        bound, layout: the program, and where its unknowns are.
        x, rows: the point (n,) and the values of the rows there (m,).
        spare: of the sides of its pairs, (k, 2).
    """
    pairs: Pairs = bound.pairs
    open_ = np.flatnonzero((spare <= NOTHING).all(axis=1))
    if not open_.size:
        return "strong", True  # the program with equations is the only choice of sides
    if bound.n > MOST_UNKNOWNS:
        return "unknown", None
    near = _Linearised(bound, spare, x, rows, _sizes(layout, x))
    if (descent := near.descends(near.held)) is None:
        return "unknown", None
    if not descent:
        return "strong", True
    kind = _kind(near.multipliers(open_))
    if open_.size > MOST_SIDES:
        return kind, None
    for choice in product((0, 1), repeat=open_.size):
        descent = near.descends(np.concatenate([near.held, pairs.side[open_, list(choice)]]))
        if descent is None or descent:
            return kind, None if descent is None else False
    return kind, True


def _kind(pushes: FloatArray | None) -> str:
    """The kind of stationary point that is not strongly so, for multipliers (k, 2) of pairs with both sides zero."""
    if pushes is None:
        return "unknown"
    some = np.abs(pushes) > SIGN * max(1.0, float(np.abs(pushes).max(initial=0.0)))
    negative = some & (pushes < 0.0)
    if not (negative.any(axis=1) & some.all(axis=1)).any():
        return "M"
    mixed = negative.any(axis=1) & ~negative.all(axis=1) & some.all(axis=1)
    return "weak" if mixed.any() else "C"


def _sizes(layout: Layout, x: FloatArray) -> FloatArray:
    """The largest value of each unknown on any frame, (n,); 1 where it is zero on all."""
    sizes = np.ones(len(x))
    for _, _, *places in layout.slots():
        at = np.concatenate(places)
        largest = float(np.abs(x[at]).max(initial=0.0))
        sizes[at] = largest if largest > NOTHING else 1.0
    scalar = list(layout.parameters.values())
    sizes[scalar] = np.where(np.abs(x[scalar]) > NOTHING, np.abs(x[scalar]), 1.0)
    return sizes


class _Linearised:
    """The objective and the active statements at a point, without the products: linear programs of directions.

    Attributes:
        sizes: by how much an unknown may change, (n,).
        held: places in (variables, rows) of the sides that are zero while the other side is not.
    """

    def __init__(
        self,
        bound: BoundProgram,
        spare: FloatArray,
        x: FloatArray,
        rows: FloatArray,
        sizes: FloatArray,
    ) -> None:
        from scipy.sparse import csr_array, identity, vstack

        pairs: Pairs = bound.pairs
        self.pairs, self.sizes = pairs, sizes
        self.gradient, jac, _ = bound.derivatives(x, np.zeros(bound.m), 0.0)
        entries = csr_array((jac, (bound.jac_rows, bound.jac_cols)), shape=(bound.m, bound.n))
        self.matrix = vstack([identity(bound.n, format="csr"), entries], format="csr")
        value = np.concatenate([x, rows])
        low = np.concatenate([bound.x_lower, bound.row_lower])
        high = np.concatenate([bound.x_upper, bound.row_upper])
        low[bound.n + pairs.product], high[bound.n + pairs.product] = -np.inf, np.inf
        size = np.maximum(1.0, np.abs(value))
        with np.errstate(invalid="ignore"):
            self.at_low, self.at_high = value - low <= CLOSE * size, high - value <= CLOSE * size
        self.at_low[pairs.side[pairs.lower & (spare <= NOTHING)]] = True
        self.at_high[pairs.side[~pairs.lower & (spare <= NOTHING)]] = True
        closed = np.flatnonzero((spare > NOTHING).any(axis=1))
        self.held = pairs.side[closed, spare[closed].argmin(axis=1)]
        self.steep = SIGN * max(1.0, float(np.abs(self.gradient * sizes).max(initial=0.0)))

    def descends(self, held: IntArray) -> bool | None:
        """Whether a direction that leaves some sides as they are lowers the objective; None if that is not found."""
        found, _, _ = self._solved(held)
        return None if found is None else found.fun < -self.steep

    def multipliers(self, open_: IntArray) -> FloatArray | None:
        """The multipliers of both sides of some pairs, (k, 2), with all sides that are zero held."""
        side, lower = self.pairs.side[open_], self.pairs.lower[open_]
        found, above, below = self._solved(np.concatenate([self.held, side.ravel()]))
        if found is None or found.fun < -self.steep:
            return None
        upward = np.zeros(len(self.at_low))
        upward[above] += found.ineqlin.marginals[: above.size]
        upward[below] -= found.ineqlin.marginals[above.size :]
        return np.where(lower, 1.0, -1.0) * upward[side]

    def _solved(self, held: IntArray) -> tuple[Any, IntArray, IntArray]:
        """The steepest direction, and the places of statements whose value may not grow, and may not fall."""
        from scipy.optimize import linprog
        from scipy.sparse import vstack

        fixed = np.zeros(len(self.at_low), bool)
        fixed[held] = True
        above, below = np.flatnonzero(self.at_high | fixed), np.flatnonzero(self.at_low | fixed)
        found = linprog(
            self.gradient,
            A_ub=vstack([self.matrix[above], -self.matrix[below]], format="csr"),
            b_ub=np.zeros(above.size + below.size),
            bounds=np.column_stack([-self.sizes, self.sizes]),
            options={"time_limit": MOST_SECONDS},
        )
        return found if found.success else None, above, below


def _degenerate(ownership: Ownership, products: IntArray) -> Iterable[Degenerate]:
    """The statements of some products (k,), with their frames."""
    owners = ownership.row_owner[products]
    for number in dict.fromkeys(owners.tolist()):
        relation = ownership.problem.relations[number]
        frames = ownership.row_nodes[0][products[owners == number]] / 2
        in_time = ownership.problem.n > 0
        yield Degenerate(
            relation.text, relation.span.location, sorted(set(frames.tolist())) if in_time else []
        )
