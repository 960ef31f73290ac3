"""The quadratic program of one SQP step, solved from a guess of its active set.

    minimise    g.d + 1/2 d.H d
    subject to  row_lower <= r + J d <= row_upper,    x_lower <= x + d <= x_upper

With the right active set one factorisation solves it.  A wrong guess is corrected all at once: what is violated
becomes active, what pulls the wrong way is let go (the primal-dual active set method: M. Hintermueller, K. Ito and
K. Kunisch, SIAM J. Optim. 13, 2002).  That may cycle where constraints are nearly dependent, as along an arc on a
state constraint; then the barrier method, which never guesses, solves the same program.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, errors_of, evaluate, push_inside
from stc.solver.kkt.contract import NotFinite
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.primal_dual import PrimalDual
from stc.solver.products import inner
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["ActiveSet", "QuadraticProgram", "QuadraticSolution", "guess_from_multipliers"]

Signs = NDArray[np.int8]

CHANGES = 12
"""How many active sets are tried before the barrier method takes over, ..."""
FEW, MORE, EARLY, HARDLY_FEWER = 8, 2.0, 4, 0.75
"""... but not those that differ from the last one by more than a few constraints and by twice as many as some did
before, nor more than so many where the differences hardly get fewer."""
NEGLIGIBLE, ROUNDING = 1e-6, 1e-9
"""Multipliers below this, and this share of the terms they balance, do not tell an active constraint."""
DUAL_SHIFT = 1e-9
PRIMAL_SHIFT = 1e-8
REFINEMENTS = 2
BARRIER_STEPS, BARRIER_FACTORISATIONS = 30, 50
"""The barrier method ends after so many: more are spent where no curvature of the program is positive."""
FIRST_BARRIER = 0.1
SMALLEST_BARRIER, LARGEST_BARRIER = 1e-8, 1.0
SHORT, MOST_BLOCKED = 1e-2, 3
"""The barrier method ends when more steps than this were that short."""
ROUGH = 1e-2
"""A solution whose error is this share of the point's is worth a step."""
FARTHER = 10.0


@dataclass(frozen=True, slots=True)
class ActiveSet:
    """Which bounds hold with equality: -1 the lower one, 1 the upper one, 0 none; (n,) and (m,).

    Held variables and equalities count as active always; their sign says nothing.
    """

    x: Signs
    rows: Signs

    def key(self) -> bytes:
        """Equal for equal sets."""
        return self.x.tobytes() + self.rows.tobytes()

    def distance(self, other: ActiveSet) -> int:
        """How many constraints differ."""
        return int(np.count_nonzero(self.x != other.x) + np.count_nonzero(self.rows != other.rows))


@dataclass(frozen=True, slots=True)
class QuadraticSolution:
    """A solution of the program.

    Attributes:
        d: the step, (n,).
        y: multipliers of the rows, (m,).
        z: multipliers of the bounds, (n,).
        active: its active set.
        factorised: the last factorisation belongs to this active set (:meth:`QuadraticProgram.correct` works).
    """

    d: Floats
    y: Floats
    z: Floats
    active: ActiveSet
    factorised: bool


def guess_from_multipliers(form: ScaledProblem, point: PrimalDual) -> ActiveSet:
    """What was active where the point's multipliers belong."""
    terms = np.bincount(form.jac_cols, weights=np.abs(point.jac * point.y[form.jac_rows]), minlength=form.n)
    return ActiveSet(
        _signs(point.z, np.asarray(NEGLIGIBLE + ROUNDING * terms, float), *form.true_x) * ~form.held,
        _signs(point.y, np.full(form.m, NEGLIGIBLE), *form.true_rows) * ~form.equality,
    )


def _signs(multiplier: Floats, least: Floats, lower: Floats, upper: Floats) -> Signs:
    at_upper = (multiplier > least) & np.isfinite(upper)
    at_lower = (multiplier < -least) & np.isfinite(lower)
    return at_upper.astype(np.int8) - at_lower.astype(np.int8)


def _diverges(differences: list[int]) -> bool:
    """Whether active sets that differ by so many constraints, one from the next, lead nowhere."""
    if not differences:
        return False
    last, least = differences[-1], min(differences)
    if last > FEW and last > MORE * least:
        return True
    return len(differences) >= EARLY and least > HARDLY_FEWER * differences[0]


def _largest(v: Floats) -> float:
    return float(np.abs(v).max(initial=0.0))


class QuadraticProgram:
    """The program at one point of a scaled problem.

    Args:
        form: the problem, whose linear algebra is used.
        point: where it is approximated.
        tolerance: smallest violation, and smallest multiplier of the wrong sign, that counts.
        regularity: of the program before, whose rows were probably as dependent.

    Attributes:
        regularity: which of the shifts this program's active sets needed, 0 for none.
    """

    def __init__(self, form: ScaledProblem, point: PrimalDual, tolerance: float, regularity: int = 0) -> None:
        self.form, self.point, self.tolerance = form, point, tolerance
        (x_lower, x_upper), (row_lower, row_upper) = form.true_x, form.true_rows
        self.room_x = (x_lower - point.x, x_upper - point.x)
        self.room_rows = (row_lower - point.r, row_upper - point.r)
        self.regularity = regularity
        self._fixed = np.zeros(form.n, bool)
        self._held_rows = np.zeros(form.m, bool)
        self._jac = point.jac

    def solve(self, guess: ActiveSet, *, thorough: bool = True) -> QuadraticSolution | None:
        """The solution with the help of a guess; None where no method found one.

        Args:
            guess: of the active set.
            thorough: where the guess does not lead to the solution, the barrier method is asked.
        """
        found = self._by_active_sets(guess)
        if found is not None or not thorough:
            return found
        inner, error = self._by_barrier()
        enough = error <= max(ROUGH * self.point.error, self.tolerance)
        # Even a rough solution tells which constraints are active.
        found = self._by_active_sets(inner.active) if error <= self.point.error else None
        if found is not None:
            return found
        return inner if enough else None

    # -- active sets -------------------------------------------------------------------------------------------

    def _by_active_sets(self, guess: ActiveSet) -> QuadraticSolution | None:
        form, point = self.form, self.point
        tried: set[bytes] = set()
        differences: list[int] = []
        active = guess
        while len(tried) < CHANGES and active.key() not in tried and not _diverges(differences):
            tried.add(active.key())
            if not self._factorize(active):
                return None
            fixed_d = self._target(active.x, form.held, self.room_x)
            rhs_x, rhs_y = -point.gradient, self._target(active.rows, form.equality, self.room_rows)
            if fixed_d.any():
                rhs_x = rhs_x - form.hessian_times(point.hess, fixed_d)
                rhs_y -= np.where(self._held_rows, form.jacobian_times(point.jac, fixed_d), 0.0)
            rhs_x[self._fixed] = 0.0
            dx, y = self._solved(rhs_x, rhs_y)
            d = dx + fixed_d
            if not np.isfinite(d.sum() + y.sum()):
                return None
            bent = form.hessian_times(point.hess, d)
            pull = -(point.gradient + bent + form.transpose_times(point.jac, y))
            better = ActiveSet(
                self._corrected(active.x, d, pull, self.room_x, form.held),
                self._corrected(
                    active.rows, form.jacobian_times(point.jac, d), y, self.room_rows, form.equality
                ),
            )
            if better.key() == active.key():
                z = np.where(self._fixed, pull, 0.0)
                return QuadraticSolution(d, y, z, active, True)
            differences.append(active.distance(better))
            active = better
        return None

    def _factorize(self, active: ActiveSet) -> bool:
        """Factorise with the active set's rows and free variables; whether the curvature on it is positive."""
        form, point = self.form, self.point
        self._fixed = form.held | (active.x != 0)
        self._held_rows = form.equality | (active.rows != 0)
        free = ~self._fixed
        hess = point.hess * (free[form.hess_rows] & free[form.hess_cols])
        jac = self._jac = point.jac * (self._held_rows[form.jac_rows] & free[form.jac_cols])
        flat = PRIMAL_SHIFT * max(1.0, _largest(hess))
        shifts = ((0.0, 0.0), (0.0, DUAL_SHIFT), (flat, DUAL_SHIFT))
        while True:
            shift_x, shift_y = shifts[self.regularity]
            primal, dual = np.where(self._fixed, 1.0, shift_x), np.where(self._held_rows, shift_y, 1.0)
            try:
                inertia = form.kkt.factorize(hess, jac, primal, dual)
            except NotFinite:
                return False
            if inertia.zero == 0 and inertia.negative == form.m:
                return True
            if self.regularity == len(shifts) - 1:
                return False
            self.regularity += 1  # the next set of this program starts with what was needed here

    def _solved(self, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        """Step and multipliers; of dependent rows' multipliers the smallest ones.

        Dependent rows are factorised with a small shift, whose effect on the step is then taken out again.
        """
        form = self.form
        dx, y = form.kkt.solve(rhs_x, rhs_y)
        if self.regularity:
            for _ in range(REFINEMENTS):
                missing = np.where(self._held_rows, rhs_y - form.jacobian_times(self._jac, dx), 0.0)
                more_x, more_y = form.kkt.solve(np.zeros(form.n), missing)
                dx, y = dx + more_x, y + more_y
        return dx, y

    @staticmethod
    def _target(active: Signs, equal: NDArray[np.bool_], room: tuple[Floats, Floats]) -> Floats:
        """Where the active ones have to go; 0 for the others."""
        below = (active < 0) | equal
        return np.where(below, room[0], np.where(active > 0, room[1], 0.0))

    def _corrected(
        self,
        active: Signs,
        move: Floats,
        multiplier: Floats,
        room: tuple[Floats, Floats],
        equal: NDArray[np.bool_],
    ) -> Signs:
        """The active set that a solution for ``active`` suggests."""
        slack = self.tolerance
        keep = np.where(active > 0, multiplier >= -slack, np.where(active < 0, multiplier <= slack, False))
        above, below = move > room[1] + slack, move < room[0] - slack
        new = np.where(keep, active, np.where(active != 0, 0, above.astype(np.int8) - below.astype(np.int8)))
        return np.where(equal, 0, new).astype(np.int8)

    def correct(self, new: PrimalDual, active: ActiveSet) -> tuple[Floats, Floats]:
        """One more Newton step at ``new`` with the factorisation for ``active`` at hand: ``(dx, dy)``.

        It makes each factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods
        for the solution of equations, 1964, section 8.4).
        """
        form = self.form
        lower, upper = form.true_rows
        rhs_x = np.where(self._fixed, 0.0, -new.lagrangian)
        rhs_y = self._target(active.rows, form.equality, (lower - new.r, upper - new.r))
        return form.kkt.solve(rhs_x, rhs_y)

    # -- barrier -----------------------------------------------------------------------------------------------

    def _by_barrier(self) -> tuple[QuadraticSolution, float]:
        """Predictor and corrector of S. Mehrotra (SIAM J. Optim. 2, 1992), started next to the multipliers given.

        Returns:
            The best point found and its optimality error, infinite where no curvature was positive.
        """
        form = self.form
        model = _Model(form, self.point)
        system = NewtonSystem(model)
        it = best = self._on_central_path(model)
        smallest = np.inf
        enough = ROUGH * self.point.error
        blocked = 0
        last = form.kkt.factorizations + BARRIER_FACTORISATIONS
        for _ in range(BARRIER_STEPS):
            if form.kkt.factorizations >= last:
                break
            mu = inner(it.gap, it.z) / max(1, model.gaps)
            try:
                system.factorize(it, mu)
            except SingularSystem:
                break
            dw, _, dz = system.step(it, np.zeros(model.gaps), it.c)
            dgap = model.sign * dw[model.index]
            length = _longest(it, dgap, dz, 1.0)
            ahead = inner(it.gap + length * dgap, it.z + length * dz) / max(1, model.gaps)
            centre = ((ahead / max(mu, 1e-300)) ** 3 * mu - dgap * dz) / it.gap
            dw, dy, dz = system.step(it, centre, it.c)
            dgap = model.sign * dw[model.index]
            length = _longest(it, dgap, dz, max(0.99, 1.0 - mu))
            blocked += length < SHORT
            if blocked > MOST_BLOCKED or not np.isfinite(dw.sum() + dy.sum() + dz.sum()):
                break
            it = evaluate(model, it.w + length * dw, it.y + length * dy, it.z + length * dz)
            if not float(it.gap.min(initial=1.0)) > 0.0:  # rounding put it onto a bound
                break
            error = errors_of(model, it, 0.0).total
            if error < smallest and system.shift == 0.0:
                smallest, best = error, it
            if error <= self.tolerance or (error > FARTHER * smallest and smallest <= enough):
                break
        return self._read_off(model, best), smallest

    def _on_central_path(self, model: _Model) -> Iterate:
        """Gaps and multipliers whose products agree, as near to the point's own as that allows.

        With v their difference, gap = (sqrt(v^2 + 4 mu) + v)/2 and z = (sqrt(v^2 + 4 mu) - v)/2.
        """
        point, n = self.point, model.n
        w = np.concatenate([np.zeros(n), np.where(model.equality, model.target, point.r)])
        w[:n] = np.where(model.held, model.held_value, 0.0)
        gap = model.gap(w)
        z = np.maximum(np.concatenate([point.z, point.y])[model.index] * -model.sign, 0.0)
        mu = float(np.clip(FIRST_BARRIER * point.error, SMALLEST_BARRIER, LARGEST_BARRIER))
        difference = gap - z
        root = np.sqrt(difference * difference + 4.0 * mu)
        span = (model.upper - model.lower)[model.index]
        gap = np.minimum(np.maximum(0.5 * (root + difference), 0.5 * mu / root), 0.5 * span)
        order = np.argsort(-gap)  # of two bounds the nearer one decides
        w[model.index[order]] = (model.bound + model.sign * gap)[order]
        w = push_inside(model, w, 1e-8)
        gap = model.gap(w)
        return evaluate(model, w, point.y, np.maximum(mu / gap, 1e-12))

    def _read_off(self, model: _Model, it: Iterate) -> QuadraticSolution:
        near = it.z > it.gap
        signs = np.zeros(model.size, np.int8)
        signs[model.index[near]] = -model.sign[near]
        n = model.n
        z = -model.scatter(it.z)[:n]
        return QuadraticSolution(it.w[:n], it.y, z, ActiveSet(signs[:n], signs[n:]), False)


def _longest(it: Iterate, dgap: Floats, dz: Floats, share: float) -> float:
    """The longest step up to 1 that goes no farther than ``share`` of the way to any bound."""
    fall = max(float((-dgap / it.gap).max(initial=0.0)), float((-dz / it.z).max(initial=0.0)))
    return min(1.0, share / max(fall, 1e-300))


class _Model(Formulation):
    """The quadratic program as a problem of its own, in the step ``d``."""

    def __init__(self, form: ScaledProblem, point: PrimalDual) -> None:
        self.n, self.m, self.kkt = form.n, form.m, form.kkt
        self._point = point
        self._set_pattern(form.jac_rows, form.jac_cols, form.hess_rows, form.hess_cols)
        lower, upper = form.lower, form.upper
        n = form.n
        self._set_bounds(
            np.where(form.held, form.held_value, lower[:n]) - point.x,
            np.where(form.held, form.held_value, upper[:n]) - point.x,
            np.where(form.equality, form.target, lower[n:]),
            np.where(form.equality, form.target, upper[n:]),
        )

    def values(self, x: Floats) -> tuple[float, Floats]:
        point = self._point
        bent = self.hessian_times(point.hess, x)
        return inner(point.gradient, x) + 0.5 * inner(x, bent), point.r + self.jacobian_times(point.jac, x)

    def derivatives(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        point = self._point
        return point.gradient + self.hessian_times(point.hess, x), point.jac, point.hess

    def user_view(self, x: Floats, f: float, r: Floats) -> tuple[Floats, float, float]:
        return x, f, 0.0
