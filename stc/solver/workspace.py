"""The vectors of one iteration at fixed addresses, for the functions of the core that do its arithmetic.

An iteration on a short horizon takes less time than a hundred NumPy calls. So all its vectors are allocated once; the
structure that holds them, and every number and function of the iteration, are described in
``stc/core/iteration/iteration.h``.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.core.calls import CallTable
from stc.core.functions import BoundFunction, function
from stc.core.structures import structure
from stc.solver.constants import ATTEMPT, CALLS, DERIVATIVES, RECORD, SOLVE, SOLVE_BOTH, VALUES, WATCH
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats

if TYPE_CHECKING:
    from stc.solver.evaluator import Evaluator

__all__ = ["Filter", "Step", "Workspace", "workspace_of"]

#: Iterations at most that are made in a row.
LONGEST_RUN = 16
#: Pairs that a filter has room for; the oldest gives way to one more.
ROOM = 1000


class Filter:
    """The filter: pairs of violation and barrier function that later points must not be dominated by.

    R. Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002). Functions of
    the core use it as well.
    """

    def __init__(self, largest_theta: float) -> None:
        self.structure = structure("filter")(largest=largest_theta, pairs=np.empty(2 * ROOM))

    def restart(self, largest_theta: float) -> None:
        """Empty it, with another limit."""
        self.structure.count, self.structure.largest = 0, largest_theta

    def add(self, theta: float, phi: float) -> None:
        """Forbid points no better than (theta, phi) by a margin."""
        function("line_search_add")(self.structure, theta, phi)

    def accepts(self, theta: float, phi: float) -> bool:
        """Whether no pair that was added forbids a point with the violation ``theta`` and the objective ``phi``."""
        return function("line_search_accepts")(self.structure, theta, phi) != 0


class Step:
    """A step ``dw`` (n + m,), ``dy`` (m,), ``dz`` (gaps,) at fixed addresses."""

    def __init__(self, form: Formulation) -> None:
        self.dw, self.dy, self.dz = np.zeros(form.size), np.zeros(form.m), np.zeros(form.gaps)
        self.structure = structure("step")(dw=self.dw, dy=self.dy, dz=self.dz)

    def become(self, other: Step) -> None:
        """Copy another step."""
        self.dw[:], self.dy[:], self.dz[:] = other.dw, other.dy, other.dz


class _Current(Iterate):
    """An iterate that functions of the core look at and change."""

    def __init__(self, form: Formulation, ev: Evaluator) -> None:
        size, m, gaps = form.size, form.m, form.gaps
        w, y, z = np.zeros(size), np.zeros(m), np.zeros(gaps)
        r, gap, c, dual = np.zeros(m), np.zeros(gaps), np.zeros(m), np.zeros(size)
        self.structure = structure("iterate")(w=w, y=y, z=z, r=r, gap=gap, c=c, dual=dual)
        super().__init__(w, y, z, 0.0, r, gap, c, 0.0, ev.gradient, ev.jac, ev.hess, dual)

    @property
    def f(self) -> float:
        """Objective."""
        return float(self.structure.f)

    @f.setter
    def f(self, value: float) -> None:
        self.structure.f = value

    @property
    def theta(self) -> float:
        """1-norm of ``c``."""
        return float(self.structure.theta)

    @theta.setter
    def theta(self, value: float) -> None:
        self.structure.theta = value


def workspace_of(form: Formulation) -> Workspace:
    """The workspace that a form keeps: for one iteration at a time."""
    return form.keep(Workspace)


class Workspace:
    """One iterate, the point tried next, the steps between them, and what is done with them.

    Attributes:
        s: all numbers and arrays of the iteration (``iteration`` in ``iteration.h``).
        it: the iterate; its arrays stay the same objects. ``trial`` is the point tried, ``incumbent`` has w, y and z of
            the iterate with the smallest error.
        calls: the prepared calls that functions of the core make.
        filter: of the search along a step.
        accepted: of iterates while the barrier parameter is chosen anew at each.
        best: variables and row multipliers of the best iterate in the user's terms.
        records: of the last iterates, (LONGEST_RUN, RECORD).
        step: the step in use; ``affine``, ``centring`` and ``correction`` are what it is made of, or tried instead;
            ``spare`` is for one that may be needed again.
        residual: gradient of the whole Lagrangian, (n + m,), since the last measurement.
        sigma, dual_diagonal: z / gap for each entry of w, (n + m,), and the rows' diagonal without shifts, (m,).
        shifts: of the Hessian's diagonal in the last factorisation, (n,).
        start_w: the point to start from, which ``push_inside`` moves inside its bounds by its ``push``.
        kkt: the linear algebra, with arrays of its own.
        begin, factorize, find_step, search, settle, advance, iterate, repeat: the stages of an iteration; see
            ``iteration.h``.
    """

    def __init__(self, form: Formulation) -> None:
        self._form = weakref.ref(form)  # which may keep the workspace
        n, m, gaps, size = form.n, form.m, form.gaps, form.size
        zeros = np.zeros
        self.kkt = form.attached_kkt
        self.evaluator = ev = form.evaluator()
        self.it, self.trial, self.incumbent = (_Current(form, ev) for _ in range(3))
        self.step, self.affine, self.centring, self.correction, self.spare = (Step(form) for _ in range(5))
        self.filter, self.accepted = Filter(np.inf), Filter(np.inf)
        self.best, self.records = (zeros(n), zeros(m)), zeros((LONGEST_RUN, RECORD))
        self.residual, self.sigma, self.start_w = zeros(size), zeros(size), zeros(size)
        self.dual_diagonal, self.shifts, self.centre = zeros(m), zeros(n), zeros(gaps)
        self.calls = CallTable(CALLS)
        self._prepared: dict[str, BoundFunction] = {}
        self._log_sum = function("point_log_sum").bind(gaps, self.it.gap)
        self.s = structure("iteration")(
            calls=self.calls.cells,
            form=form.structure,
            at=ev.structure(),
            kkt=form.linear_system,
            now=self.it.structure, trial=self.trial.structure, incumbent=self.incumbent.structure,
            step=self.step.structure, affine=self.affine.structure, centring=self.centring.structure,
            correction=self.correction.structure, filter=self.filter.structure, accepted=self.accepted.structure,
            residual=self.residual, sigma=self.sigma, ratio=zeros(gaps), primal_diagonal=zeros(n),
            dual_diagonal=self.dual_diagonal, shifts=self.shifts, bend=zeros(form.hess_rows.size), centre=self.centre,
            correction_c=zeros(m), pull=zeros(size), turn=zeros(size), scratch=zeros(max(2 * gaps, n)),
            records=self.records.reshape(-1), best_x=self.best[0], best_y=self.best[1],
        )  # fmt: skip
        self.calls.put(VALUES, ev.values_call)
        self.calls.put(DERIVATIVES, ev.derivatives_call)
        told = self.s.array_of("violation"), self.s.array_of("stated")
        self.calls.put(WATCH, form.watch_call(self.it, *told))
        self.push_inside = function("point_push_inside").bind(form.structure, 0.0, self.start_w)
        (
            self.begin, self.factorize, self.find_step, self.search, self.settle, self.advance, self.iterate,
            self.repeat,
        ) = (
            function(name).bind(self.s)
            for name in (
                "inertia_correction_begin", "inertia_correction_factorize", "barrier_update_find_step",
                "line_search_search", "progress_settle", "progress_advance", "progress_iterate", "progress_repeat",
            )
        )  # fmt: skip

    @property
    def form(self) -> Formulation:
        """The form of the problem that the workspace belongs to."""
        form = self._form()
        assert form is not None
        return form

    def run(self, name: str, *args: float) -> Any:
        """Call a function of the core for this iteration, by its name there."""
        call = self._prepared.get(name)
        if call is None:
            call = self._prepared[name] = function(name).bind(self.s, *args)
        for place, value in enumerate(args, 1):
            call.floats[place] = value
        result = call()
        self.calls.check()
        return result

    def evaluate(self, w: Floats, y: Floats, z: Floats) -> Iterate:
        """Make ``(w, y, z)`` the iterate; functions may be undefined there."""
        it = self.it
        it.w[:], it.y[:], it.z[:] = w, y, z
        self.run("point_evaluate")
        return it

    def load(self, it: Iterate) -> None:
        """Take over an iterate."""
        if it is not self.it:
            self.it.become(it)
        self.it.structure.logarithms = self._log_sum()

    def renew_calls(self) -> None:
        """Take the calls that hold for matrices like the last one that was factorised, if any was."""
        attempt = self.kkt.attempt_call
        self.calls.put(ATTEMPT, attempt)
        if attempt is not None:
            self.renew_solves()

    def renew_solves(self) -> None:
        """Take those that solve with the last factorisation."""
        self.calls.put(SOLVE, self.kkt.solve_call)
        self.calls.put(SOLVE_BOTH, self.kkt.solve_both_call)
