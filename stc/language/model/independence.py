"""Removal of redundant constraints among contacts and poses.

A fixed pose at the start of a contact determines the place of the contact; two contacts of one rigid body constrain
part of its motion twice; and the pose at the end of a phase is partly determined by the contact.  Redundant rows leave
multipliers undetermined, and on a grid they contradict each other by the discretisation error.  They are found from
Jacobians at a pose, and never reach the solver.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.language.model.scope import ModelScope
from stc.problem import ConstantRef, VariableRef
from stc.symbolic.expr import Expr, evaluate_all, symbols

#: What is left of a unit row beside others, below which it counts as one of their combinations.
DEPENDENT = 1e-6
#: Loops of a configuration are closed to so much, in m or rad, in so many steps, none of which is larger than this.
_CLOSED, _ROUNDS, _FAR, _ASIDE = 1e-10, 50, 0.3, 1e-3
#: Half the displacement of a difference quotient of rows, in m or rad, and what is zero in one.
_NEAR, _FLAT = 1e-4, 1e-5

Matrix = NDArray[np.float64]


class Point:
    """A configuration at which rows are evaluated.

    Args:
        values: of all coordinates, by variable.
        constants: of the spec.
    """

    def __init__(
        self, scope: ModelScope, values: Mapping[str, float], constants: Mapping[str, float]
    ) -> None:
        self.scope = scope
        self.known: dict[object, float] = {ConstantRef(name): value for name, value in constants.items()}
        self.known.update({VariableRef(name): value for name, value in values.items()})

    def numbers(self, bodies: Sequence[Expr]) -> Matrix:
        """The values of functions of the configuration at the pose at hand, (k,)."""
        return np.array([float(value) for value in self._evaluated(bodies, {})])

    def jacobian(self, rates: Sequence[Expr]) -> Matrix:
        """The derivative of functions that are linear in the velocities with respect to each: (rows, nv)."""
        unit = np.eye(self.scope.mechanism.n_freedoms)
        velocities: dict[object, Matrix] = {}
        at = 0
        for one in self.scope.coordinates:
            for key in one.rates:
                velocities[key] = unit[at]
                at += 1
        rows = self._evaluated(rates, velocities)
        found = np.array([np.broadcast_to(np.asarray(row, float), (at,)) for row in rows])
        found[~np.isfinite(found)] = 0.0  # of a weld that is half a turn open, which has no axis
        return found.reshape(len(rates), at)

    def closed(self, zeros: Sequence[Expr], rates: Sequence[Expr]) -> Point:
        """A configuration close by in which functions of it are 0; this one if none is found.

        Source: Gauss-Newton steps of least norm.

        Parameters
        ----------
        zeros, rates
            The functions, and their derivatives with respect to time.
        """
        point = self
        for _ in range(_ROUNDS if zeros else 0):
            off = point.numbers(zeros)
            if np.abs(off).max() < _CLOSED:
                return point
            if not np.isfinite(off).all():
                point = point.aside()
                continue
            step = np.linalg.lstsq(point.jacobian(rates), -off, rcond=DEPENDENT)[0]
            point = point.moved(step * min(1.0, _FAR / max(np.abs(step).max(), _CLOSED)))
        return self

    def aside(self) -> Point:
        """A configuration beside this one: a weld that is half a turn open here has an axis to turn about there."""
        return self.moved(np.full(self.scope.mechanism.n_freedoms, _ASIDE))

    def moved(self, step: Matrix) -> Point:
        """The configuration after a displacement along each degree of freedom, (nv,), to first order."""
        values: dict[str, float] = {}
        at = 0
        for one in self.scope.coordinates:
            for name in one.positions:
                values[name] = self.known[VariableRef(name)] + float(step[at])
                at += 1
            if one.rotation is not None:
                w, *v = (self.known[VariableRef(name)] for name in one.rotation.quaternion)
                turn = step[at : at + 3] / 2.0
                q = np.array([w - np.dot(v, turn), *(np.array(v) + w * turn + np.cross(v, turn))])
                values.update(zip(one.rotation.quaternion, (q / np.linalg.norm(q)).tolist(), strict=True))
                at += 3
        moved = Point(self.scope, values, {})
        moved.known = {**self.known, **moved.known}
        return moved

    def _evaluated(self, bodies: Sequence[Expr], velocities: Mapping[object, Matrix]) -> list[Matrix]:
        values: dict[object, object] = {}
        for key in {key for body in bodies for key in symbols(body)}:
            plain = VariableRef(key.name, key.order) if isinstance(key, VariableRef) else key
            values[key] = velocities.get(plain, self.known.get(plain, 0.0))
        return list(evaluate_all(list(bodies), values))


def remain_dependent(point: Point, rates: Sequence[Expr]) -> bool:
    """Whether rows that depend on each other at a pose do so at all poses nearby that satisfy them.

    Legs without a joint across their plane hold two feet apart by themselves where these stand side by side: turned
    about the vertical or tilted, the robot would pull them together, and by no velocity, since their distance is at a
    maximum.  Rows that depend on each other by chance, as where something is aligned, do not where it has moved.

    Source: A combination of rows u with u A = 0 asks velocities v to have no acceleration along it, u A'[v] v = 0. If
    that is semidefinite (second-order rigidity, Connelly & Whiteley 1996) each v along which it vanishes is examined.

    Parameters
    ----------
    point, rates
        The pose, at which the rows hold, and the rows as functions that are linear in the velocities.
    """
    left, sizes, right = np.linalg.svd(point.jacobian(rates))
    rank = int(np.sum(sizes > DEPENDENT))
    zero, free = left[:, rank:], right[rank:].T
    bent = np.einsum("ru,jrn,nk->ujk", zero, _changes(point, rates, free.T), free)
    along = np.eye(free.shape[1])
    while True:
        forms = [along.T @ (one + one.T) @ along for one in bent]
        flat = np.array([form.ravel() for form in forms])
        if not np.any(np.abs(flat) > _FLAT):
            return not np.any(np.abs(along.T @ bent) > _FLAT)
        # Of all combinations of the forms the one nearest to the identity is the most definite.
        shares = np.linalg.lstsq(flat.T, np.eye(along.shape[1]).ravel(), rcond=_FLAT)[0]
        values, vectors = np.linalg.eigh(np.tensordot(shares, forms, 1))
        if values[0] < -_FLAT or values[-1] < _FLAT:
            return False
        along = along @ vectors[:, values < _FLAT]


def are_integrable(point: Point, rates: Sequence[Expr]) -> bool:
    """Whether rows that hold all the time fix places: then a place is that of the start, whatever the way.

    The rows of a point that does not slip do so, and those of a sole that stands on two balls. A ball alone does not:
    it may roll to any place in any orientation.

    Source: Frobenius' theorem. The velocities that satisfy the rows are closed under brackets.

    Parameters
    ----------
    point, rates
        A configuration without accidental alignments, and the rows as functions that are linear in the velocities.
    """
    rows = point.jacobian(rates)
    sizes, right = np.linalg.svd(rows)[1:]
    free = right[int(np.sum(sizes > DEPENDENT)) :]
    bent = _changes(point, rates, free) @ free.T
    bracket = np.zeros((len(free), len(free), rows.shape[1]))
    at = 0
    for one in point.scope.coordinates:
        at += len(one.positions)
        if one.rotation is not None:  # turned about its own axes, first about one and then about another
            turns = free[:, at : at + 3]
            bracket[:, :, at : at + 3] = np.cross(turns[:, None], turns[None])
            at += 3
    around = bent.transpose(0, 2, 1) - bent.transpose(2, 0, 1) - bracket @ rows.T
    return not np.any(np.abs(around) > _FLAT)


def _changes(point: Point, rates: Sequence[Expr], directions: Matrix) -> Matrix:
    """(k, rows, nv) the derivative of the Jacobian of rows along each direction, (k, nv), by central differences."""
    change = [
        (point.moved(_NEAR * v).jacobian(rates) - point.moved(-_NEAR * v).jacobian(rates)) / (2.0 * _NEAR)
        for v in directions
    ]
    return np.array(change).reshape(len(directions), len(rates), directions.shape[1])


def independent(rows: Matrix, given: Matrix, seen: tuple[Matrix, Matrix] | None = None) -> list[int]:
    """Find the rows that are linearly independent of given ones and of one another.

    Parameters
    ----------
    rows, given
        Jacobians at a configuration without accidental alignments, (k, nv) and (m, nv).
    seen
        The same two at a configuration that the motion goes through. Of rows that can stand for each other those are
        kept that add most there: of two points of a sole that lies along x, the second one's x says nothing while the
        sole is level, though it does where it is tilted. If no dependence is found, the first rows are kept.

    Returns
    -------
    list of int
        Numbers of rows, in their order.
    """
    basis = _orthonormal(given)
    there = None if seen is None else _orthonormal(seen[1])
    kept: list[int] = []
    left = list(range(len(rows)))
    while True:
        rests = {k: _rest(rows[k], basis) for k in left}
        left = [k for k in left if _says_something(rests[k], rows[k])]
        if not left:
            return sorted(kept)
        best = left[0]
        if seen is not None and there is not None:
            sizes = [float(np.linalg.norm(_rest(seen[0][k], there))) for k in left]
            # Rounding does not choose between rows that add as much as each other.
            best = next(k for k, size in zip(left, sizes, strict=True) if size >= (1.0 - 1e-6) * max(sizes))
            there = _orthonormal(np.vstack([there, seen[0][best]]))
        kept.append(best)
        left.remove(best)
        rest = rests[best] / np.linalg.norm(rests[best])
        basis = np.vstack([basis, _rest(rest, basis)])


def pins_to_keep(given: Matrix, pinned: Sequence[int]) -> list[int]:
    """The degrees of freedom of a fixed pose that the given rows leave free, the best determined first.

    Args:
        given: rows that hold already, (k, nv).
        pinned: degrees of freedom.
    """
    basis = _orthonormal(given)
    free = np.eye(basis.shape[1])[list(pinned)]
    free = free - free @ basis.T @ basis
    kept: list[int] = []
    while True:
        sizes = np.linalg.norm(free, axis=1)
        if not len(sizes) or sizes.max() < np.sqrt(DEPENDENT):
            return sorted(kept)
        best = int(np.argmax(sizes))
        kept.append(pinned[best])
        direction = free[best] / sizes[best]
        free = free - np.outer(free @ direction, direction)
        free[best] = 0.0


def _orthonormal(rows: Matrix) -> Matrix:
    basis = np.zeros((0, rows.shape[1]))
    for row in rows:
        rest = _rest(row, basis)
        if _says_something(rest, row):
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return basis


def _says_something(rest: Matrix, row: Matrix) -> bool:
    """Whether the remainder of a row after a projection is more than rounding."""
    return float(np.linalg.norm(rest)) > DEPENDENT * max(1.0, float(np.linalg.norm(row)))


def _rest(row: Matrix, basis: Matrix) -> Matrix:
    """The part of a row orthogonal to orthonormal ones; projected twice, because of rounding."""
    for _ in range(2):
        row = row - (row @ basis.T) @ basis
    return row


def stacked(matrices: Iterable[Matrix], width: int) -> Matrix:
    """Matrices stacked vertically; an empty list gives an empty matrix."""
    return np.vstack([np.zeros((0, width)), *matrices])
