"""Robustness of a motion: many perturbed replays at once.

Every replay follows the solved motion under the same proportional-derivative feedback, in a model or from a state that
differs a little from the solved one.  Kinds of perturbation are tried one by one, then together, with ``mujoco.batch``,
which simulates all samples of a kind side by side.  The random numbers come from a seed: the same seed gives the same
result on the same machine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.errors import UsageError
from stc.records import dataclass, field
from stc.validate import limits
from stc.validate.contact import ground_distances, travelled
from stc.validate.grips import grips
from stc.validate.metrics import FloatArray
from stc.validate.replay import stepping_for
from stc.validate.tracking import Feedback, proportional
from stc.validate.transmissions import driven_dofs

if TYPE_CHECKING:
    import mujoco
    from mujoco import batch
    from rich.console import Console, ConsoleOptions, RenderResult

    from stc.validate.setup import Setup

#: What is perturbed: the kinds, and what each of them changes.
KINDS: Mapping[str, str] = {
    "none": "nothing: the motion as solved",
    "masses": f"mass and inertia of each body, up to {limits.PERTURBED_MASS:.0%} either way",
    "friction": f"all friction coefficients, up to {limits.PERTURBED_FRICTION:.0%} either way",
    "start": f"position ({limits.PERTURBED_POSITION:g}) and velocity ({limits.PERTURBED_VELOCITY:g}) of each "
    "joint with a motor, standard deviation",
    "time step": f"of the simulation, from one over {limits.PERTURBED_TIME_STEP:g} to as many times",
    "all": "all of these",
}


@dataclass(frozen=True, slots=True)
class Envelope:
    """The errors under one kind of perturbation.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    base : FloatArray
        (samples,) RMS distance of the base from the solved motion, as a share of its travel; for motions that are
        not on the ground, that of the sliding joints in m.  Infinite for a simulation that broke down.
    joints : FloatArray
        (samples,) RMS distance of the joints, in rad.
    lost : np.ndarray
        (samples,) whether a joint left the solved motion by more than :data:`limits.LOST`, as when the lamp
        falls.
    """

    kind: str
    base: FloatArray
    joints: FloatArray
    lost: np.ndarray

    @property
    def share_lost(self) -> float:
        """Share of the replays that were lost."""
        return float(np.mean(self.lost))

    def to_dict(self) -> dict[str, Any]:
        """Percentiles of both errors, and the share that was lost, as JSON takes them."""
        return {
            "kind": self.kind,
            "samples": len(self.lost),
            "base": _percentiles(self.base),
            "joints": _percentiles(self.joints),
            "lost": self.share_lost,
        }


@dataclass(slots=True)
class Robustness:
    """The envelopes of one motion.

    Attributes
    ----------
    spec : str
        Name of the spec.
    base_unit : str
        Unit of the base's errors: ``of travel`` or ``m``.
    seed : int
        Of the random numbers.
    envelopes : Sequence[Envelope]
        One per kind.
    simulator : str
        Name and version.
    integrator : str
        The model's own, or an implicit one where dampers are too stiff for it.
    time_step : float
        Longest time step in seconds, unperturbed.
    seconds : float
        Wall time.
    """

    spec: str
    base_unit: str
    seed: int
    envelopes: Sequence[Envelope]
    simulator: str
    integrator: str
    time_step: float
    seconds: float = field(default=0.0, compare=False)

    @property
    def message(self) -> str:
        """Why perturbed replays cannot judge the motion; "" if they can."""
        if not any(envelope.lost.any() for envelope in self.envelopes if envelope.kind == "none"):
            return ""
        return (
            "the motion is lost without any perturbation: each motor controls its own joint, and nothing controls "
            "joints without a motor"
        )

    def to_dict(self) -> dict[str, Any]:
        """The envelopes of all kinds of perturbation as a dictionary for JSON."""
        return {
            "spec": self.spec,
            "base_unit": self.base_unit,
            "seed": self.seed,
            "kinds": [envelope.to_dict() for envelope in self.envelopes],
            "simulator": self.simulator,
            "integrator": self.integrator,
            "time_step": self.time_step,
            "seconds": self.seconds,
        }

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Rich shows it as a table."""
        from rich.table import Table
        from rich.text import Text

        title = f"{self.spec}: perturbed replays with feedback, seed {self.seed}, in {self.simulator}"
        table = Table(title=title, title_justify="left", title_style="bold")
        for heading in ("perturbed", "what", "samples"):
            table.add_column(heading, overflow="fold")
        for heading in (
            f"base: median, 95 %, worst ({self.base_unit})",
            "joints: median, 95 %, worst (rad)",
            "lost",
        ):
            table.add_column(heading, justify="right", overflow="fold")
        for envelope in self.envelopes:
            found = envelope.to_dict()
            cells = [
                ", ".join("none" if v is None else f"{v:.2g}" for v in found[key].values())
                for key in ("base", "joints")
            ]
            table.add_row(
                envelope.kind, KINDS[envelope.kind], str(found["samples"]), *cells, f"{found['lost']:.0%}"
            )
        yield table
        yield Text(f"{self.integrator}, time step {self.time_step:.3g} s", style="dim")
        if self.message:
            yield Text(f"failed: {self.message}", style="bold red")


def _percentiles(values: FloatArray) -> dict[str, float | None]:
    # The median of infinities is not a number that JSON knows; a nearest value needs no arithmetic with them.
    found = np.percentile(values, [50.0, 95.0, 100.0], method="higher")
    keys = ("median", "percentile_95", "worst")
    return {key: float(value) if math.isfinite(value) else None for key, value in zip(keys, found)}


def robustness(
    setup: Setup, samples: int = limits.PERTURBED_SAMPLES, seed: int = 0, kinds: Sequence[str] = tuple(KINDS)
) -> Robustness:
    """Replay a motion many times with small perturbations.

    Parameters
    ----------
    setup : Setup
        The motion and its model, from :func:`stc.validate.verdict.open_setup`.
    samples : int
        Replays per kind; the unperturbed one is a single one.
    seed : int
        Seed of the random numbers.
    kinds : Sequence[str]
        The perturbations, of :data:`KINDS`.

    Returns
    -------
    Robustness
        The errors of all replays, one envelope per kind.

    Raises
    ------
    UsageError
        No samples, an unknown kind, a motion of a single frame, or one without a motor that feedback
        could act on.
    """
    import mujoco

    if samples < 1:
        raise UsageError(f"at least one sample is needed, not {samples}")
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown:
        raise UsageError(f"unknown kind of perturbation {unknown[0]!r}; known are {', '.join(KINDS)}")
    feedback = proportional(setup) if setup.solution.n else None
    if feedback is None:
        raise UsageError(f"{setup.solution.name}: no motor moves a single joint, so that feedback cannot act")
    started = time.perf_counter()
    time_step, _, integrator = stepping_for(setup)
    model = setup.model()
    if integrator != "rk4":  # the model's own, which steps here, would break down as well
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    envelopes = []
    for kind in kinds:
        # A stream of its own for each kind: an envelope does not depend on which others are asked for.
        rng = np.random.default_rng([seed, list(KINDS).index(kind)])
        envelopes.append(
            _envelope(setup, model, feedback, kind, 1 if kind == "none" else samples, time_step, rng)
        )
    integrator = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_").lower()
    return Robustness(
        setup.solution.name,
        "of travel" if len(setup.contact) else "m",
        seed,
        envelopes,
        f"MuJoCo {mujoco.mj_versionString()}",
        integrator,
        time_step,
        time.perf_counter() - started,
    )


def _envelope(
    setup: Setup,
    model: mujoco.MjModel,
    feedback: Feedback,
    kind: str,
    count: int,
    time_step: float,
    rng: np.random.Generator,
) -> Envelope:
    """All replays of one kind; those of one time step run together."""
    scales = np.ones(count)
    if kind in ("time step", "all"):
        # Few different steps, evenly spread on a logarithmic scale: simulations of one step run side by side.
        grid = limits.PERTURBED_TIME_STEP ** np.linspace(-1.0, 1.0, min(count, limits.TIME_STEPS))
        scales = grid[np.arange(count) % len(grid)]
    positions = np.full((count, setup.solution.n + 1, setup.compiled.nq), math.nan)
    for scale in np.unique(scales):
        chosen = np.flatnonzero(scales == scale)
        positions[chosen] = _simulate(setup, model, feedback, kind, len(chosen), time_step * scale, rng)
    base, joints, others = ground_distances(setup, positions)
    every = np.concatenate([base, joints, others], axis=1)
    finite = np.isfinite(positions).all(axis=(1, 2))
    lost = ~finite | (np.nan_to_num(every, nan=math.inf) > limits.LOST).any(axis=(1, 2))
    length = travelled(setup) if len(setup.contact) else 1.0
    return Envelope(
        kind,
        np.where(finite, _rms(np.sum(base**2, axis=1)) / length, math.inf),
        np.where(finite, _rms(np.sum(joints**2, axis=1) / max(1, joints.shape[1])), math.inf),
        lost,
    )


def _rms(squares: FloatArray) -> FloatArray:
    """(samples,) root of the mean over the frames of squared distances (samples, n+1)."""
    return np.sqrt(np.mean(squares, axis=1))


def _simulate(
    setup: Setup,
    model: mujoco.MjModel,
    feedback: Feedback,
    kind: str,
    count: int,
    time_step: float,
    rng: np.random.Generator,
) -> FloatArray:
    """(count, n+1, nq) positions at the frames of simulations that step together."""
    from mujoco import batch

    solution, reference = setup.solution, setup.reference
    sims = batch.Batch(model, nsim=count, persistent=False)
    _perturb_model(sims, setup, kind, rng)
    qpos, qvel, ctrl, force = (sims.bind(name) for name in ("qpos", "qvel", "ctrl", "qfrc_applied"))
    start = reference.at("after", 0)
    qpos[:, reference.positions], qvel[:, reference.velocities] = start[0], start[1]
    if kind in ("start", "all"):
        # A foot on the ground is not lifted or sunk into it.
        driven = np.isin(reference.velocities, list(driven_dofs(setup)))
        way, change = (
            size * _spread(rng, count, driven)
            for size in (limits.PERTURBED_POSITION, limits.PERTURBED_VELOCITY)
        )
        qpos[:, reference.positions] = reference.moved(start[0], way)
        qvel[:, reference.velocities] += change
    steps = sims.expand("opt.timestep")
    held = grips(setup)
    active = sims.bind("eq_active") if held else np.zeros((count, 0))
    found = np.full((count, solution.n + 1, model.nq), math.nan)
    found[:, 0] = qpos
    outer = _outer_forces(setup, model)
    for frame, duration in enumerate(np.diff(solution.time)):
        parts = max(limits.SUBSTEPS, math.ceil(duration / time_step - 1e-9))
        steps[:] = duration / parts
        for grip in held:
            active[:, grip.equality] = grip.on[frame]
        middles = (np.arange(parts) + 0.5) / parts
        controls = setup.controls.in_step(frame, middles)
        law = feedback.in_step(frame, np.arange(parts) / parts)
        pushes = outer(frame, middles)
        for part in range(parts):
            with np.errstate(invalid="ignore", over="ignore"):
                correction = law.correction(part, qpos, qvel)
            ctrl[:, setup.controls.addresses] = controls[part] + np.nan_to_num(correction)
            if pushes is not None:
                force[:] = pushes[part]
            sims.step()
        found[:, frame + 1] = qpos
    return found


def _perturb_model(sims: batch.Batch, setup: Setup, kind: str, rng: np.random.Generator) -> None:
    """Give every simulation its own masses and friction, as the kind asks for."""
    if kind in ("masses", "all"):
        mass, inertia = sims.expand("body_mass"), sims.expand("body_inertia")
        factor = 1.0 + limits.PERTURBED_MASS * rng.uniform(-1.0, 1.0, mass.shape)
        mass *= factor
        inertia *= factor[:, :, None]
    if kind in ("friction", "all"):
        friction = sims.expand("geom_friction")
        friction *= 1.0 + limits.PERTURBED_FRICTION * rng.uniform(-1.0, 1.0, (len(friction), 1, 1))
    sims.set_const()


def _spread(rng: np.random.Generator, count: int, chosen: np.ndarray) -> FloatArray:
    """(count, k) normal numbers where some of k entries are chosen, zeros elsewhere."""
    found = np.zeros((count, len(chosen)))
    found[:, chosen] = rng.standard_normal((count, int(chosen.sum())))
    return found


def _outer_forces(setup: Setup, model: mujoco.MjModel) -> Any:
    """Function of a frame and shares of its step (p,), giving the applied forces as generalised ones, (p, nv), or None.

    They act where the solved motion is, not where a perturbed one happens to be.
    """
    import mujoco

    if not len(setup.applied):
        return lambda frame, shares: None
    data = mujoco.MjData(model)

    def found(frame: int, shares: FloatArray) -> FloatArray:
        forces = setup.applied.in_step(frame, shares)
        motion = setup.reference.in_step(frame, shares)
        rows = []
        for k in range(len(shares)):
            setup.reference.put(data, [motion[0][k], motion[1][k]])
            setup.applied.apply(model, data, forces[k])
            rows.append(data.qfrc_applied.copy())
        return np.array(rows)

    return found
