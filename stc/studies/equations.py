"""Comparison of a spec's equations of motion with its model's, at random states and term by term.

MuJoCo computes the accelerations for a state and its forces, and so do the spec's equations of motion, once these are
identified among its equations (:mod:`stc.studies.spec_equations`).  They are the ones that MuJoCo's accelerations
satisfy, if these suffice to determine all accelerations; otherwise further ones are added until they do, and the
tables of terms (:mod:`stc.studies.terms`) show where they differ from the model's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc.errors import UsageError
from stc.phases import Phase, phases
from stc.problem import ParameterRef, Problem, VariableRef
from stc.solution import Solution
from stc.studies.dry_friction import dry_friction_named, slid, way_in_words
from stc.studies.equation_report import EquationReport
from stc.studies.smoothed_friction import smoothed_friction
from stc.studies.spec_equations import SpecEquations, State, constant_values
from stc.studies.static_forces import static_forces_named
from stc.studies.taking_apart import Sample, Tables, TakingApart
from stc.studies.terms import (
    DAMPING,
    FORCE,
    MASS,
    PRODUCT,
    STATIC,
    TOGETHER,
    Difference,
    differences,
    matched,
    scales,
)
from stc.symbolic.expr import evaluate, symbols
from stc.validate import limits
from stc.validate.metrics import Metric
from stc.validate.model import find_model
from stc.validate.model_equations import ModelEquations
from stc.validate.warnings import caught_warnings

FloatArray = NDArray[np.float64]

#: States at which rows are recognised, and at which terms are compared.
_PROBES, _TABLES = 64, 12

#: With so many joints and tendons that have dry friction each way of sliding is tried.
_DRY = 6

#: An equation holds at MuJoCo's accelerations when it leaves less than this share of its terms.
_HOLDS = 1e-8

#: Half-widths of the intervals that positions, velocities and forces are drawn from.
_POSITION, _VELOCITY, _FORCE = np.pi, 4.0, 10.0


def check_equations(
    problem: Problem,
    model: str | None = None,
    *,
    states: int = limits.EQUATION_STATES,
    seed: int = 0,
    motion: Solution | None = None,
) -> EquationReport:
    """Compare a spec's equations of motion with those of its model.

    Args:
        problem: the spec with its numbers.
        model: a model file to use in place of the one that the spec names.
        states: number of random states per phase.
        seed: of the random states.
        motion: a solution of the problem; positions and velocities are drawn from its range.

    Raises:
        UsageError: the spec names no model, its expressions are undefined at random states, or its equations cannot be
            compared, for example because they contain values of neighbouring frames.
        ModelError: the model does not fit the replay section.
    """
    name = model or problem.model
    if name is None:
        raise UsageError(f"{problem.name} names no model", "a `replay:` section ties a spec to its model")
    folder = [Path(problem.source.path).parent] if problem.source.path else []
    path = find_model(name, [Path()] if model else folder)
    rng = np.random.default_rng(seed)
    numbers = constant_values(problem, _parameters(problem, rng), float(rng.uniform(0.0, 1.0)))
    if problem.of_model:
        from stc.studies.model_rows import compare_rows

        with caught_warnings() as warnings:
            report = compare_rows(problem, _wide_phases(problem), path, numbers, states, seed)
        report.notes += warnings
        return report
    lines = {kind: [c for c in problem.replay if c.kind == kind] for kind in ("joint", "actuator", "set")}
    outer = [c for c in problem.replay if c.kind in ("apply", "contact")]
    with caught_warnings() as warnings:
        mechanics = ModelEquations(
            path,
            {c.path: float(evaluate(c.body, numbers)) for c in lines["set"]},
            [".".join(c.path) for c in lines["joint"]],
            [".".join(c.path) for c in lines["actuator"]],
            [(c.kind, c.path) for c in outer],
        )
        report = EquationReport(
            spec=problem.name, model=path.name, states=states, notes=list(mechanics.notes)
        )
        joints, forces = ([c.body for c in some] for some in (lines["joint"], [*lines["actuator"], *outer]))
        each = [SpecEquations(problem, phase, joints, forces, numbers) for phase in _wide_phases(problem)]
        unread = _unread(each)
        done: list[list[object]] = []
        whole = True
        for spec in each:
            same = [e.body for e in (*spec.dynamic, *spec.laws)]
            if same not in done:
                done.append([*same])
                whole = _Comparison(spec, mechanics, report, rng, motion, unread).run(states) and whole
        if unread is not None and not whole:
            if not report.findings:
                raise unread
            report.notes.append(f"not all equations of motion are compared: {unread.message}")
    report.notes += warnings
    return report


def _wide_phases(problem: Problem) -> list[Phase]:
    """The phases, without end frames that central differences do not reach."""
    reach = 0
    if problem.method == "central":
        keys = [k for r in problem.relations for k in symbols(r.body) if isinstance(k, VariableRef)]
        reach = (max((key.order for key in keys), default=0) + 1) // 2
    found = [p for p in phases(problem) if p.last > reach and p.first < problem.n - reach]
    if not found:
        raise UsageError(f"{problem.name} has a single frame: there is no motion to compare")
    return found


def _unread(specs: Sequence[SpecEquations]) -> UsageError | None:
    """Why there may be equations of motion that cannot be read; None if there are none."""
    others = [e for s in specs for e in (*s.skipped, *s.stepping)]
    if not others:
        return None
    stepping = [e for e in others if any(isinstance(k, VariableRef) and k.shift for k in symbols(e.body))]
    places = dict.fromkeys(e.relation.span.location for e in stepping or others)
    what = "have values of neighbouring frames" if stepping else "are not linear in second derivatives"
    return UsageError(
        f"the equations at {', '.join(places)} {what}",
        "equations of motion can be compared where they are linear in accelerations, written as x''",
    )


def _parameters(problem: Problem, rng: np.random.Generator) -> dict[str, float]:
    """A value for every parameter, near its guess."""
    found = dict.fromkeys(problem.parameters, 1.0)
    for guess in problem.guesses:
        if guess.name in found:
            known = constant_values(problem, found, 0.0)
            if all(key in known for key in symbols(guess.body)):
                found[guess.name] = float(evaluate(guess.body, known))
    moving = {k.name for c in problem.replay for k in symbols(c.body) if isinstance(k, ParameterRef)}
    moving |= {k.name for r in problem.relations for k in symbols(r.body) if isinstance(k, ParameterRef)}
    return {
        name: value * float(rng.uniform(0.8, 1.2)) if name in moving else value
        for name, value in found.items()
    }


def _ranges(motion: Solution, phase: Phase, coordinates: Sequence[str]) -> list[FloatArray] | None:
    """The ranges of coordinates and their velocities on a phase of a motion, (2, k) each; None if not known."""
    found = []
    for order in (0, 1):
        channels = [motion.trajectories.get((name, order)) for name in coordinates]
        if any(channel is None for channel in channels):
            return None
        frames = slice(phase.first, phase.last + 1)
        values = [np.concatenate([c.before[frames], c.after[frames]]) for c in channels if c is not None]
        found.append(np.array([[v.min() for v in values], [v.max() for v in values]]))
    return found


class _Comparison:
    """Compares the equations of one phase of a spec with those of its model."""

    def __init__(
        self,
        spec: SpecEquations,
        model: ModelEquations,
        report: EquationReport,
        rng: np.random.Generator,
        motion: Solution | None = None,
        unread: UsageError | None = None,
    ) -> None:
        """``unread``: why equations of motion may be missing that the spec states."""
        self.spec, self.model, self.report, self.rng, self.unread = spec, model, report, rng, unread
        self.ranges = _ranges(motion, spec.phase, spec.coordinates) if motion is not None else None
        self.slid = slid(motion, spec.phase, model) if motion is not None else []
        self.k = len(model.joints)
        self.reactions = self._reactions()

    def run(self, states: int) -> bool:
        """Compare; False where equations of motion are missing that may be among those that cannot be read."""
        if len(self.spec.coordinates) != self.k:
            names = ", ".join(self.spec.coordinates)
            raise UsageError(
                f"the joint lines are expressions of {len(self.spec.coordinates)} variables ({names}) for "
                f"{self.k} joints",
                "equations of motion can be compared where there is one variable for each joint",
            )
        self._note_skipped()
        probe = self._probe()
        true = self._rows_that_hold(probe)
        rows = self._enough(probe, true)
        if len(rows) < self.k:
            if self.unread is None:
                self._incomplete(probe, rows)
            return self.unread is None
        shares = self._shares(self._sample(states), rows)
        for joint, share in zip(self.model.joints, shares):
            self._metric("equations of motion", f"joint {joint}", share)
        if np.all(shares <= limits.EQUATIONS):
            self._note_sliding_back()
        self._compare_terms(rows, bool(np.all(shares <= limits.EQUATIONS)))
        return True

    def _metric(self, name: str, subject: str, value: float) -> None:
        phase = self.spec.phase
        subject = f"{subject}, {phase}"
        self.report.metrics.append(Metric(name, subject, float(value), "share", limits.EQUATIONS))

    def _reactions(self) -> list[int]:
        """The auxiliaries that may be forces in the model's loops and gears: those that nothing else determines.

        MuJoCo finds these forces itself, so that no replay line hands them over.
        """
        if not self.model.has_equalities:
            return []
        bodies = [*self.spec.forces, *(law.body for law in self.spec.laws)]
        keys = [key for body in bodies for key in symbols(body) if isinstance(key, VariableRef)]
        determined = {key.name for key in keys}
        return [m for m, name in enumerate(self.spec.auxiliaries) if name not in determined]

    def _note_skipped(self) -> None:
        for equation in self.spec.skipped:
            place = equation.relation.span.location
            note = f"{place}: not linear in second derivatives, or with values of other frames: not compared"
            if note not in self.report.notes:
                self.report.notes.append(note)

    # ------------------------------------------------------------------ states

    def _sample(self, count: int) -> Sample:
        """Random states at which everything is defined."""
        k, m = self.k, len(self.spec.auxiliaries)
        fast: tuple[FloatArray | float, FloatArray | float] = (-_VELOCITY, _VELOCITY)
        draws: list[tuple[FloatArray | float, FloatArray | float]]
        draws = [(-_POSITION, _POSITION), (0.1, 1.0), (-0.3, 0.3)]
        if self.ranges is not None:
            draws, fast = [tuple(self.ranges[0])], tuple(self.ranges[1])
        for low, high in draws:
            shape = (2 * count, k)
            state = State(
                self.rng.uniform(low, high, shape),
                self.rng.uniform(*fast, shape),
                self.rng.uniform(-_FORCE, _FORCE, (2 * count, m)),
            )
            state.z[:, self.reactions] = 0.0  # the model's smooth equations are without
            with np.errstate(all="ignore"):
                found = self._at(state)
            if found is not None and len(found.q) >= count:
                return found if len(found.q) == count else found.first(count)
        raise UsageError(
            "the equations of motion have no value at random positions",
            "a square root, a logarithm or a division may be the reason",
        )

    def _at(self, state: State) -> Sample | None:
        """Spec and model at those of the given states where both are defined."""
        linear = self.spec.linear(state)
        jacobian, rest = self.spec.joint_map(linear.state)
        q, lines = self.spec.joint_positions(linear.state), self.spec.force_values(linear.state)
        arrays: Sequence[FloatArray] = (linear.matrix, linear.offset, jacobian, rest, q, lines)
        good = np.ones(len(q), dtype=bool)
        for array in arrays:
            good &= np.isfinite(array.reshape(len(q), -1)).all(axis=1)
        good[good] &= np.linalg.cond(jacobian[good]) < 1e8
        if not good.any():
            return None
        kept = State(linear.state.x[good], linear.state.v[good], linear.state.z[good])
        jacobian, rest, q, lines = jacobian[good], rest[good], q[good], lines[good]
        matrix = linear.matrix[good] @ np.linalg.inv(jacobian)
        offset = linear.offset[good] - (matrix @ rest[..., None])[..., 0]
        qd = (jacobian @ kept.v[..., None])[..., 0]
        mass, bias, force = self._model_at(q, qd, lines)
        return Sample(kept, q, qd, lines, matrix, offset, mass, bias, force)

    def _model_at(
        self, q: FloatArray, qd: FloatArray, lines: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        driven = len(self.model.actuators)
        mass, bias, force = np.zeros((*q.shape, self.k)), np.zeros_like(q), np.zeros_like(q)
        for s in range(len(q)):
            mass[s] = self.model.mass_matrix(q[s])
            bias[s] = self.model.bias(q[s], qd[s])
            force[s] = self.model.force(q[s], qd[s], lines[s, :driven], lines[s, driven:])
        return mass, bias, force

    # ------------------------------------------------------- which rows are meant

    def _probe(self) -> Sample:
        """Random states, with dry friction in the sliding direction in which most of the spec's equations hold."""
        model = self.model
        model.sliding[:] = 0.0
        still = best = self._sample(_PROBES)
        most, dry = (-1, 0.0), len(model.sliders)
        known = [(one.way,) if one.way else (0.0, 1.0, -1.0) for one in self.slid] or [(0.0, 1.0, -1.0)] * dry
        tries = [*product(*(known if dry <= _DRY else (ways[:1] for ways in known)))]
        if any(len(ways) > 1 for ways in known):
            tries.append(tuple(ways[0] if len(ways) == 1 else np.nan for ways in known))
        for way in tries:
            sliding = np.array(way)
            friction = np.array([model.friction(q, sliding, qd) for q, qd in zip(still.q, still.qd)])
            tried = replace(still, bias=still.bias + friction)
            left = self._left(tried)
            # Where something else is wrong as well no way may make an equation hold: then the one that leaves least.
            score = len(self._rows_that_hold(tried)), -float(np.median(left, axis=0).sum())
            if score > most:
                most, best, chosen = score, tried, sliding
        model.sliding = chosen
        for slider, which in zip(model.sliders, model.sliding):
            note = f"dry friction of {slider}: {way_in_words(which)} ({self.spec.phase})"
            self.report.notes.append(note)
        return best

    def _note_sliding_back(self) -> None:
        """Report friction that acts in both directions on the motion, if the spec has the same for both."""
        for slider, gone, way in zip(self.model.sliders, self.slid, self.model.sliding):
            frames = gone.otherwise(float(way))
            if frames:
                self.report.findings.append(
                    f"{slider}: dry friction: spec {way_in_words(way)}, the motion slides {frames} ({self.spec.phase})"
                )
                self._metric("equations of motion", f"dry friction of {slider}", 1.0 + abs(way))

    def _rows_that_hold(self, probe: Sample) -> list[int]:
        """The equations that MuJoCo's accelerations satisfy at every state."""
        holds = self._left(probe) <= _HOLDS
        involved = np.abs(probe.matrix).max(axis=(0, 2)) > 0.0
        return [int(row) for row in np.flatnonzero(holds.all(axis=0) & involved)]

    def _left(self, probe: Sample) -> FloatArray:
        """The residuals of the equations with MuJoCo's accelerations, (S, E), as a share of their terms."""
        acceleration = np.linalg.solve(probe.mass, (probe.force - probe.bias)[..., None])[..., 0]
        parts = probe.matrix * acceleration[:, None, :]
        size = np.abs(parts).sum(axis=2) + np.abs(probe.offset)
        return np.asarray(np.abs(parts.sum(axis=2) + probe.offset) / np.where(size > 0.0, size, 1.0))

    def _enough(self, probe: Sample, true: Sequence[int]) -> list[int]:
        """k equations that determine all accelerations, the true ones first; fewer if there are not so many."""
        others = [row for row in range(self.spec.size) if row not in true]
        others.sort(key=self._standing)
        chosen: list[int] = []
        for row in (*true, *others):
            if _rank(probe.matrix[:8, [*chosen, row]]) > len(chosen):
                chosen.append(row)
        return sorted(chosen) if len(chosen) == self.k else chosen

    def _standing(self, row: int) -> int:
        """A sort key for how likely an equation is an equation of motion; smaller is more likely."""
        equation = self.spec.dynamic[row]
        if equation.relation.coordinate:
            return 0
        keys = [k for k in symbols(equation.body) if isinstance(k, VariableRef)]
        names = {key.name for key in keys}
        if names & set(self.spec.auxiliaries):
            return 1
        return 2 if len(keys) > 1 else 3

    def _incomplete(self, probe: Sample, rows: Sequence[int]) -> None:
        """A message with the joints whose accelerations the spec does not determine."""
        matrix = probe.matrix[0, list(rows)]
        _, sizes, directions = np.linalg.svd(matrix) if rows else (None, np.zeros(0), np.eye(self.k))
        open_ = directions[int((sizes > 1e-10 * max(sizes, default=1.0)).sum()) :]
        weight = np.abs(open_).max(axis=0)
        for joint in np.flatnonzero(weight > 0.5 * weight.max()):
            name = self.model.joints[joint]
            self.report.findings.append(
                f"joint {name}: the spec states no equation of motion for it on {self.spec.phase}"
            )
            self._metric("equations of motion", f"joint {name}", np.inf)

    # ------------------------------------------------------------------ comparing

    def _shares(self, sample: Sample, rows: Sequence[int]) -> FloatArray:
        """(k,) largest difference at the states, as a share of the largest generalised force there."""
        matrix, offset = sample.matrix[:, rows], sample.offset[:, rows]
        size = np.abs(matrix).max(axis=2)
        acceleration = -np.linalg.solve(matrix / size[..., None], (offset / size)[..., None])[..., 0]
        worst = np.zeros(self.k)
        for s in range(len(acceleration)):
            needed = self.model.inverse(sample.q[s], sample.qd[s], acceleration[s])
            largest = max(
                float(np.abs(f).max())
                for f in (needed, sample.bias[s], sample.force[s], sample.mass[s] * acceleration[s])
            )
            worst = np.maximum(worst, np.abs(needed - sample.force[s]) / (largest or 1.0))
        return worst

    def _compare_terms(self, rows: Sequence[int], agree: bool) -> None:
        """Entry by entry: mass matrix, bias, forces."""
        sample, equations = self._sample(_TABLES), [self.spec.dynamic[row] for row in rows]
        places = [equation.relation.span.location for equation in equations]
        joint_maps = self.spec.joint_map(sample.state)[0]
        names = [self._line(m) for m in range(len(self.spec.auxiliaries))]
        tables = TakingApart(self.model, self._at, sample, rows, joint_maps, names).tables()
        self._note_together(tables, places)
        if tables is None:
            if not agree:
                self._report([], places)
            return
        terms, spec, model = tables.terms, tables.spec, tables.model
        maps = None
        order = [e.relation.coordinate for e in equations]
        if sorted(order) == sorted(self.spec.coordinates):
            by_coordinate = [order.index(name) for name in self.spec.coordinates]
            spec = spec[:, by_coordinate]
            maps = joint_maps
        table = matched(spec, model, terms, maps)
        self._hold(sample, table, model)
        shares = np.abs(table - model) / scales(model, table, terms)[:, None, :]
        for kind in (MASS, STATIC, TOGETHER, PRODUCT, DAMPING, FORCE):
            columns = [column for column, term in enumerate(terms) if term.kind == kind]
            if columns:
                self._metric(f"{kind}, entry by entry", "all joints", float(shares[:, :, columns].max()))
        found = differences(table, model, terms, self.model.joints)
        found = dry_friction_named(found, table[..., self.k], model[..., self.k], self.model)
        found = static_forces_named(found, tables, table[..., self.k] - model[..., self.k], self.model)
        if agree and not found:
            return
        smooth, found = smoothed_friction(found, sample, rows, joint_maps, self._at, self.model, self.slid)
        for one in smooth:
            self.report.findings.append(f"{one} ({self.spec.phase})")
            self.report.steps.append(one.step)
            self.report.plain = self.report.plain or not one.explains_all
        if found or not smooth:
            self.report.plain = True
            self._report(found, places)

    def _note_together(self, tables: Tables | None, places: Sequence[str]) -> None:
        """A note on terms that were not compared one by one, with the reason."""
        if tables is not None and tables.at_rest:
            return
        how = "are not taken apart term by term"
        if tables is not None:
            how = "are taken apart without those of velocities, which stay with the static forces"
        self.report.notes.append(
            f"the equations of motion at {', '.join(dict.fromkeys(places))} {how} ({self.spec.phase}): they have no "
            "value at rest, or without forces; a division by a speed may be the reason"
        )

    def _hold(self, sample: Sample, table: FloatArray, model: FloatArray) -> None:
        """Add to the model the spec's forces in loops and gears that it can give; its table is changed in place."""
        first = table.shape[2] - len(self.spec.auxiliaries)
        for column in (first + m for m in self.reactions):
            for s, q in enumerate(sample.q):
                model[s, :, column] = -self.model.held(q, -table[s, :, column])

    def _report(self, found: Sequence[Difference], places: Sequence[str]) -> None:
        phase = self.spec.phase
        for difference in found:
            self.report.findings.append(f"{difference} ({phase})")
        if not found:
            worst = max(self.report.metrics, key=lambda metric: metric.value)
            self.report.findings.append(
                f"{worst.subject}: the accelerations differ, though no single term does at unit velocities"
            )
        where = ", ".join(dict.fromkeys(places))
        note = f"the equations of motion that were compared stand at {where}"
        if note not in self.report.notes:
            self.report.notes.append(note)

    def _line(self, auxiliary: int) -> str:
        """The replay lines of an auxiliary, or its own name."""
        name = self.spec.auxiliaries[auxiliary]
        lines = [*(f"actuator {one}" for one in self.model.actuators), *self.model.outer]
        driven = [
            line
            for line, body in zip(lines, self.spec.forces)
            if any(isinstance(key, VariableRef) and key.name == name for key in symbols(body))
        ]
        if driven:
            return " and ".join(driven)
        if auxiliary in self.reactions:
            return f"{name}, as far as a loop or gear of the model can give it"
        return f"{name}, which no replay line hands over"


def _rank(rows: FloatArray) -> int:
    """Rank of rows (S, r, k) at most states, each row scaled."""
    size = np.abs(rows).max(axis=2, keepdims=True)
    scaled = np.divide(rows, size, out=np.zeros_like(rows), where=size > 0.0)
    return int(np.median(np.linalg.matrix_rank(scaled, tol=1e-9)))


__all__ = ["EquationReport", "check_equations"]
