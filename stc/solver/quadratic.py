"""The quadratic program of one SQP step, solved from a guess of its active set.

    minimise    g.d + 1/2 d.H d
    subject to  row_lower <= r + J d <= row_upper,    x_lower <= x + d <= x_upper

With the right active set one factorisation solves it.  A wrong guess is corrected all at once: what is violated
becomes active, what pulls the wrong way is let go (the primal-dual active set method: M. Hintermueller, K. Ito and
K. Kunisch, SIAM J. Optim. 13, 2002).  That may cycle where constraints are nearly dependent, as along an arc on a
state constraint; then the barrier method, which never guesses, solves the same program.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solver.conditions import better_signs, respond, restrict
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, evaluate, push_inside
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.places import DUAL_STEP, FINITE, PRIMAL_STEP
from stc.solver.primal_dual import PrimalDual
from stc.solver.products import inner, term_sums
from stc.solver.restricted import RestrictedDiagonals, factorize_restricted
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace

__all__ = ["ActiveSet", "QuadraticProgram", "QuadraticSolution", "guess_from_multipliers"]

Signs = NDArray[np.int32]

CHANGES = 12
"""How many active sets are tried before the barrier method takes over, ..."""
FEW, MORE, EARLY, HARDLY_FEWER = 8, 2.0, 4, 0.75
"""... but not those that differ from the last one by more than a few constraints and by twice as many as some did
before, nor more than so many where the differences hardly get fewer."""
NEGLIGIBLE, ROUNDING = 1e-6, 1e-9
"""Multipliers below this, and this share of the terms they balance, do not tell an active constraint."""
REFINEMENTS, ACCURATE = 4, 0.1
"""Steps are refined so many times at most, until what they leave is less than this share of the tolerance."""
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
    terms = term_sums(form.jac_cols, form.jac_rows, point.jac, point.y, form.n)
    return ActiveSet(
        _signs(point.z, np.asarray(NEGLIGIBLE + ROUNDING * terms, float), *form.true_x) * ~form.held,
        _signs(point.y, np.full(form.m, NEGLIGIBLE), *form.true_rows) * ~form.equality,
    )


def _signs(multiplier: Floats, least: Floats, lower: Floats, upper: Floats) -> Signs:
    at_upper = (multiplier > least) & np.isfinite(upper)
    at_lower = (multiplier < -least) & np.isfinite(lower)
    return at_upper.astype(np.int32) - at_lower.astype(np.int32)


def _diverges(differences: list[int]) -> bool:
    """Whether active sets that differ by so many constraints, one from the next, lead nowhere."""
    if not differences:
        return False
    last, least = differences[-1], min(differences)
    if last > FEW and last > MORE * least:
        return True
    return len(differences) >= EARLY and least > HARDLY_FEWER * differences[0]


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
        self.room_x = (x_lower - point.x, x_upper - point.x)
        self.room_rows = (row_lower - point.r, row_upper - point.r)
        self.regularity = regularity
        self._kkt = form.attached_kkt
        self._fixed, self._held_rows = form.held_factor, form.equality_factor
        self._nothing = np.zeros(max(form.n, form.m))

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
        form = self.form
        n, m = form.n, form.m
        tried: set[bytes] = set()
        differences: list[int] = []
        active = guess
        while len(tried) < CHANGES and active.key() not in tried and not _diverges(differences):
            self._check()
            tried.add(active.key())
            fixed_d = np.empty(n)
            if not self._factorize(active, fixed_d):
                return None
            solved = self._solved(fixed_d)
            if solved is None:
                return None
            d, y, pull, moved = solved
            better = ActiveSet(np.empty(n, np.int32), np.empty(m, np.int32))
            slack = self.tolerance
            different = better_signs(n, slack, active.x, form.held_factor, d, pull, *self.room_x, better.x)
            different += better_signs(
                m, slack, active.rows, form.equality_factor, moved, y, *self.room_rows, better.rows
            )
            if not different:
                return QuadraticSolution(d, y, self._fixed * pull, active, True)
            differences.append(different)
            active = better
        return None

    def _factorize(self, active: ActiveSet, fixed_d: Floats) -> bool:
        """Factorise with the active set's rows and free variables; whether the curvature on it is positive.

        Args:
            fixed_d: becomes the part of the step that the active bounds determine, (n,).
        """
        form, point, kkt = self.form, self.point, self._kkt
        n, m = form.n, form.m
        self._fixed = np.maximum(form.held_factor, active.x != 0)
        self._held_rows = np.maximum(form.equality_factor, active.rows != 0)
        target_x = self._target(active.x, form.held, self.room_x)
        self._targets = target_rows = self._target(active.rows, form.equality, self.room_rows)
        nothing = self._nothing
        largest = np.zeros(1)
        restrict(
            n, m, form.jac_rows.size, form.hess_rows.size, form.jac_rows, form.jac_cols, form.hess_rows, form.hess_cols,
            point.jac, point.hess, self._fixed, self._held_rows, nothing, nothing, nothing,
            point.gradient, target_x, target_rows, fixed_d, np.empty(m), kkt.hess, kkt.jac, kkt.rhs, largest,
        )  # fmt: skip
        # The next set of this program starts with what was needed here.
        diagonals = RestrictedDiagonals(form, self._fixed, self._held_rows)
        self.regularity, positive = factorize_restricted(diagonals, float(largest[0]), self.regularity)
        return positive

    def _solved(self, fixed_d: Floats) -> tuple[Floats, Floats, Floats, Floats] | None:
        """Step and multipliers, and what the step does (see ``respond``); None where they are not finite.

        What has been factorised holds variables and leaves out rows nearly, and may have shifts against dependent ones,
        of whose multipliers that finds the smallest. All that is taken out again by refinement.
        """
        form, point, kkt = self.form, self.point, self._kkt
        n, m = form.n, form.m
        free = 1.0 - self._fixed
        d, y, pull, moved = fixed_d.copy(), np.zeros(m), np.empty(n), np.empty(m)
        for _ in range(1 + REFINEMENTS):
            kkt.solve_call()
            kkt.check_solution()
            d += free * kkt.solution[:n]
            y += self._held_rows * kkt.solution[n:]
            finite = respond(
                n, m, form.jac_rows.size, form.hess_rows.size, form.jac_rows, form.jac_cols, form.hess_rows,
                form.hess_cols, point.jac, point.hess, point.gradient, d, y, pull, moved,
            )  # fmt: skip
            if finite != 0.0:
                return None
            kkt.rhs[:n] = free * pull
            kkt.rhs[n:] = self._held_rows * (self._targets - moved)
            if float(np.abs(kkt.rhs).max(initial=0.0)) <= ACCURATE * self.tolerance:
                break
        return d, y, pull, moved

    @staticmethod
    def _target(active: Signs, equal: NDArray[np.bool_], room: tuple[Floats, Floats]) -> Floats:
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

    # -- barrier -----------------------------------------------------------------------------------------------

    def _by_barrier(self) -> tuple[QuadraticSolution, float]:
        """Predictor and corrector of S. Mehrotra (SIAM J. Optim. 2, 1992), started next to the multipliers given.

        Returns:
            The best point found and its optimality error, infinite where no curvature was positive.
        """
        form = self.form
        model = _Model(form, self.point)
        work = Workspace(model)
        system = NewtonSystem(work)
        it, step, s = work.it, work.step, work.s
        work.load(self._on_central_path(model))
        best = self._read_off(model, it)
        smallest = np.inf
        enough = ROUGH * self.point.error
        blocked = 0
        last = form.kkt.factorizations + BARRIER_FACTORISATIONS
        for _ in range(BARRIER_STEPS):
            self._check()
            if form.kkt.factorizations >= last:
                break
            mu = inner(it.gap, it.z) / max(1, model.gaps)
            try:
                system.factorize(mu)
            except SingularSystem:
                break
            work.centre[:] = 0.0
            system.find_step(step)
            work.limit_step(1.0)
            length = min(s[PRIMAL_STEP], s[DUAL_STEP])
            dgap = model.sign * step.dw[model.index]
            ahead = inner(it.gap + length * dgap, it.z + length * step.dz) / max(1, model.gaps)
            work.centre[:] = ((ahead / max(mu, 1e-300)) ** 3 * mu - dgap * step.dz) / it.gap
            system.find_step(step)
            work.limit_step(max(0.99, 1.0 - mu))
            length = min(s[PRIMAL_STEP], s[DUAL_STEP])
            blocked += length < SHORT
            if blocked > MOST_BLOCKED or s[FINITE] != 0.0:
                break
            moved = (it.w + length * step.dw, it.y + length * step.dy, it.z + length * step.dz)
            work.load(evaluate(model, *moved))
            if not float(it.gap.min(initial=1.0)) > 0.0:  # rounding put it onto a bound
                break
            error = work.errors().total
            if error < smallest and system.shift == 0.0:
                smallest, best = error, self._read_off(model, it)
            if error <= self.tolerance or (error > FARTHER * smallest and smallest <= enough):
                break
        return best, smallest

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
        signs = np.zeros(model.size, np.int32)
        signs[model.index[near]] = -model.sign[near]
        n = model.n
        z = -model.scatter(it.z)[:n]
        return QuadraticSolution(it.w[:n].copy(), it.y.copy(), z, ActiveSet(signs[:n], signs[n:]), False)


class _Model(Formulation):
    """The quadratic program as a problem of its own, in the step ``d``."""

    linear = quadratic_objective = True

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

    def user_variables(self, x: Floats) -> Floats:
        return x.copy()

    def user_measures(self, x: Floats, f: float, r: Floats) -> tuple[float, float]:
        return f, 0.0
