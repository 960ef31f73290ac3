"""The vectors of one iteration at fixed places, and the passes over them as prepared calls.

An iteration on a short horizon takes less time than a hundred NumPy calls. So all its vectors are allocated once,
its arithmetic is done by a handful of compiled passes (:mod:`stc.solver.kernels`, :mod:`stc.solver.step_kernels`), and
what follows one another without a decision in between is one call.
"""

from __future__ import annotations

import weakref
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from stc.core.calls import Bound, CallTable, chain
from stc.solver import kernels, state, step_kernels
from stc.solver.barrier_update import SMALLEST_TAU
from stc.solver.filter import Filter
from stc.solver.formulation import Formulation
from stc.solver.iterate import Errors, Iterate
from stc.solver.nlp import Floats
from stc.solver.products import EPSILON
from stc.solver.state import (
    DUAL_ERROR,
    GAP_ERROR,
    LOGARITHMS,
    MOVED,
    OBJECTIVE,
    PRIMAL,
    STATED,
    THETA,
    TRIAL_GAP,
    TRIAL_LOGARITHMS,
    TRIAL_THETA,
    VIOLATION,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from stc.solver.evaluator import Evaluator
    from stc.solver.iteration_calls import Stages

__all__ = ["Step", "Workspace", "workspace_of"]

#: The centring parameters to choose from; the
#: fraction of a step below which bounds are in its way, where there are many.
CENTRING = np.array([1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.06, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 5.0, 20.0, 100.0])
SHORT = 0.2
#: Iterations at most that are made in a row.
LONGEST_RUN = 16
#: Places of the calls that hold a solve, and what they are called here.
SOLVING = {
    state.PREDICT: "predictor",
    state.NEWTON: "newton",
    state.CORRECTION: "correction",
}


class Step:
    """A step ``dw`` (n + m,), ``dy`` (m,), ``dz`` (gaps,) at fixed places."""

    __slots__ = ("dw", "dy", "dz")

    def __init__(self, form: Formulation) -> None:
        self.dw, self.dy, self.dz = np.zeros(form.size), np.zeros(form.m), np.zeros(form.gaps)

    def become(self, other: Step) -> None:
        """Copy another step."""
        self.dw[:], self.dy[:], self.dz[:] = other.dw, other.dy, other.dz


def workspace_of(form: Formulation) -> Workspace:
    """The workspace that a form keeps: for one iteration at a time."""
    if form.workspace is None:
        form.workspace = Workspace(form)
    return form.workspace


def _state(of: weakref.ref[Workspace]) -> None:
    """Note the objective and the violation in the user's terms, of a form that tells them in Python."""
    work = of()
    assert work is not None
    form, it, s = work.form, work.it, work.s
    s[STATED], s[VIOLATION] = form.user_measures(it.w[: form.n], s[OBJECTIVE], it.r)


class Workspace:
    """One iterate, the point tried next, the steps between them, and what is done with them.

    Attributes:
        it: the iterate; its arrays stay the same objects.
        numbers: what the passes leave (see :mod:`stc.solver.state`).
        s: the same; reading one gives a float.
        calls: the prepared calls that compiled functions make.
        filter: of the search along a step.
        accepted: of iterates while the barrier parameter is chosen anew at each.
        stages: see :func:`stc.solver.iteration_calls.stages_of`.
        kept: w, y and z of the iterate with the smallest error.
        best: variables and row multipliers of the best iterate in the user's terms.
        rows: records of the last iterates, see :mod:`stc.solver.state`.
        step: the step in use.
        mu, tau, alpha, shifted: arguments of passes, (1,) each.
        centre: target of the gaps' multipliers, (gaps,).
        residual: gradient of the whole Lagrangian, (n + m,), since the last measurement.
        primal, d, sigma, ratio: diagonals without shifts, and what they are made of.
        shifts: of the Hessian's diagonal in the last factorisation, (n,).
        trial_w, trial_c, trial_gap: the point tried.
        start_w: the point to start from, which ``push_inside_call`` moves inside its bounds by its ``push``.
        kkt: the linear algebra, with arrays of its own.
    """

    def __init__(self, form: Formulation) -> None:
        self._form = weakref.ref(form)  # which may keep the workspace
        n, m, gaps, size = form.n, form.m, form.gaps, form.size
        self.kkt = form.attached_kkt
        self.evaluator: Evaluator = form.evaluator()
        ev = self.evaluator
        zeros = np.zeros
        self.it = Iterate(
            zeros(size), zeros(m), zeros(gaps), 0.0, zeros(m), zeros(gaps), zeros(m), 0.0,
            ev.gradient, ev.jac, ev.hess, zeros(size),
        )  # fmt: skip
        self.numbers = zeros(state.NUMBERS)
        self.s: memoryview[float] = memoryview(self.numbers.data)
        self.calls = CallTable(state.CALLS)
        self.filter, self.accepted = Filter(np.inf), Filter(np.inf)
        self.kept = zeros(size), zeros(m), zeros(gaps)
        self.best = zeros(n), zeros(m)
        self.rows = zeros(LONGEST_RUN * state.ROW)
        self.inertia = self.kkt.inertia
        self.mu, self.tau, self.alpha, self.shifted = (zeros(1) for _ in range(4))
        self.centre, self._no_centre, self.residual = zeros(gaps), zeros(gaps), zeros(size)
        self.primal, self.d, self.sigma, self.ratio = zeros(n), zeros(m), zeros(size), zeros(gaps)
        self.shifts = zeros(n)
        self.step, self.affine, self.centring, self.correction = (Step(form) for _ in range(4))
        self.correction_c = zeros(m)
        self.start_w, self.trial_w, self.trial_gap, self.trial_c = (
            zeros(size),
            zeros(size),
            zeros(gaps),
            zeros(m),
        )
        self._trial_y, self._trial_z, self._trial_dual = zeros(m), zeros(gaps), zeros(size)
        self._pull, self._turn = zeros(size), zeros(size)
        self._nowhere = np.zeros(1)
        self._no_residual, self.factor, self.target = np.zeros(m), np.zeros(1), np.zeros(1)
        self._solve: Bound | None = None
        self.stages: Stages | None = None
        self._parts: dict[str, Bound] = {}
        self._chains: dict[str, Bound] = {}
        self._bind()

    def _bind(self) -> None:
        form, it, ev, kkt = self.form, self.it, self.evaluator, self.kkt
        n, m, gaps, size = form.n, form.m, form.gaps, form.size
        entries, curved = form.jac_rows.size, form.hess_rows.size
        index, sign, free, kind, moving = (
            form.index,
            form.sign,
            form.free_factor,
            form.kind,
            form.moving_factor,
        )
        columns, s = form.jac_columns, self.numbers
        extra = np.zeros(n) if form.extra_diagonal is None else form.extra_diagonal
        step = self.step
        affine, centring = self.affine, self.centring
        self.push_inside_call = kernels.push_inside.bind(size, 0.0, form.lower, form.upper, self.start_w)
        self._log_sum_call = kernels.log_sum.bind(gaps, it.gap)
        self._mean_centre_call = step_kernels.mean_centre.bind(gaps, it.gap, self.centre, s)
        scratch = (
            np.zeros(gaps),
            np.zeros(gaps),
            np.zeros(4 * step_kernels.BLOCK),
            np.zeros(4 * CENTRING.size),
        )
        self._choose_call = step_kernels.choose_centring.bind(
            gaps,
            CENTRING.size,
            max(1, int(form.moving.sum())),
            max(1, m),
            SMALLEST_TAU,
            SHORT if form.many_gaps else 0.0,
            index,
            sign,
            CENTRING,
            it.gap,
            it.z,
            affine.dw,
            affine.dz,
            centring.dw,
            centring.dz,
            *scratch,
            s,
        )
        measure: Bound = kernels.measure.bind(
            size, m, gaps, form.objective_unit, index, sign, self.target, it.w, it.y, it.z, it.gap, it.c, it.dual,
            self.residual, s,
        )  # fmt: skip
        watch = form.watch_call(it, self.numbers) or Bound.of_python(_state, (weakref.ref(self),))
        self.measure_call = chain([measure, watch])
        self.diagonals_call = chain(
            [
                step_kernels.diagonals.bind(
                    n, m, gaps, index, free, kind, extra, EPSILON, it.z, it.gap, self.ratio, self.sigma,
                    self.primal, self.d,
                ),
                kernels.copy.bind(curved, ev.hess, kkt.hess),
                kernels.copy.bind(entries, ev.jac, kkt.jac),
            ]
        )  # fmt: skip
        self.shifted_call = step_kernels.shifted.bind(
            n, m, free, kind, it.w, self.primal, self.d, form.convex[0].size, *form.convex, it.hess, self.shifts,
            kkt.primal, kkt.dual, s,
        )  # fmt: skip
        self.centre_call = step_kernels.mu_centre.bind(gaps, self.mu, it.gap, self.centre)
        self.lengths_call = step_kernels.lengths.bind(
            n, m, gaps, index, sign, self.tau, it.w, it.z, it.gap, it.gradient, step.dw, step.dy, step.dz, s
        )
        self.combine_call = chain(
            [
                step_kernels.combine.bind(size, self.factor, affine.dw, centring.dw, step.dw),
                step_kernels.combine.bind(m, self.factor, affine.dy, centring.dy, step.dy),
                step_kernels.combine.bind(gaps, self.factor, affine.dz, centring.dz, step.dz),
                self.lengths_call,
            ]
        )
        self.inspect_call = kernels.inspect.bind(
            n, m, gaps, index, sign, form.bound, kind, self.trial_w, ev.r, self.trial_gap, self.trial_c, s
        )
        self._evaluate_call = chain(
            [
                kernels.place.bind(n, size, self._nowhere, it.w, it.w.copy(), self.trial_w, ev.x),
                kernels.copy.bind(m, it.y, ev.y),
                ev.values_call,
                kernels.copy.bind(m, ev.r, it.r),
                kernels.inspect.bind(n, m, gaps, index, sign, form.bound, kind, it.w, ev.r, it.gap, it.c, s),
                ev.derivatives_call,
                kernels.adopt.bind(
                    n,
                    m,
                    moving,
                    *columns,
                    it.y,
                    it.gradient,
                    it.jac,
                    ev.derivatives_status,
                    it.dual,
                    ev.f,
                    s,
                ),
            ]
        )
        self.trial_call = chain(
            [
                kernels.place.bind(n, size, self.alpha, it.w, step.dw, self.trial_w, ev.x),
                ev.values_call,
                self.inspect_call,
            ]
        )
        self.move_call = chain(
            [
                kernels.blend.bind(
                    n, m, gaps, index, sign, self.shifts, moving, *columns, it.jac, self.alpha, self.shifted,
                    self.mu, self.residual, step.dw, step.dy, step.dz, it.y, it.z, self.trial_gap, self._pull,
                    self._turn, self._trial_y, self._trial_z, ev.y, s,
                ),
                ev.derivatives_call,
                kernels.move.bind(
                    n, m, gaps, moving, *columns, it.gradient, it.jac, ev.derivatives_status, self.trial_w,
                    self._trial_y, self._trial_z, ev.f, ev.r, self.trial_gap, self.trial_c, self._trial_dual, it.w,
                    it.y, it.z, it.r, it.gap, it.c, it.dual, s,
                ),
            ]
        )  # fmt: skip

        self.least_squares_call: Bound = step_kernels.least_squares.bind(
            n, m, gaps, entries, curved, index, sign, free, kind, it.z, it.gradient, it.jac, self._pull, kkt.hess,
            kkt.jac, kkt.primal, kkt.dual, kkt.rhs,
        )  # fmt: skip
        self.return_call = chain(
            [kernels.copy.bind(n, it.w, ev.x), kernels.copy.bind(m, it.y, ev.y), ev.derivatives_call]
        )

    @property
    def form(self) -> Formulation:
        """The form of the problem that the workspace belongs to."""
        form = self._form()
        assert form is not None
        return form

    @cached_property
    def bend(self) -> Floats:
        """The objective's part of the Hessian where ``bend_call`` was last made, (nnz_H,)."""
        return np.zeros(self.form.hess_rows.size)

    @cached_property
    def bend_call(self) -> Bound:
        """Evaluates the objective's part of the Hessian at the iterate, all else staying as it is."""
        ev, it, form = self.evaluator, self.it, self.form
        curved = form.hess_rows.size
        kept = np.zeros(curved)
        return chain(
            [
                kernels.copy.bind(curved, ev.hess, kept),
                kernels.copy.bind(form.n, it.w, ev.x),
                kernels.copy.bind(form.m, np.zeros(form.m), ev.y),
                ev.derivatives_call,
                kernels.copy.bind(curved, ev.hess, self.bend),
                kernels.copy.bind(curved, kept, ev.hess),
                kernels.copy.bind(form.m, it.y, ev.y),
            ]
        )

    @cached_property
    def damped_call(self) -> Bound:
        """Takes only a share of the rows' part of the Hessian into the matrix; after ``diagonals_call``."""
        return step_kernels.damped.bind(self.bend.size, self.bend, self.it.hess, self.kkt.hess)

    @cached_property
    def spare(self) -> Step:
        """A step that may be needed again."""
        return Step(self.form)

    # -- the iterate -----------------------------------------------------------------------------------------------

    def evaluate(self, w: Floats, y: Floats, z: Floats) -> Iterate:
        """Make ``(w, y, z)`` the iterate; functions may be undefined there."""
        it, s = self.it, self.s
        it.w[:], it.y[:], it.z[:] = w, y, z
        self._evaluate_call()
        it.f, it.theta = s[OBJECTIVE], s[THETA]
        return it

    def load(self, it: Iterate) -> None:
        """Take over an iterate."""
        own = self.it
        if it is not own:
            own.become(it)
        s = self.s
        s[OBJECTIVE], s[THETA] = own.f, own.theta
        s[LOGARITHMS] = self._log_sum_call()

    def errors(self, mu: float = 0.0) -> Errors:
        """Errors of the optimality conditions with barrier parameter ``mu``."""
        self.target[0] = mu
        self.measure_call()
        self.target[0] = 0.0
        s = self.s
        return Errors(s[DUAL_ERROR], s[PRIMAL], s[GAP_ERROR])

    # -- steps -----------------------------------------------------------------------------------------------------

    def solve_call(self, name: str, step: Step, c: Floats, *, residuals: bool) -> Bound:
        """The call that solves for ``centre`` and ``c`` (m,), with what the iterate lacks or without.

        It holds until the next factorisation.
        """
        self._renew()
        known = self._chains.get(name)
        if known is None:
            known = self._chains[name] = chain(
                [
                    self._begin(name, c, residuals, self.centre, self.kkt.rhs), self.kkt.solve_call,
                    self._end(name, step, c, residuals, self.centre, self.kkt.solution),
                ]
            )  # fmt: skip
        return known

    def _renew(self) -> None:
        """Give up the chains that hold another solve than that of the last factorisation."""
        solve = self.kkt.solve_call
        if solve is not self._solve:
            self._solve = solve
            self._chains = {}
            for place in SOLVING:
                self.calls.put(place, None)

    def _begin(self, name: str, c: Floats, residuals: bool, centre: Floats, rhs: Floats) -> Bound:
        form = self.form
        return self._once(
            name + " begins",
            lambda: step_kernels.right_hand_side.bind(
                form.n, form.m, form.gaps, residuals, form.index, form.sign, form.kind, centre, self.it.dual, c, self.d,
                self._pull, rhs,
            ),
        )  # fmt: skip

    def _end(
        self, name: str, step: Step, c: Floats, residuals: bool, centre: Floats, solution: Floats
    ) -> Bound:
        form, it = self.form, self.it
        slacked = form.jac_of_inequalities
        return self._once(
            name + " ends",
            lambda: step_kernels.recover.bind(
                form.n, form.m, form.gaps, residuals, slacked.size, slacked, form.index, form.sign, form.free_factor,
                form.kind, form.jac_rows, form.jac_cols, it.jac, c, it.z, self.ratio, centre, solution, step.dw,
                step.dy, step.dz,
            ),
        )  # fmt: skip

    def _once(self, name: str, make: Callable[[], Bound]) -> Bound:
        if name not in self._parts:
            self._parts[name] = make()
        return self._parts[name]

    def solve(self, name: str, step: Step, c: Floats, *, residuals: bool = True) -> None:
        """Fill ``step`` with the solution for ``centre`` and ``c`` (m,)."""
        self.solve_call(name, step, c, residuals=residuals)()
        if self.kkt.check_solution():
            self._end(name, step, c, residuals, self.centre, self.kkt.solution)()

    def predict(self) -> None:
        """Find the affine and the centring step, and the centring parameter that suits them."""
        self._predictor()()
        while self.kkt.check_solution():  # factorised anew
            self._predictor()()

    def _predictor(self) -> Bound:
        """The call for that, which solves for both steps at once and leaves the mean centre."""
        self._renew()
        known = self._chains.get("predictor")
        if known is None:
            kkt, c, none = self.kkt, self.it.c, self._no_residual
            known = self._chains["predictor"] = chain(
                [
                    self._mean_centre_call,
                    self._begin("affine", c, True, self._no_centre, kkt.rhs),
                    self._begin("mean", none, False, self.centre, kkt.second_rhs),
                    kkt.solve_both_call,
                    self._end("affine", self.affine, c, True, self._no_centre, kkt.solution),
                    self._end("mean", self.centring, none, False, self.centre, kkt.second_solution),
                    self._choose_call,
                ]
            )
        return known

    def limit_step(self, tau: float) -> None:
        """See how far the step may go towards the bounds: ``tau`` of the way."""
        self.tau[0] = tau
        self.lengths_call()

    # -- calls that compiled functions make -------------------------------------------------------------------------

    def provide_attempt(self) -> None:
        """Renew the calls that hold for matrices like the last one that was factorised, if any was."""
        attempt = self.kkt.attempt_call
        self.calls.put(state.ATTEMPT, attempt)
        if attempt is not None:
            self.provide_prediction()

    def provide_prediction(self) -> None:
        """Renew the call that solves for the affine and the centring step with the last factorisation."""
        self.calls.put(state.PREDICT, self._predictor())

    def provide_solves(self) -> None:
        """Make all the calls that solve."""
        self._predictor()
        self.solve_call("newton", self.step, self.it.c, residuals=True)
        self.solve_call("centring", self.centring, self._no_residual, residuals=False)
        self.solve_call("correction", self.correction, self.correction_c, residuals=True)
        for place, name in SOLVING.items():
            self.calls.put(place, self._chains[name])

    def provide_bend(self) -> None:
        """Make those that know the objective's part of the Hessian."""
        self.calls.put(state.BEND, self.bend_call)
        self.calls.put(state.DAMPED, self.damped_call)

    # -- the trial point -------------------------------------------------------------------------------------------

    def try_step(self, alpha: float) -> bool:
        """Evaluate the functions at a fraction of the step; False where one is undefined or a gap is closed."""
        self.alpha[0] = alpha
        self.trial_call()
        return self._is_inside()

    def _is_inside(self) -> bool:
        s = self.s
        total = float(self.evaluator.f[0]) + s[TRIAL_THETA]
        return total - total == 0.0 and s[TRIAL_GAP] > 0.0

    def trial_phi(self, mu: float) -> float:
        """The barrier function at the point tried."""
        f = float(self.evaluator.f[0])
        return f - mu * self.s[TRIAL_LOGARITHMS] if self.form.gaps else f

    def move(self, alpha: float, mu: float, shifted: bool) -> bool:
        """Make the point tried the iterate, multipliers moved along; False where a derivative is undefined.

        ``shifted``: whether the step has come from the Hessian with ``shifts``.
        """
        self.alpha[0], self.mu[0], self.shifted[0] = alpha, mu, shifted
        self.move_call()
        if self.s[MOVED]:
            self.note_moved()
            return True
        self.return_call()
        return False

    def note_moved(self) -> None:
        """Take up numbers of the iterate that compiled functions have moved."""
        self.it.f, self.it.theta = self.s[OBJECTIVE], self.s[THETA]
