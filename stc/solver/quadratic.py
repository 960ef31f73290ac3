"""The quadratic program of one SQP step, solved from a guess of its active set.

    minimise    g.d + 1/2 d.H d
    subject to  row_lower <= r + J d <= row_upper,    x_lower <= x + d <= x_upper

With the right active set one factorisation solves it.  A wrong guess is corrected in many constraints at once: what is
violated becomes active, what pulls the wrong way is let go (the primal-dual active set method: M. Hintermueller,
K. Ito and K. Kunisch, SIAM J. Optim. 13, 2002).  Where a whole arc of a path oversteps a bound, hardly more than its
top touches the bound in the solution; an arc that is held there pulls to and fro, and takes many sets to come loose.
So only those become active that are met early on the way from the last step to this one, as the ratio test of methods
that add one bound at a time has it (J. Nocedal and S. J. Wright, Numerical Optimization, 2006, section 16.5).  That
need not end; as soon as no fewer constraints are wrong than before, the rest is done one by one, from the set with the
fewest (:mod:`stc.solver.active_set_path`; blocks first, then single ones: J. J. Judice and F. M. Pires, A block
principal pivoting algorithm for large-scale strictly monotone linear complementarity problems, 1994).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.core.structures import structure
from stc.records import dataclass
from stc.solver.active_set_path import ActiveSetPath
from stc.solver.constants import ACCURATE, HALF
from stc.solver.nlp import Floats, Mask
from stc.solver.outcome import ACCEPTABLE
from stc.solver.products import multiplier_scale, term_sums
from stc.solver.projection import CHANGES, REFINEMENTS, factorize_restricted
from stc.solver.scaled_problem import RELAXATION, ScaledProblem

__all__ = ["ActiveSet", "PrimalDual", "QuadraticProgram", "QuadraticSolution", "guess_from_multipliers"]

Signs = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class PrimalDual:
    """A point of a scaled problem.

    Attributes:
        x: variables inside their bounds, (n,).
        y, z: multipliers of rows (m,) and bounds (n,); positive at an upper bound, negative at a lower one.
        f, r: objective and rows (m,).
        gradient, jac, hess: derivatives.
        lagrangian: ``grad f + J^T y``, (n,).
        error: largest of stationarity, violation and complementarity; the dual ones over the size of the
            multipliers.
    """

    x: Floats
    y: Floats
    z: Floats
    f: float
    r: Floats
    gradient: Floats
    jac: Floats
    hess: Floats
    lagrangian: Floats
    error: float


def measure(
    form: ScaledProblem, x: Floats, y: Floats, z: Floats, balancing: Mask | None = None
) -> PrimalDual | None:
    """Evaluate the problem at ``(x, y, z)``; None where a function is undefined.

    Where ``balancing`` (n,) is True, and where a variable is held, z is what makes the Lagrangian stationary.
    """
    x = np.clip(x, *form.true_x)
    f, r = form.values(x)
    if not np.isfinite(f + r.sum()):
        return None
    gradient, jac, hess = form.derivatives(x, y)
    lagrangian, z = np.empty(form.n), z.copy()
    balanced = form.held_factor if balancing is None else np.maximum(form.held_factor, balancing)
    point = structure("primal_dual")(
        nlp=form.program, x=x, y=y, z=z, r=r, gradient=gradient, jac=jac, lagrangian=lagrangian
    )
    function("conditions_balance")(point, balanced)
    dual, total = point.stationarity, point.multipliers
    if not math.isfinite(dual + total) or not np.isfinite(hess.sum()):
        return None
    error = max(point.violation, dual / multiplier_scale(total, form.m + form.n))
    return PrimalDual(x, y, z, f, r, gradient, jac, hess, lagrangian, error)


@dataclass(frozen=True, slots=True)
class ActiveSet:
    """Which bounds hold with equality: -1 the lower one, 1 the upper one, 0 none; (n,) and (m,).

    Held variables and equalities count as active always; their sign says nothing.
    """

    x: Signs
    rows: Signs


@dataclass(frozen=True, slots=True)
class QuadraticSolution:
    """A solution of the program.

    Attributes:
        d: the step, (n,).
        y: multipliers of the rows, (m,).
        z: multipliers of the bounds, (n,).
        active: its active set.
    """

    d: Floats
    y: Floats
    z: Floats
    active: ActiveSet


def guess_from_multipliers(form: ScaledProblem, point: PrimalDual) -> ActiveSet:
    """The active set that the point's multipliers imply: bounds and rows whose multiplier is not negligible."""
    terms = term_sums(form.jac_cols, form.jac_rows, point.jac, point.y, form.n)
    return ActiveSet(
        _signs(point.z, np.asarray(ACCEPTABLE + RELAXATION * terms, float), *form.true_x) * ~form.held,
        _signs(point.y, np.full(form.m, ACCEPTABLE), *form.true_rows) * ~form.equality,
    )


def _signs(multiplier: Floats, least: Floats, lower: Floats, upper: Floats) -> Signs:
    at_upper = (multiplier > least) & np.isfinite(upper)
    at_lower = (multiplier < -least) & np.isfinite(lower)
    return at_upper.astype(np.int32) - at_lower.astype(np.int32)


class QuadraticProgram:
    """The program at one point of a scaled problem.

    Args:
        form: the problem, whose linear algebra is used.
        point: where it is approximated.
        tolerance: smallest violation, and smallest multiplier of the wrong sign, that counts.
        regularity: of the program before, whose rows were probably as dependent.
        check: called between two factorisations; what it raises ends the search.

    Attributes:
        regularity: which of the shifts this program's active sets needed, 0 for none.
    """

    def __init__(
        self,
        form: ScaledProblem,
        point: PrimalDual,
        tolerance: float,
        regularity: int = 0,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self.form, self.point, self.tolerance = form, point, tolerance
        self._check = check
        (x_lower, x_upper), (row_lower, row_upper) = form.true_x, form.true_rows
        self._room = [
            np.concatenate([x - point.x, rows - point.r])
            for x, rows in ((x_lower, row_lower), (x_upper, row_upper))
        ]
        self._equal = np.concatenate([form.held, form.equality])
        finite = np.isfinite(self._room[0]) | np.isfinite(self._room[1])
        self._bounded = np.flatnonzero(finite & ~self._equal)
        self.regularity = regularity
        self._kkt = form.attached_kkt
        self._fixed, self._held_rows = form.held_factor, form.equality_factor
        self._nothing = np.zeros(max(form.n, form.m))
        self._unsolved = 0  # active sets, one after the other, whose system could not be solved accurately

    def solve(self, guess: ActiveSet) -> QuadraticSolution | None:
        """The solution with the help of a guess of the active set; None where that does not lead to it."""
        form = self.form
        n, m = form.n, form.m
        active, way, best, fewest = guess, np.zeros(n + m), guess, n + m + 1
        for _ in range(CHANGES):
            self._check()
            fixed_d = np.empty(n)
            if not self._factorize(active, fixed_d):
                return None
            solved = self._solved(fixed_d)
            if solved is None:
                return None
            d, y, pull, moved = solved
            before, way = np.clip(way, *self._room), np.concatenate([d, moved])
            multipliers = np.concatenate([pull, y])
            signs, beyond, wrong = self._faults(active, way, multipliers)
            faults = int(np.count_nonzero(beyond)) + int(np.count_nonzero(wrong))
            if faults == 0:
                return QuadraticSolution(d, y, self._fixed * pull, active)
            if faults > fewest:
                active = best
                continue
            if faults < fewest:
                best, fewest = active, faults
                share = np.zeros(way.size)  # of the way, which is beyond
                np.divide(beyond, np.abs(way - before), out=share, where=beyond > 0.0)
                met = (beyond > 0.0) & (share >= HALF * share.max())
                signs[wrong] = 0
                signs[met] = np.where(way > self._room[1], 1, -1)[met]
            else:
                at = self._bounded
                low, high = (room[at] for room in self._room)
                first = signs[at].astype(float)
                path = ActiveSetPath(first, way[at], multipliers[at], low, high, self._response)
                if not path.follow():
                    return None
                signs[at], fewest = path.signs, n + m + 1
            active = ActiveSet(signs[:n], signs[n:])
        return None

    def _faults(
        self, active: ActiveSet, way: Floats, pull: Floats
    ) -> tuple[Signs, Floats, NDArray[np.bool_]]:
        """Signs of an active set; how far other constraints are violated; which multipliers pull the wrong way.

        Args:
            active: the set at hand.
            way, pull: where variables and rows get with it, and multipliers of bounds and rows, (n + m,).
        """
        low, high = self._room
        signs = np.concatenate([active.x, active.rows])
        beyond = np.where((signs != 0) | self._equal, 0.0, np.maximum(way - high, low - way))
        return signs, np.where(beyond > self.tolerance, beyond, 0.0), signs * pull < -self.tolerance

    def _response(self, which: int) -> tuple[Floats, Floats]:
        """What a unit of a constraint does to those with bounds: see :mod:`stc.solver.active_set_path`."""
        kkt, n, m = self._kkt, self.form.n, self.form.m
        k = int(self._bounded[which])
        held = bool(self._fixed[k] if k < n else self._held_rows[k - n])
        free = 1.0 - self._fixed
        d, y, pull, moved = np.zeros(n), np.zeros(m), np.empty(n), np.empty(m)
        if (k < n) == held:  # the place of a bound, or the multiplier of a row
            (d if held else y)[k if held else k - n] = 1.0
            function("conditions_respond")(self._restricted, d, y, pull, moved)
            kkt.rhs[:n] = free * (pull + self.point.gradient)
            kkt.rhs[n:] = -self._held_rows * moved
        else:
            kkt.rhs[:] = 0.0
            kkt.rhs[k] = 1.0 if held else -1.0
        kkt.solve_call()
        d += free * kkt.solution[:n]
        y += self._held_rows * kkt.solution[n:]
        function("conditions_respond")(self._restricted, d, y, pull, moved)
        at = self._bounded
        return np.concatenate([d, moved])[at], np.concatenate([pull + self.point.gradient, y])[at]

    def _factorize(self, active: ActiveSet, fixed_d: Floats) -> bool:
        """Factorise with the active set's rows and free variables; whether the curvature on it is positive.

        Args:
            fixed_d: becomes the part of the step that the active bounds determine, (n,).
        """
        form, point, kkt = self.form, self.point, self._kkt
        n, m = form.n, form.m
        self._fixed = np.maximum(form.held_factor, active.x != 0)
        self._held_rows = np.maximum(form.equality_factor, active.rows != 0)
        target = self._target(np.concatenate([active.x, active.rows]), self._equal, self._room)
        self._targets = target[n:]
        nothing = self._nothing
        self._restricted = structure("primal_dual")(
            nlp=form.program, kkt=form.linear_system, x=nothing, y=nothing, r=nothing, gradient=point.gradient,
            jac=point.jac, hess=point.hess, lagrangian=point.gradient, active_x=self._fixed,
            active_rows=self._held_rows, x_target=target[:n], row_target=self._targets, dx=fixed_d, dy=np.empty(m),
        )  # fmt: skip
        function("conditions_restrict")(self._restricted)
        # The next set of this program starts with what was needed here.
        self.regularity, positive = factorize_restricted(
            partial(function("conditions_restricted_diagonals"), self._restricted),
            float(self._restricted.largest_curvature), kkt, self.regularity,
        )  # fmt: skip
        return positive

    def _solved(self, fixed_d: Floats) -> tuple[Floats, Floats, Floats, Floats] | None:
        """Step and multipliers, and what the step does (see ``respond``); None where there are none.

        What has been factorised holds variables and leaves out rows nearly, and may have shifts against dependent ones,
        of whose multipliers that finds the smallest. All that is taken out again by refinement, as long as that halves
        what is left.  Where it leaves much, the set's constraints are nearly dependent.  One such set may be passed on
        the way; after a second one the search wanders, and is given up.
        """
        kkt, n, m = self._kkt, self.form.n, self.form.m
        free = 1.0 - self._fixed
        d, y, pull, moved = fixed_d.copy(), np.zeros(m), np.empty(n), np.empty(m)
        left = np.inf
        kkt.accuracy[0] = ACCURATE * self.tolerance  # the rest is left to the refinement here
        for _ in range(1 + REFINEMENTS):
            kkt.solve_call()
            kkt.check_solution()
            d += free * kkt.solution[:n]
            y += self._held_rows * kkt.solution[n:]
            finite = function("conditions_respond")(self._restricted, d, y, pull, moved)
            if finite != 0.0:
                return None
            kkt.rhs[:n] = free * pull
            kkt.rhs[n:] = self._held_rows * (self._targets - moved)
            before, left = left, float(np.abs(kkt.rhs).max(initial=0.0))
            if left <= ACCURATE * self.tolerance or left > HALF * before:
                break
        self._unsolved = self._unsolved + 1 if left > ACCEPTABLE else 0
        return None if self._unsolved == 2 else (d, y, pull, moved)

    @staticmethod
    def _target(active: Signs, equal: NDArray[np.bool_], room: Sequence[Floats]) -> Floats:
        """Where the active ones have to go; 0 for the others."""
        below = (active < 0) | equal
        return np.where(below, room[0], np.where(active > 0, room[1], 0.0))

    def correct(self, new: PrimalDual, active: ActiveSet) -> tuple[Floats, Floats]:
        """One more Newton step at ``new`` with the factorisation for ``active`` at hand: ``(dx, dy)``.

        It makes each factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods
        for the solution of equations, 1964, section 8.4).
        """
        form = self.form
        lower, upper = form.true_rows
        rhs_x = (self._fixed - 1.0) * new.lagrangian
        rhs_y = self._target(active.rows, form.equality, (lower - new.r, upper - new.r))
        dx, dy = form.kkt.solve(rhs_x, rhs_y)
        return dx * (1.0 - self._fixed), dy * self._held_rows
