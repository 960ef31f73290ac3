"""The kind of stationary point of a solution with complementary pairs, and the frames where both sides are zero.

With multipliers ``u`` and ``v`` of ``a = 0`` and ``b = 0`` in the program where each is an equation, a point is
strongly stationary if both are at least 0 wherever both sides are zero, M-stationary if both are or one is 0,
and C-stationary if their product is at least 0 (H. Scheel and S. Scholtes, Mathematical programs with complementarity
constraints: stationarity, optimality, and sensitivity, Math. Oper. Res. 25, 2000).  Strongly stationary points are
B-stationary: no direction in which the statements hold, linearised, lowers the objective.  For other points this is
tested for each choice of sides, by a linear program.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.origin import model_of
from stc.records import dataclass
from stc.solution import Solution
from stc.solver.pairs import Pairs
from stc.studies.explain import frames_in_words
from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership

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
MOST_SIDES, MOST_UNKNOWNS = 8, 20_000
"""Largest numbers of pairs and of unknowns for which both choices of sides are tried."""


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
        stationarity: ``"strong"``, ``"M"``, ``"C"`` or ``"weak"``.
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
        kind = {"strong": "strongly stationary", "weak": "weakly stationary"}.get(
            self.stationarity, f"{self.stationarity}-stationary"
        )
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
    """The residual and stationarity of the pairs of an optimal solution; None if it has none, or is not optimal.

    Raises:
        SpecError: the text is not a spec.
    """
    if solution.status != "optimal":
        return None
    model = model_of(solution)
    problem, transcription = model.transcription(solution.method, **solution.overrides)
    if not any(relation.complementary for relation in problem.relations):
        return None
    bound = transcription.bind(problem.constants, check=False)
    pairs: Pairs = bound.pairs
    if not len(pairs) or len(solution.x) != bound.n or len(solution.row_multipliers) != bound.m:
        return None
    rows = bound.values(solution.x)[1].copy()
    spare = pairs.spare(bound, solution.x, rows)
    both = (spare <= NOTHING).all(axis=1)
    pushes = _side_multipliers(bound, pairs, spare, solution)
    tolerance = SIGN * max(1.0, float(np.abs(pushes).max(initial=0.0)))
    kind = _kind(pushes[both], tolerance)
    b_stationary: bool | None = True
    if kind != "strong":
        b_stationary = _is_b_stationary(bound, pairs, spare, solution.x, rows)
    ownership = Ownership(transcription, bound)
    return Complementarity(
        len(pairs),
        float(pairs.shares(spare).max()),
        kind,
        b_stationary,
        list(_degenerate(ownership, pairs.product[both])),
    )


def _side_multipliers(bound: BoundProgram, pairs: Pairs, spare: FloatArray, solution: Solution) -> FloatArray:
    """The multipliers of the equations ``a = 0`` and ``b = 0``, (k, 2): those of the bounds minus the products'
    part.
    """
    given = np.concatenate([solution.bound_multipliers, solution.row_multipliers])
    pulls = np.zeros(len(given))
    weight = solution.row_multipliers[pairs.product]
    for own, other in ((0, 1), (1, 0)):  # a side may be one of several pairs
        np.add.at(pulls, pairs.side[:, own], weight * np.maximum(spare[:, other], 0.0))
    return np.where(pairs.lower, -1.0, 1.0) * given[pairs.side] - pulls[pairs.side]


def _kind(pushes: FloatArray, tolerance: float) -> str:
    """The kind of stationary point, for multipliers (k, 2) of pairs with both sides zero."""
    some = np.abs(pushes) > tolerance
    negative = some & (pushes < 0.0)
    if not negative.any():
        return "strong"
    if not (negative.any(axis=1) & some.all(axis=1)).any():
        return "M"
    mixed = negative.any(axis=1) & ~negative.all(axis=1) & some.all(axis=1)
    return "weak" if mixed.any() else "C"


def _is_b_stationary(
    bound: BoundProgram, pairs: Pairs, spare: FloatArray, x: FloatArray, rows: FloatArray
) -> bool | None:
    """Whether no direction lowers the objective, whichever sides are chosen; None if there are too many choices."""
    open_ = np.flatnonzero((spare <= NOTHING).all(axis=1))
    if open_.size > MOST_SIDES or bound.n > MOST_UNKNOWNS:
        return None
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, identity, vstack

    gradient, jac, _ = bound.derivatives(x, np.zeros(bound.m), 0.0)
    entries = csr_array((jac, (bound.jac_rows, bound.jac_cols)), shape=(bound.m, bound.n))
    matrix = vstack([identity(bound.n, format="csr"), entries], format="csr")
    value = np.concatenate([x, rows])
    low = np.concatenate([bound.x_lower, bound.row_lower])
    high = np.concatenate([bound.x_upper, bound.row_upper])
    low[bound.n + pairs.product], high[bound.n + pairs.product] = -np.inf, np.inf
    size = np.maximum(1.0, np.abs(value))
    with np.errstate(invalid="ignore"):
        at_low, at_high = value - low <= CLOSE * size, high - value <= CLOSE * size
    at_low |= np.isin(np.arange(len(value)), pairs.side[pairs.lower & (spare <= NOTHING)])
    at_high |= np.isin(np.arange(len(value)), pairs.side[~pairs.lower & (spare <= NOTHING)])
    closed = np.setdiff1d(np.arange(len(pairs)), open_)
    held = pairs.side[closed, spare[closed].argmin(axis=1)]
    steepest = float(np.abs(gradient).max(initial=0.0))
    for choice in product((0, 1), repeat=open_.size):
        fixed = np.zeros(len(value), bool)
        fixed[held] = True
        fixed[pairs.side[open_, list(choice)]] = True
        below, above = at_low | fixed, at_high | fixed
        found = linprog(
            gradient,
            A_ub=vstack([matrix[above], -matrix[below]], format="csr"),
            b_ub=np.zeros(int(above.sum() + below.sum())),
            bounds=(-1.0, 1.0),
        )
        if not found.success:
            return None
        if found.fun < -SIGN * max(1.0, steepest):
            return False
    return True


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
