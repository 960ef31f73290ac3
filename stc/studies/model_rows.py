"""Comparison with MuJoCo of the equations of motion that a spec gets from its model, at random states, term by term.

The expressions are derived from the model's numbers (:mod:`stc.mechanism`); MuJoCo computes the same from the model by
algorithms of its own.  The spec's rows are balances of forces on the degrees of freedom, in their order.  No
identification is needed: any joints, actuators with states and contact forces can be compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.language.model.scope import parts_of
from stc.phases import Phase
from stc.problem import IndexRef, Problem, ReplayChannel, VariableRef
from stc.studies.equation_report import EquationReport
from stc.studies.terms import DAMPING, FORCE, MASS, PRODUCT, STATIC, Term, differences, scales
from stc.symbolic.expr import Expr, evaluate, evaluate_all, symbols
from stc.validate import limits
from stc.validate.metrics import Metric
from stc.validate.state_equations import ModelState, StateEquations

FloatArray = NDArray[np.float64]

#: States at which terms are compared.
_TABLES = 4
#: Half-widths of the intervals that places, velocities, accelerations and forces are drawn from.
_PLACE, _FAST, _FORCE = 1.0, 3.0, 5.0
#: With more degrees of freedom than this, products of different velocities are compared as a whole only.
_PAIRS = 12


#: What is set in a state at rest: the array, the index in it, the value.
_Set = tuple[tuple[str, int, float], ...]


def compare_rows(
    problem: Problem,
    phases: Sequence[Phase],
    path: Path,
    numbers: Mapping[object, float],
    count: int,
    seed: int,
) -> EquationReport:
    """Compare the equations of motion of a spec with a model.

    Args:
        problem: the spec.
        phases: the stretches on which its equations are the same.
        path: of the model's file.
        numbers: values of constants and parameters.
        count: number of random states in each phase.
        seed: of these.

    Raises:
        UsageError: a joint or actuator line is not the variable of the same name.
        ModelError: the model does not have an element that a line names.
    """
    lines = {
        kind: [c for c in problem.replay if c.kind == kind]
        for kind in ("joint", "actuator", "set", "apply", "contact")
    }
    outer = [*lines["apply"], *lines["contact"]]
    fields = {c.path: float(evaluate(c.body, numbers)) for c in lines["set"]}
    model = StateEquations(
        path,
        {c.path: fields[c.path] for c in lines["set"] if fields[c.path] != c.usual},
        [(c.kind, c.path) for c in outer],
        problem.additions,
    )
    report = EquationReport(spec=problem.name, model=path.name, states=count, notes=list(model.notes))
    known = _places(model, lines["joint"], lines["actuator"])
    done: list[list[Expr]] = []
    rng = np.random.default_rng(seed)
    for phase in phases:
        rows = _rows(phase, model)
        if rows not in done:
            done.append(rows)
            at = {**numbers, IndexRef(): 0.5 * (phase.first + phase.last)}
            _Rows(rows, [c.body for c in outer], model, known, at, report, phase).compare(count, rng)
    return report


def _places(
    model: StateEquations, joints: Sequence[ReplayChannel], actuators: Sequence[ReplayChannel]
) -> dict[VariableRef, tuple[str, int]]:
    """The indices of the variables of joint and actuator lines in MuJoCo's order."""
    found: dict[VariableRef, tuple[str, int]] = {}
    for line in (*joints, *actuators):
        key = line.body.payload if line.body.op == "sym" else None
        if not isinstance(key, VariableRef):
            raise UsageError(
                f"`{line.kind} {'.'.join(line.path)}` is not a variable",
                "equations of a model can only be compared if `replay:` does not change the lines of its joints and "
                "actuators",
            )
        if line.kind == "actuator":
            control, state = model.actuator(".".join(line.path))
            found[key] = ("u", control) if control is not None else ("z", int(state or 0))
            continue
        place, rate = model.joint(line.path)
        if place is not None:
            found[key] = "q", place
        if rate is not None:
            order = 1 if place is not None else 0
            found[VariableRef(key.name, order)] = "v", rate
            found[VariableRef(key.name, order + 1)] = "a", rate
    return found


def _rows(phase: Phase, model: StateEquations) -> list[Expr]:
    """The residual of each degree of freedom, in MuJoCo's order."""
    found: dict[int, Expr] = {}
    for equation in phase.equations:
        if equation.relation.coordinate:
            _, dof = model.joint(tuple(parts_of(equation.relation.coordinate)[1:]))
            if dof is not None:
                found[dof] = equation.body
    missing = [name for dof, name in enumerate(model.dofs) if dof not in found]
    if missing:
        raise UsageError(
            f"the spec has no equation of motion of {', '.join(missing)}",
            "does the spec belong to this model?",
        )
    return [found[dof] for dof in range(len(model.dofs))]


class _Rows:
    """The rows of one phase, at states of the model."""

    def __init__(
        self,
        rows: Sequence[Expr],
        forces: Sequence[Expr],
        model: StateEquations,
        places: Mapping[VariableRef, tuple[str, int]],
        numbers: Mapping[object, float],
        report: EquationReport,
        phase: Phase,
    ) -> None:
        self.rows, self.forces, self.model, self.places = list(rows), list(forces), model, places
        self.numbers, self.report, self.phase = numbers, report, phase
        keys = {k for e in (*rows, *forces) for k in symbols(e) if isinstance(k, VariableRef)}
        self.free = sorted((key for key in keys if key not in places), key=str)
        #: Forces of contacts and the like: those of the variables that outer forces are made of.
        driven = {k for e in forces for k in symbols(e)}
        self.outer = [key for key in self.free if key in driven]

    # ------------------------------------------------------------------ states

    def _random(self, rng: np.random.Generator) -> ModelState:
        m = self.model.model
        q = np.array(m.qpos0) + rng.uniform(-_PLACE, _PLACE, m.nq)
        for at in self.model.orientations:
            q[at : at + 4] = rng.normal(size=4)
            q[at : at + 4] /= np.linalg.norm(q[at : at + 4])
        v, a = rng.uniform(-_FAST, _FAST, m.nv), rng.uniform(-_FORCE, _FORCE, m.nv)
        u, z = rng.uniform(-1.0, 1.0, m.nu), rng.uniform(-1.0, 1.0, m.na)
        return ModelState(q, v, a, u, z, rng.uniform(-_FORCE, _FORCE, len(self.outer)))

    def _still(self, state: ModelState) -> ModelState:
        """A state at rest without forces."""
        return ModelState(state.q, *(np.zeros_like(x) for x in (state.v, state.a, state.u, state.z, state.f)))

    def _sides(self, states: Sequence[ModelState]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The residuals of the spec's and of the model's equations, (S, nv) each, and the sizes of forces, (S,)."""
        known: dict[object, FloatArray | float] = dict(self.numbers)
        arrays = {part: np.array([getattr(state, part) for state in states]) for part in "qvauzf"}
        for key, (part, index) in self.places.items():
            known[key] = arrays[part][:, index]
        known.update(dict.fromkeys(self.free, 0.0))
        for index, key in enumerate(self.outer):
            known[key] = arrays["f"][:, index]
        shape = (len(states),)
        values = [
            np.broadcast_to(np.asarray(e, float), shape)
            for e in evaluate_all([*self.rows, *self.forces], known)
        ]
        spec, forces = np.array(values[: len(self.rows)]).T, np.array(values[len(self.rows) :]).T
        left, sizes = [], []
        for s, state in enumerate(states):
            given = forces[s] if len(self.forces) else np.zeros(0)
            one, size = self.model.left(ModelState(state.q, state.v, state.a, state.u, state.z, given))
            left.append(one)
            sizes.append(size)
        return spec, np.array(left), np.array(sizes)

    # --------------------------------------------------------------- comparing

    def compare(self, count: int, rng: np.random.Generator) -> None:
        """Compare the equations as a whole at ``count`` random states, then entry by entry at a few of them."""
        spec, model, sizes = self._sides([self._random(rng) for _ in range(count)])
        largest = np.where(sizes > 0.0, sizes, 1.0)[:, None]
        shares = (np.abs(spec - model) / largest).max(axis=0)
        for name, share in zip(self.model.dofs, shares, strict=True):
            self._metric("equations of motion", f"joint {name}", float(share))
        tables = [self._table(self._random(rng)) for _ in range(_TABLES)]
        terms = tables[0][0]
        ours, theirs = (np.array([table[side] for table in tables]) for side in (1, 2))
        apart = np.abs(ours - theirs) / scales(theirs, ours, terms)[:, None, :]
        for kind in (MASS, STATIC, PRODUCT, DAMPING, FORCE):
            columns = [k for k, term in enumerate(terms) if term.kind == kind]
            if columns:
                self._metric(f"{kind}, entry by entry", "all joints", float(apart[:, :, columns].max()))
        if any(metric.verdict == "fail" for metric in self.report.metrics):
            found = differences(ours, theirs, terms, self.model.dofs)
            self.report.findings += [f"{each} ({self.phase})" for each in found]
            if not found:
                worst = max(self.report.metrics, key=lambda metric: metric.value)
                self.report.findings.append(f"{worst.subject}: the forces differ, though no single term does")

    def _metric(self, name: str, subject: str, value: float) -> None:
        subject = f"{subject}, {self.phase}"
        self.report.metrics.append(Metric(name, subject, value, "share", limits.EQUATIONS))

    def _table(self, state: ModelState) -> tuple[list[Term], FloatArray, FloatArray]:
        """The terms at a place, and either side's entries, (nv, C) each."""
        still = self._still(state)
        asked = list(self._columns(still))
        needed = list(dict.fromkeys(key for _, parts in asked for key, _ in parts))
        spec, model, _ = self._sides([self._moved(still, key) for key in needed])
        at = {key: k for k, key in enumerate(needed)}
        ours, theirs = (
            np.array([sum(share * side[at[key]] for key, share in parts) for _, parts in asked]).T
            for side in (spec, model)
        )
        return [term for term, _ in asked], ours, theirs

    @staticmethod
    def _moved(still: ModelState, key: _Set) -> ModelState:
        """A state with some entries set."""
        arrays = {part: getattr(still, part).copy() for part in "qvauzf"}
        for part, index, value in key:
            arrays[part][index] = value
        return ModelState(**arrays)

    def _columns(self, still: ModelState) -> Iterator[tuple[Term, list[tuple[_Set, float]]]]:
        """Every term as a combination of residuals at some states, with the values set there."""
        dofs = self.model.dofs
        rest: _Set = ()
        for k, name in enumerate(dofs):
            yield Term(MASS, "", name), [((("a", k, 1.0),), 1.0), (rest, -1.0)]
        yield Term(STATIC, "static force (gravity and springs)"), [(rest, 1.0)]
        for k, name in enumerate(dofs):
            ahead, behind = (("v", k, 1.0),), (("v", k, -1.0),)
            yield Term(PRODUCT, f"velocity product {name}'^2"), [(ahead, 0.5), (behind, 0.5), (rest, -1.0)]
            yield Term(DAMPING, f"damping by {name}'"), [(ahead, 0.5), (behind, -0.5)]
        for i, j in combinations(range(len(dofs)), 2) if len(dofs) <= _PAIRS else ():
            one, other = ("v", i, 1.0), ("v", j, 1.0)
            parts = [((one, other), 1.0), ((one,), -1.0), ((other,), -1.0), (rest, 1.0)]
            yield Term(PRODUCT, f"velocity product {dofs[i]}'*{dofs[j]}'"), parts
        for key, (part, index) in self.places.items():
            if part in "uz":
                yield Term(FORCE, f"force of {key}"), [(((part, index, 1.0),), -1.0), (rest, 1.0)]
        for index, key in enumerate(self.outer):
            yield Term(FORCE, f"force of {key}"), [((("f", index, 1.0),), -1.0), (rest, 1.0)]


__all__ = ["compare_rows"]
