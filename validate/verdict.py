"""The whole validation of one solution: find its model, replay it, measure, judge."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from stc.errors import StcError
from stc.solution import Solution, read
from stc.validate import limits
from stc.validate.fields import apply_fields
from stc.validate.forces import Controls
from stc.validate.inverse import inverse_dynamics
from stc.validate.metrics import Metric, drift
from stc.validate.model import ModelError, Tie, file_hash, find_model, load_model, names_of, tied_joints
from stc.validate.outputs import Output, compared_outputs
from stc.validate.replay import Replay, replay
from stc.validate.report import Report
from stc.validate.warnings import caught_warnings

if TYPE_CHECKING:
    import mujoco


class NotOptimalError(StcError):
    """The solve did not end in an optimum, so that there is nothing to judge."""


def validate(
    solution: Solution | str | os.PathLike[str],
    model: str | os.PathLike[str] | None = None,
    *,
    force: bool = False,
    time_step: float = limits.TIME_STEP,
    integrator: str = "rk4",
) -> Report:
    """Replay a solution in MuJoCo and judge it.

    Args:
        solution: a solution, or the path of a saved one.
        model: another model file than the one that the spec names.
        force: judge a solution that is not optimal as well.
        time_step: longest time step of the replay, in seconds.
        integrator: one of :data:`stc.validate.replay.INTEGRATORS`.

    Raises:
        NotOptimalError: the solution's status is not ``optimal`` and ``force`` is not given.
        ModelError: there is no model, or a replay line does not fit it.
        UsageError: a solution file, time step or integrator that cannot be used.
        SolutionError: the solution file is damaged, or time does not increase along the solution.
    """
    started = time.perf_counter()
    beside: list[str | Path] = []
    if not isinstance(solution, Solution):
        beside.append(Path(solution).parent)
        solution = read(solution)
    if solution.status != "optimal" and not force:
        raise NotOptimalError(
            f"the solution of {solution.name} is not validated: its status is {solution.status}, not optimal"
        )
    solution.require_increasing_times()
    path = _model_path(solution, model, beside)
    with caught_warnings() as warnings:
        report = _judge(solution, path, time_step, integrator)
    report.notes = [*report.notes, *warnings]
    report.seconds = time.perf_counter() - started
    return report


def _judge(solution: Solution, path: Path, time_step: float, integrator: str) -> Report:
    """The report but for warnings and wall time."""
    import mujoco

    compiled = load_model(path)
    model_integrator = mujoco.mjtIntegrator(compiled.opt.integrator).name.removeprefix("mjINT_").lower()
    fields = apply_fields(compiled, solution)
    ties = tied_joints(compiled, solution)
    if not ties:
        raise ModelError(f"the replay section of {solution.name} ties no joint: there is nothing to compare")
    controls = Controls(compiled, solution)
    outputs = compared_outputs(compiled, solution)
    notes = _notes(compiled, solution, ties, controls)
    motion = replay(compiled, solution, ties, controls, outputs, time_step, integrator)
    if motion.broke_at is not None:
        notes.append(f"the simulation left all bounds by t = {motion.broke_at:g} s")
    metrics = _drift_metrics(solution, ties, outputs, motion)
    metrics += _inverse_metrics(load_model(path), solution, ties)
    return Report(
        spec=solution.name,
        spec_sha256=solution.sha256,
        status=solution.status,
        method=solution.method,
        n=solution.n,
        duration=solution.duration,
        model=path.name,
        model_sha256=file_hash(path),
        fields=fields,
        simulator=f"MuJoCo {mujoco.mj_versionString()}",
        integrator=integrator,
        model_integrator=model_integrator,
        time_step=motion.time_step,
        steps=motion.steps,
        metrics=metrics,
        notes=notes,
    )


def _model_path(solution: Solution, model: str | os.PathLike[str] | None, beside: list[str | Path]) -> Path:
    if model is not None:
        return find_model(os.fspath(model), [Path()])
    if solution.model is None:
        raise ModelError(f"{solution.name} names no model: add a replay section to the spec to validate it")
    return find_model(solution.model, [solution.directory, *beside])


def _notes(model: mujoco.MjModel, solution: Solution, ties: list[Tie], controls: Controls) -> list[str]:
    """What the spec leaves out of the model, and where the model will not do what it is told."""
    notes = []
    if solution.status != "optimal":
        notes.append(f"the solution is not optimal: {solution.status}")
    tied = {tie.name for tie in ties}
    loose = [name for name in names_of(model, "joint") if name not in tied]
    if loose or len(ties) < model.njnt:
        notes.append(
            f"joints not tied to the spec start at rest where the model has them: {', '.join(loose)}"
        )
    idle = [name for name in names_of(model, "actuator") if name not in controls.names]
    if idle:
        notes.append(f"actuators not driven by the spec get the control 0: {', '.join(idle)}")
    clamped = controls.beyond_range(model)
    if clamped:
        notes.append(f"the model clamps the control of {', '.join(clamped)} to a smaller range")
    return notes


def _drift_metrics(
    solution: Solution, ties: list[Tie], outputs: list[Output], motion: Replay
) -> list[Metric]:
    limit = limits.OPEN_LOOP_DRIFT[solution.method]
    signals = [(f"joint {tie.name}", tie.unit, motion.positions[:, tie.position], tie.line) for tie in ties]
    signals += [
        (f"output {output.line.name}", output.unit, motion.outputs[:, k], output.line)
        for k, output in enumerate(outputs)
    ]
    metrics = []
    for subject, unit, simulated, line in signals:
        largest, rms = drift(simulated, line.value.before, line.value.after)
        metrics.append(Metric("open-loop drift, largest", subject, largest, unit, limit))
        metrics.append(Metric("open-loop drift, RMS", subject, rms, unit))
    return metrics


def _inverse_metrics(model: mujoco.MjModel, solution: Solution, ties: list[Tie]) -> list[Metric]:
    apply_fields(model, solution)
    found = inverse_dynamics(model, solution, ties, Controls(model, solution))
    if found is None:
        return []
    return [
        Metric(
            "inverse-dynamics residual", f"joint {tie.name}", float(share), "share", limits.INVERSE_DYNAMICS
        )
        for tie, share in zip(ties, found.share)
    ]
