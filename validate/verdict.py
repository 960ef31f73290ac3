"""The whole validation of one solution: find its model, replay it, measure, judge."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from stc.arguments import number
from stc.errors import StcError, UsageError
from stc.records import dataclass, field
from stc.solution import Solution, read
from stc.validate import limits
from stc.validate.claims import Claims
from stc.validate.contact import contact_metrics, friction_note, missing_contacts
from stc.validate.contact_cones import beyond_contacts
from stc.validate.contact_drift import contact_drift, drift_metrics, drift_notes
from stc.validate.contact_forces import ContactForces, contact_force_metrics, contact_forces, windows_of
from stc.validate.contact_meter import ContactMeter
from stc.validate.energy import energy_balance
from stc.validate.explanation import explanation
from stc.validate.impacts import jumping_frames, velocity_jumps
from stc.validate.inverse import InverseDynamics, inverse_dynamics
from stc.validate.linearisation import growth, linearised
from stc.validate.metrics import FloatArray, Metric, drift
from stc.validate.model import file_hash
from stc.validate.momentum import momentum_metrics
from stc.validate.position_jumps import position_jumps
from stc.validate.replay import Replay, replay, stepping_for
from stc.validate.report import Report
from stc.validate.setup import Setup, prepare
from stc.validate.solved_pose import equality_metrics, limit_metrics, limit_notes
from stc.validate.statements import StatementCheck, statement_metrics
from stc.validate.tracking import Feedback, contact_effort, proportional, regulator, strengths
from stc.validate.unmentioned_contacts import Touch, unmentioned_contacts
from stc.validate.untied import unknown_forces, untied_motion
from stc.validate.warnings import caught_warnings


class NotOptimalError(StcError):
    """The solve did not end optimal, so that there is no motion to judge."""


@dataclass(slots=True)
class Replays:
    """The simulations of a motion.

    Attributes:
        setup: the motion and its model.
        open_loop: the replay with the solved forces alone.
        growth: growth of small errors along the motion; None if it is not known.
        growth_apart: the same within a phase, with fixed contact forces.
        tracked: the replay with feedback, or None if no actuator can steer.
        tracked_by: ``LQR``, ``PD`` or "".
        external: open loop with the solved contact forces in place of the model's contacts; None without any.
        ground: the contact forces, solved and in MuJoCo: open loop, or tracked if errors grow.
        explanation: the number of the model that explains a residual, in words; "" if there is none.
        touching: geoms that touch in the motion although the spec has no contact force there.
        strays: geoms that do so in a replay only.
        notes: notes of the replays.
    """

    setup: Setup
    open_loop: Replay
    growth: float | None = None
    growth_apart: float | None = None
    tracked: Replay | None = None
    tracked_by: str = ""
    external: Replay | None = None
    ground: list[ContactForces] = field(default_factory=list)
    explanation: str = ""
    touching: list[Touch] = field(default_factory=list)
    strays: list[Touch] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def unstable(self) -> bool:
        """Whether errors grow so much that only feedback keeps a replay close to the motion."""
        return _unstable(self.growth)


def _unstable(growth: float | None) -> bool:
    return growth is not None and growth >= limits.UNSTABLE_GROWTH


def validate(
    solution: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
    tracked: bool = True,
    statements: Sequence[StatementCheck] = (),
) -> Report:
    """Replay a solution in MuJoCo and judge it.

    Parameters
    ----------
    solution : Solution | str | os.PathLike[str]
        A solution, the path of a saved one, or a spec (a path, a bundled name, its text) to solve first.
    model : str | os.PathLike[str] | None
        A model file to use in place of the one that the spec names.
    force : bool
        Whether to judge a solution that is not optimal.
    time_step : float
        Longest time step of the replay, in seconds.
    integrator : str
        One of :data:`stc.validate.replay.INTEGRATORS`.
    tracked : bool
        Whether to replay with feedback as well.
    statements : Sequence[StatementCheck]
        Violations of the spec's statements between the nodes, evaluated by the caller.

    Returns
    -------
    Report
        The report, with all measurements, their limits and verdicts.

    Raises
    ------
    NotOptimalError
        The solution's status is not ``optimal`` and ``force`` is not given.
    ModelError
        There is no model, or a replay line does not fit it.
    UsageError
        A solution file, time step or integrator that cannot be used.
    SolutionError
        The solution file is damaged, or time does not increase along the solution.
    SpecError, EvaluationError
        Mistakes in a spec.
    """
    return examine(
        solution,
        model,
        force=force,
        time_step=time_step,
        integrator=integrator,
        tracked=tracked,
        statements=statements,
    )[0]


def examine(
    solution: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
    tracked: bool = True,
    statements: Sequence[StatementCheck] = (),
) -> tuple[Report, Replays]:
    """As :func:`validate`, and returns the simulations as well."""
    started = time.perf_counter()
    with caught_warnings() as warnings:
        setup = open_setup(solution, model, force=force)
        # By name: nothing here is imported from the layers above.
        claims: Claims = import_module("stc.solution_claims").judge(setup.solution)
        replays = run_replays(setup, time_step, integrator, tracked)
        report = _judge(replays, statements, claims)
    report.notes = [*report.notes, *warnings]
    report.seconds = time.perf_counter() - started
    return report, replays


def open_setup(
    solution: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
) -> Setup:
    """A solution or its file with its model; arguments and errors as for :func:`validate`."""
    beside: list[str | Path] = []
    if not isinstance(solution, Solution | str | os.PathLike):
        raise UsageError(
            f"a motion is a solution, the path of a saved one, or a spec, not {solution!r}",
            "a model is solved first: `validate(model.solve())`" if hasattr(solution, "solve") else "",
        )
    if not isinstance(solution, Solution):
        # By name: nothing here is imported from the layers above.
        solution = import_module("stc.certification").motion_of(solution)
    if not isinstance(solution, Solution):
        beside.append(Path(solution).parent)
        solution = read(solution)
    if solution.status != "optimal" and not force:
        raise NotOptimalError(
            f"the solution of {solution.name} is not validated: its status is {solution.status}, not optimal"
        )
    if solution.is_sketch:
        raise UsageError(
            f"the motion of {solution.name} was found by time stepping, which is of first order, and is not replayed",
            "`stc schedule` writes its contacts as ranges of frames, to be solved and validated",
        )
    setup = prepare(solution, model, beside)
    if beside and model is None and not solution.files:
        setup.remarks.append(
            "the file does not say for which model it was solved; the model found here is replayed"
        )
    return setup


def run_replays(
    setup: Setup, time_step: float = limits.TIME_STEP, integrator: str = "rk4", tracked: bool = True
) -> Replays:
    """All replays for a verdict: open loop, tracked if requested and, with contact forces, external.

    Raises:
        UsageError: a time step or integrator that cannot be used.
    """
    longest = number(time_step, "the time step of the replay")
    time_step, without_contacts, integrator = stepping_for(setup, longest, integrator)
    # What joints do that the spec does not tie is known from the open loop; without any, its contact forces are wanted
    # only where errors hardly grow: elsewhere feedback hides what the contacts do not give.
    error_growth, laws = steering(setup) if tracked and setup.all_tied else (None, [])
    meter = None if laws and _unstable(error_growth) else ContactMeter(setup)
    found = Replays(setup, replay(setup, time_step, integrator, meter=meter), error_growth)
    if found.open_loop.broke_at is not None:
        found.notes.append(f"the simulation left all bounds by t = {found.open_loop.broke_at:g} s")
    setup.untied, setup.unknown = untied_motion(setup, found.open_loop.path)
    if tracked and not setup.all_tied:
        found.growth, laws = steering(setup)
    tracked_meter = _track(found, laws, time_step, integrator)
    # On the ground it is the tracked replay that stays near the motion.
    judged = found.tracked if len(setup.contact) and found.tracked is not None else found.open_loop
    found.touching, found.strays = unmentioned_contacts(setup, judged)
    if not len(setup.contact):
        found.notes += [touch.line for touch in [*found.touching, *found.strays]]
    if len(setup.contact):
        _hand_over(found, without_contacts, integrator)
        if found.tracked is not None and tracked_meter is not None:
            found.ground = contact_forces(setup, found.tracked, tracked_meter)
        elif meter is not None:
            found.ground = contact_forces(setup, found.open_loop, meter)
    return found


def _hand_over(found: Replays, time_step: float, integrator: str) -> None:
    """The replay with the solved contact forces, and the growth of errors in it."""
    setup = found.setup
    found.external = replay(setup, time_step, integrator, external=True)
    maps = linearised(setup, held=False) if setup.solution.n else None
    if maps is not None:
        found.growth_apart = growth(maps, setup.reference.velocities, setup.solution.frames_that_jump())


def steering(setup: Setup) -> tuple[float | None, list[Feedback]]:
    """The growth of small errors along a motion, if it is known, and the available feedback laws.

    Returns:
        The growth, or None; the laws, the better one first.
    """
    error_growth = None
    laws: list[Feedback | None] = []
    # Contacts that the spec does not speak of take no part: what a bounce off them makes of errors excuses nothing.
    maps = linearised(setup) if setup.solution.n else None
    if maps is not None:
        error_growth = growth(maps, setup.reference.velocities)
        if setup.all_tied:
            laws.append(regulator(setup, maps))
    laws.append(proportional(setup) if setup.solution.n else None)
    return error_growth, [law for law in laws if law is not None]


def _track(
    found: Replays, laws: Sequence[Feedback], time_step: float, integrator: str
) -> ContactMeter | None:
    """The tracked replay, and the contact forces where errors grow much."""
    setup, kept = found.setup, None
    for law in laws:
        meter = ContactMeter(setup) if found.unstable else None
        tracked = replay(setup, time_step, integrator, feedback=law, meter=meter)
        if found.tracked is None or tracked.broke_at is None:
            found.tracked, found.tracked_by, kept = tracked, law.kind, meter
        if tracked.broke_at is None:
            break
    return kept


def _judge(replays: Replays, statements: Sequence[StatementCheck], claims: Claims) -> Report:
    """The report from finished replays; warnings and the wall time are added by the caller."""
    import mujoco

    setup, motion = replays.setup, replays.open_loop
    solution = setup.solution
    inverse = inverse_dynamics(setup)
    if inverse is not None and np.any(inverse.share(inverse.at_nodes) > inverse.limits(solution.method)):
        replays.explanation = explanation(setup)
    alone = _open_loop_metrics(replays)
    tracked = _tracked_metrics(replays, 0.0 if inverse is None else inverse.scale)
    if setup.compiled.na and tracked:
        tracked = [metric.without_limit() for metric in tracked]
        replays.notes.append(
            "the feedback assumes actuators without delay; since those of the model lag behind their controls, the "
            "tracked replay is for information, and the open-loop drift is judged"
        )
    failed = [metric for metric in tracked if metric.verdict == "fail"]
    tied = bool(
        setup.compiled.eq_active0.any()
    )  # the feedback is made for coordinates that equalities may not hold
    if tied and failed and {m.verdict for m in alone if m.name == "open-loop drift, largest"} == {"pass"}:
        tracked = [m.without_limit() if m in failed else m for m in tracked]
        replays.notes.append(
            "the solved forces alone repeat the motion: where the feedback moves bodies that equality constraints tie, "
            "or pushes to no effect, that is for information"
        )
    metrics = [*claims.metrics, *alone, *tracked]
    if replays.external is not None:
        # What an unstable phase makes of rounding does not shrink with the motion.
        drifts = _drifts("external drift", setup, replays.external, limits.EXTERNAL_DRIFT, of_extent=False)
        drifts = [metric for metric in drifts if metric.limit is not None]
        failed = [metric for metric in drifts if metric.verdict == "fail"]
        apart = replays.growth_apart or 1.0
        if failed and apart >= limits.UNSTABLE_GROWTH and replays.tracked is not None:
            drifts = [metric.without_limit() for metric in drifts]
            replays.notes.append(
                f"with the solved contact forces applied, errors grow up to {apart:.3g} times within a phase: the "
                "external drift is for information"
            )
        metrics += drifts
    metrics += position_jumps(setup)
    metrics += limit_metrics(setup)
    replays.notes += limit_notes(setup)
    metrics += equality_metrics(setup)
    metrics += _physics_metrics(setup, inverse)
    metrics += statement_metrics(statements, solution.method)
    metrics += momentum_metrics(setup)
    metrics += missing_contacts(setup)
    metrics += contact_force_metrics(replays.ground)
    stands = contact_drift(setup, replays.ground)
    metrics += drift_metrics(stands)
    replays.notes += drift_notes(stands)
    unjudged = _unjudged(setup, metrics)
    if unjudged:
        replays.notes.append(f"not judged: {', '.join(unjudged)}, as {_why_not(setup)}")
    beyond = beyond_contacts(setup, motion)
    if beyond is not None:
        metrics.append(
            Metric("contact force that no contact gives", "all contacts", beyond, "share", limits.CONTACT_FIT)
        )
    model_integrator = mujoco.mjtIntegrator(setup.compiled.opt.integrator).name.removeprefix("mjINT_").lower()
    return Report(
        spec=solution.name,
        spec_sha256=solution.sha256,
        status=solution.status,
        method=solution.method,
        n=solution.n,
        duration=solution.duration,
        model=setup.path.name,
        model_sha256=file_hash(setup.path),
        fields=setup.fields,
        simulator=f"MuJoCo {mujoco.mj_versionString()}",
        integrator=motion.integrator,
        model_integrator=model_integrator,
        time_step=motion.time_step,
        steps=motion.steps,
        tracked_by=replays.tracked_by,
        metrics=metrics,
        claims=claims,
        faults=setup.faults,
        unjudged=unjudged,
        notes=[*claims.notes, *setup.notes(), *replays.notes],
    )


def _unjudged(setup: Setup, metrics: Sequence[Metric]) -> list[str]:
    """Names of the physical measurements that a motion of this kind should have and that could not be made."""
    if not setup.solution.n:
        return []
    wanted = ["inverse-dynamics residual", "energy balance"]
    if any(np.any(rate.before != rate.after) for tie in setup.ties for rate in tie.channels(1)):
        wanted.append("unexplained impulse")
    if len(setup.contact) and not len(setup.applied) and not setup.all_tied:
        wanted.append("momentum in flight")
    made = {metric.name for metric in metrics}
    return [name for name in wanted if name not in made]


def _why_not(setup: Setup) -> str:
    """The reason why a measurement is not judged, in words."""
    return (
        unknown_forces(setup) or setup.unknown or "some joints of the model have no `joint` line in the spec"
    )


def _open_loop_metrics(replays: Replays) -> list[Metric]:
    """Open-loop drift and how small errors grow; the note on instability belongs to them."""
    setup = replays.setup
    if len(setup.contact):
        metrics = contact_metrics("open-loop", setup, replays.open_loop, replays.ground)
        metrics += _drifts("open-loop drift", setup, replays.open_loop)
        replays.notes.append(friction_note(setup))
    else:
        metrics = _drifts("open-loop drift", setup, replays.open_loop, limits.OPEN_LOOP_DRIFT)
    factor = replays.growth
    if factor is None:
        return metrics
    # Where the system multiplies every error, a large drift accuses nobody, and a small one is chance.
    if replays.unstable and replays.tracked is not None:
        if any(metric.verdict == "fail" for metric in metrics):
            metrics = [metric.without_limit() for metric in metrics]
            replays.notes.append(
                f"unstable: along this motion small errors grow up to {factor:.3g} times; it is judged by its "
                "residual and its tracked replay, not by the open-loop drift"
            )
    return [*metrics, Metric("growth of small errors", "motion", factor, "times")]


def _tracked_metrics(replays: Replays, force: float) -> list[Metric]:
    """Drift and effort of the tracked replay; ``force`` is the motion's largest generalised force."""
    if replays.tracked is None:
        return []
    setup, tracked = replays.setup, replays.tracked
    method = setup.solution.method
    share_limit = limits.FEEDBACK_SHARE[method]
    if len(setup.contact):
        metrics = contact_metrics("tracked", setup, tracked, replays.ground)
        share_limit = limits.CONTACT_FEEDBACK_SHARE
    else:
        metrics = _drifts("tracked drift", setup, tracked, limits.TRACKED_DRIFT)
        metrics = [metric for metric in metrics if metric.limit is not None]
    largest = float(tracked.total.max(initial=0.0))
    # Where no motor does anything the motion is made by what is there without them, gravity for one.
    units, passive = strengths(setup), force * setup.solution.duration
    idle = float((tracked.total * units).max(initial=0.0)) < limits.HARDLY_USED * passive
    held, corrected = contact_effort(setup), _corrected(replays, tracked)
    for name, feedback, total, unit, given in zip(
        setup.controls.names, corrected, tracked.total, units, held
    ):
        # An actuator that the motion hardly uses is measured against a share of the strongest one, and one on a joint
        # that the ground holds against what the ground gives.
        most = passive / float(unit) if idle and unit > 0.0 else largest
        base = max(float(total), float(given), limits.HARDLY_USED * most)
        share = float(feedback) / base if base > 0.0 else 0.0
        metrics.append(Metric("feedback share", f"actuator {name}", share, "share", share_limit))
    return metrics


def _corrected(replays: Replays, tracked: Replay) -> FloatArray:
    """(m,) the integral of the absolute feedback of each actuator.

    Where a body slides, its bounces make the friction flicker, and the feedback with it: there the means over the
    windows count that the contact forces are compared in; and where a wheel rolls whose speed swings from node to node.
    """
    unsteady = [flags for one in replays.ground for flags in (one.slides, one.swings) if flags is not None]
    slides = np.any(unsteady, axis=0) if unsteady else np.zeros(1)
    if not slides.any() or tracked.broke_at is not None:
        return tracked.feedback
    time = replays.setup.solution.time
    windows = windows_of(time, jumping_frames(replays.setup), slides)
    return np.abs(windows @ tracked.corrections).mean(axis=0) * (time[-1] - time[0])


def _drifts(
    name: str,
    setup: Setup,
    motion: Replay,
    limit: limits.ByMethod | None = None,
    *,
    of_extent: bool = True,
) -> list[Metric]:
    """The drifts of joints and compared outputs; if ``of_extent``, the limit is smaller for a small motion."""
    method = setup.solution.method
    # An output may be a speed, which is large where the motion is small and fast.
    signals = [
        (f"joint {tie.name}", tie.unit, tie.distances(motion.positions), tie.extent) for tie in setup.ties
    ]
    signals += [
        (
            f"output {output.line.name}",
            output.unit,
            output.distances(motion.outputs[:, k]),
            float(np.ptp([output.line.value.before, output.line.value.after])),
        )
        for k, output in enumerate(setup.outputs)
    ]
    metrics = []
    for subject, unit, distances, way in signals:
        largest, rms = drift(distances)
        allowed = None if limit is None else limit[method]
        # What an equality constraint gives way by depends on its load, however small the motion is.
        if allowed is not None and of_extent and not setup.compiled.eq_active0.any():
            extent, floor = max(setup.reference.extent, way), limits.DRIFT_FLOOR[method]
            allowed = limits.of_extent(allowed, limits.DRIFT_SHARE[method], extent, floor)
        metrics.append(Metric(f"{name}, largest", subject, largest, unit, allowed))
        metrics.append(Metric(f"{name}, RMS", subject, rms, unit))
    return metrics


def _physics_metrics(setup: Setup, inverse: InverseDynamics | None) -> list[Metric]:
    """Inverse dynamics, energy and impulses: what needs no replay."""
    method = setup.solution.method
    metrics = []
    if inverse is not None:
        dofs = setup.reference.dofs
        between = np.full(len(dofs), limits.INVERSE_DYNAMICS_BETWEEN[method])
        for name, residual, most in (
            ("inverse-dynamics residual", inverse.at_nodes, inverse.limits(method)),
            ("residual between frames", inverse.between, np.maximum(between, inverse.limits(method))),
        ):
            for dof, share, limit in zip(dofs, inverse.share(residual), most):
                metrics.append(Metric(name, f"joint {dof}", float(share), "share", float(limit)))
    energy = energy_balance(setup)
    if energy is not None:
        limit = limits.ENERGY_BALANCE[method]
        metrics.append(Metric("energy balance", "work against energy", energy.share, "share", limit))
    jumps = velocity_jumps(setup)
    if jumps is not None:
        for dof, share in zip(setup.reference.dofs, jumps.share):
            metrics.append(
                Metric("unexplained impulse", f"joint {dof}", float(share), "share", limits.VELOCITY_JUMP)
            )
        outside = jumps.outside_share
        if outside is not None:
            name = "unexplained impulse, pulls or slips beyond friction"
            metrics.append(Metric(name, "all contacts", outside, "share", limits.IMPULSE_CONE))
        if jumps.unfounded is not None:
            name = "unexplained impulse, no contact point gives it"
            metrics.append(Metric(name, "all contacts", jumps.unfounded, "share", limits.CONTACT_FIT))
        if energy is not None:
            metrics.append(Metric("energy at velocity jumps", "motion", energy.jumps, "J"))
    return metrics
