"""A spec at one point, evaluated in plain NumPy: objective, statements, bounds, optimality conditions.

The solver evaluates a problem through compiled kernels, its own derivatives and its own scaling.  Here expressions are
evaluated one operator at a time, derivatives come from :mod:`stc.symbolic.slopes`, and nothing is scaled, so that the
result of a solve can be checked independently.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, ParameterRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, symbols
from stc.symbolic.slopes import Sweep
from stc.transcription.bind import Bounds, evaluate_bounds
from stc.transcription.grid import IntArray, Nodes
from stc.transcription.lower import DataRef
from stc.transcription.numbers import Numbers
from stc.transcription.pairs import find_pairs
from stc.transcription.stated import Stated
from stc.transcription.statements import LINK, Row

FloatArray = NDArray[np.float64]

#: Nodes that are evaluated in one go: bounds the memory of long motions.
_CHUNK = 4096
#: Mean multipliers above this are what errors are relative to, and the most that they count for.
MEAN_MULTIPLIER, LARGEST_SCALE = 100.0, 1e3


@dataclass(frozen=True, slots=True)
class Miss:
    """The violation of a statement at one node.

    Attributes:
        relation: index of the relation, -1 for links between a variable and its derivative.
        label: name of the link; "" for relations.
        frame: the frame, plus one half at midpoints.
        value: value of the statement's body, in its own units.
        bound: the bound that is violated.
        amount: the violation, in the same units.
    """

    relation: int
    label: str
    frame: float
    value: float
    bound: float
    amount: float

    @property
    def share(self) -> float:
        """The amount relative to max(1, the bound)."""
        return self.amount / max(1.0, abs(self.bound)) if self.amount == self.amount else np.inf


@dataclass(slots=True)
class Found:
    """The figures of a point.

    Attributes:
        objective: its value.
        objective_size: the sum of its terms' magnitudes.
        violation: largest violation of a row or of a bound of an unknown, each relative to max(1, the bound).
        misses: the statements that are violated, worst place of each, the worst first; links after those of the spec.
        stationarity: largest entry of the Lagrangian's gradient with the given multipliers, (N,) entries.
        complementarity: largest product of a multiplier and the distance, at most 1, from its bound.
        size: the scale of both: the largest of the largest term in the gradient, the mean multiplier over 100, and 1.
        steepest: the unknown with the largest entry of the Lagrangian's gradient, with its frame (-1: none).
        loosest: the statement or name with the largest product of multiplier and distance, and its frame.
        unpaired: the largest smaller side of a complementary pair, relative to max(1, larger side).
        loosest_pair: the statement of that pair, and frame.
    """

    objective: float
    objective_size: float
    violation: float
    misses: list[Miss]
    stationarity: float
    complementarity: float
    size: float
    steepest: tuple[str, float]
    loosest: tuple[str, float]
    unpaired: float
    loosest_pair: tuple[str, float]

    @property
    def optimality(self) -> float:
        """The first-order error, relative to ``size``."""
        return max(self.stationarity, self.complementarity) / self.size


class Point:
    """One point of a stated problem, with multipliers.

    Args:
        stated: the problem.
        x: (N,) unknowns; y: (M,) multipliers of rows; z: (N,) multipliers of bounds.

    Raises:
        EvaluationError: a bound has no value.
    """

    def __init__(self, stated: Stated, x: FloatArray, y: FloatArray, z: FloatArray) -> None:
        self.stated, self.x, self.y, self.z = stated, x, y, z
        constants = stated.problem.constants
        steps = stated.steps
        self.numbers = Numbers(stated.statements, steps, steps.coefficients(constants), constants)
        self.bounds: Bounds = evaluate_bounds(stated.problem, stated.statements, stated.layout, self.numbers)
        self._constants: dict[Hashable, Any] = {ConstantRef(name): value for name, value in constants.items()}
        self.misses: dict[tuple[int, str], Miss] = {}

    def found(self) -> Found:
        """The objective, the violation and the first-order error at the point."""
        gradient, lagrangian = np.zeros(len(self.x)), self.z.copy()
        objective, magnitude, largest_term = 0.0, 0.0, 0.0
        complementarity, violation, loosest = 0.0, 0.0, ("", -1.0)
        rows = np.zeros(len(self.y))
        for summand in self.stated.statements.summands:
            for nodes, sweep, keys in self._sweeps([summand.body], summand.nodes):
                values = np.broadcast_to(sweep.values[0], len(nodes))
                objective += float(values.sum())
                magnitude += float(np.abs(values).sum())
                for key, slope in sweep.slopes(0, keys.keys()).items():
                    np.add.at(gradient, keys[key], np.broadcast_to(slope, len(nodes)))
        lagrangian += gradient
        for row, ids in self._rows():
            for nodes, sweep, keys, at in self._row_sweeps(row, ids):
                value = rows[at] = np.broadcast_to(sweep.values[0], len(nodes))
                lower, upper = self._ends(row.lower, row.upper, nodes)
                violation = max(violation, self._note(row, value, lower, upper, nodes))
                y = self.y[at]
                if not y.any():
                    continue
                product = _product(y, value, lower, upper)
                if _largest(product) > complementarity:
                    complementarity = _largest(product)
                    loosest = self._place(row, nodes, int(np.argmax(product)))
                terms: dict[bytes, FloatArray] = {}
                for key, slope in sweep.slopes(0, keys.keys()).items():
                    place = keys[key]
                    part = np.broadcast_to(slope, len(nodes)) * y
                    np.add.at(lagrangian, place, part)
                    same = place.tobytes()
                    terms[same] = terms[same] + part if same in terms else part
                largest_term = max(largest_term, *(_largest(np.abs(each)) for each in terms.values()), 0.0)
        for bound in self.stated.statements.bounds:
            self._note_bound(bound)
        low, high = self.bounds.lower, self.bounds.upper
        violation = max(violation, _largest(_overstepped(self.x, low, high)))
        product = _product(self.z, self.x, low, high)
        if _largest(product) > complementarity:
            complementarity = _largest(product)
            loosest = self._unknown(int(np.argmax(product)), "the bound of ")
        total = float(np.abs(self.y).sum() + np.abs(self.z).sum())
        mean = min(total / max(1, len(self.y) + len(self.z)) / MEAN_MULTIPLIER, LARGEST_SCALE)
        size = max(1.0, _largest(np.abs(gradient)), largest_term, _largest(np.abs(self.z)), mean)
        slope = np.abs(lagrangian)
        unpaired, loosest_pair = self._unpaired(rows)
        return Found(
            objective=objective,
            objective_size=magnitude,
            violation=violation,
            misses=sorted(self.misses.values(), key=lambda miss: (miss.relation == LINK, -miss.share)),
            stationarity=_largest(slope),
            complementarity=complementarity,
            size=size,
            steepest=self._unknown(int(np.argmax(slope))) if len(slope) else ("", -1.0),
            loosest=loosest,
            unpaired=unpaired,
            loosest_pair=loosest_pair,
        )

    def _unpaired(self, rows: FloatArray) -> tuple[float, tuple[str, float]]:
        """The least complementary pair, for values ``rows`` (M,): its smaller side, and its place."""
        stated, low, high = self.stated, self.bounds.lower, self.bounds.upper
        relations = stated.problem.relations
        pairs = find_pairs(
            relations, stated.statements, stated.groups, stated.layout, self.numbers.at, (low, high)
        )
        if not len(pairs):
            return 0.0, ("", -1.0)
        limits: list[list[FloatArray]] = [[low], [high]]
        for row, _ in self._rows():
            for into, end in zip(limits, self._ends(row.lower, row.upper, row.nodes), strict=True):
                into.append(end)
        ids = np.concatenate([np.arange(len(low)), *(len(low) + at for _, at in self._rows())])
        placed = np.empty((2, len(ids)))
        placed[:, ids] = [np.concatenate(parts) for parts in limits]
        value = np.concatenate([self.x, rows])[pairs.side]
        limit = np.where(pairs.lower, placed[0][pairs.side], placed[1][pairs.side])
        spare = np.where(pairs.lower, value - limit, limit - value)
        share = pairs.shares(spare)
        worst = int(np.argmax(share))
        for row, at in self._rows():
            hit = np.flatnonzero(at == pairs.product[worst])
            if hit.size:
                return float(max(share[worst], 0.0)), self._place(row, row.nodes, int(hit[0]))
        raise AssertionError("a product is a row")

    def _rows(self) -> Iterator[tuple[Row, IntArray]]:
        for group in self.stated.groups:
            for number, row in enumerate(group.rows):
                yield row, group.row_ids[number]

    def _row_sweeps(
        self, row: Row, ids: IntArray
    ) -> Iterator[tuple[Nodes, Sweep, dict[Hashable, IntArray], IntArray]]:
        begin = 0
        for nodes, sweep, keys in self._sweeps([row.body], row.nodes):
            yield nodes, sweep, keys, ids[begin : begin + len(nodes)]
            begin += len(nodes)

    def _sweeps(
        self, bodies: list[Expr], nodes: Nodes
    ) -> Iterator[tuple[Nodes, Sweep, dict[Hashable, IntArray]]]:
        """Expressions at nodes, in portions, with the positions of their unknowns in the decision vector."""
        symbols_of = dict.fromkeys(key for body in bodies for key in symbols(body))
        for begin in range(0, len(nodes), _CHUNK):
            some = nodes[np.arange(begin, min(begin + _CHUNK, len(nodes)))]
            values = dict(self._constants)
            keys: dict[Hashable, IntArray] = {}
            for key in symbols_of:
                if isinstance(key, VariableRef | ParameterRef):
                    keys[key] = self.stated.layout.position(key, some)
                    values[key] = self.x[keys[key]]
                elif isinstance(key, DataRef):
                    values[key] = self._data(key, nodes, begin, some)
            yield some, Sweep(bodies, values), keys

    def _data(self, key: DataRef, nodes: Nodes, begin: int, some: Nodes) -> FloatArray:
        if key.kind == "weight":  # a table for all nodes of its term
            return np.asarray(self.numbers.data(key, nodes))[begin : begin + _CHUNK]
        return np.asarray(self.numbers.data(key, some))

    def _ends(self, lower: Expr | None, upper: Expr | None, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
        low = np.full(len(nodes), -np.inf) if lower is None else self.numbers.at(lower, nodes)
        high = np.full(len(nodes), np.inf) if upper is None else self.numbers.at(upper, nodes)
        return low, high

    def _note(self, row: Row, value: FloatArray, lower: FloatArray, upper: FloatArray, nodes: Nodes) -> float:
        """Record the largest violation of a row; returns it, relative."""
        share = _overstepped(value, lower, upper)
        worst = _largest(share)
        if worst > 0.0:
            k = int(np.argmax(np.where(np.isnan(share), np.inf, share)))
            # Nodes of a row may belong to several relations.
            self._remember(
                int(row.relation[self._instance(row, nodes, k)]), row.label, nodes, k, value, lower, upper
            )
        return worst

    @staticmethod
    def _instance(row: Row, nodes: Nodes, k: int) -> int:
        code = 4 * row.nodes.position + row.nodes.side
        return int(np.searchsorted(code, 4 * nodes.position[k] + nodes.side[k]))

    def _place(self, row: Row, nodes: Nodes, k: int) -> tuple[str, float]:
        owner = int(row.relation[self._instance(row, nodes, k)])
        frame = float(nodes.position[k]) / 2
        if owner == LINK:
            return f"the {row.label}", frame
        relation = self.stated.problem.relations[owner]
        return f"{relation.span.location}: `{relation.text}`", frame

    def _unknown(self, position: int, what: str = "") -> tuple[str, float]:
        name, order, frame, _ = self.stated.layout.describe(position)
        return f"{what}{name}{chr(39) * order}", frame

    def _note_bound(self, bound: Any) -> None:
        """Record the largest violation of a statement in one unknown, or in none, in its own units."""
        nodes = bound.nodes
        value = np.array(self.numbers.at(bound.rest, nodes), dtype=np.float64)
        if bound.unknown is not None:
            place = self.stated.layout.position(bound.unknown, nodes)
            value = value + self.numbers.at(bound.coefficient, nodes) * self.x[place]
        lower, upper = self._ends(bound.lower, bound.upper, nodes)
        share = _overstepped(value, lower, upper)
        if _largest(share) > 0.0:
            k = int(np.argmax(np.where(np.isnan(share), np.inf, share)))
            self._remember(bound.relation, "", nodes, k, value, lower, upper)

    def _remember(
        self,
        relation: int,
        label: str,
        nodes: Nodes,
        k: int,
        value: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
    ) -> None:
        bound = lower[k] if lower[k] - value[k] > value[k] - upper[k] else upper[k]
        amount = float(max(lower[k] - value[k], value[k] - upper[k]))
        miss = Miss(relation, label, float(nodes.position[k]) / 2, float(value[k]), float(bound), amount)
        known = self.misses.get((relation, label))
        if known is None or miss.share > known.share:
            self.misses[relation, label] = miss


def _largest(values: FloatArray) -> float:
    """The largest of some values that are not negative; infinite where one is not a number."""
    most = float(values.max(initial=0.0))
    return most if most == most else np.inf


def _overstepped(value: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Violations relative to max(1, the bound); nan where undefined."""
    with np.errstate(invalid="ignore"):
        below = np.where(np.isfinite(lower), (lower - value) / np.maximum(1.0, np.abs(lower)), 0.0 * value)
        above = np.where(np.isfinite(upper), (value - upper) / np.maximum(1.0, np.abs(upper)), 0.0 * value)
        return np.maximum(np.maximum(below, above), 0.0)


def _product(multiplier: FloatArray, value: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The product of a multiplier and the distance from its bound; the distance counts 1 at most."""
    with np.errstate(invalid="ignore"):
        room = np.where(multiplier > 0.0, upper - value, value - lower)
        return np.abs(multiplier * np.clip(room, 0.0, 1.0))
