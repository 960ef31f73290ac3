"""The curves that a certificate plots: every compared quantity over time, solved and replayed, and all forces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.records import dataclass
from stc.validate.metrics import FloatArray
from stc.validate.replay import Replay
from stc.validate.signals import Signals
from stc.validate.verdict import Replays

#: A curve has about so many points at most: more than a plot of its size can show.
_POINTS = 400


@dataclass(frozen=True, slots=True)
class Line:
    """One curve: ``kind`` is ``solved``, ``replayed``, ``tracked`` or ``cone``; times and values are (k,)."""

    kind: str
    time: FloatArray
    value: FloatArray
    label: str = ""


@dataclass(frozen=True, slots=True)
class Panel:
    """One plot.

    Attributes:
        group: ``joint``, ``output``, ``actuator``, ``apply`` or ``contact``.
        name: name of the plotted quantity.
        unit: unit of the values.
        lines: the curves, the solved one first.
        differences: simulated minus solved values, if there was a simulation.
    """

    group: str
    name: str
    unit: str
    lines: list[Line]
    differences: list[Line]


def panels(replays: Replays) -> list[Panel]:
    """All plots of a motion: joints, outputs, actuators, external forces."""
    found = _joints(replays) + _outputs(replays)
    setup = replays.setup
    units = _actuator_units(replays)
    for group, signals in (
        ("actuator", setup.controls),
        ("apply", setup.applied),
        ("contact", setup.contact),
    ):
        found += _signals(replays, group, signals, lambda name: units.get(name, ""))
    return found


def _simulations(replays: Replays) -> list[tuple[str, Replay]]:
    found = [("replayed", replays.open_loop)]
    if replays.tracked is not None:
        found.append(("tracked", replays.tracked))
    return found


def _thinned(count: int) -> np.ndarray:
    """Indices of at most about :data:`_POINTS` of ``count`` points, including both ends."""
    return np.unique(np.linspace(0, count - 1, min(count, _POINTS)).astype(np.intp))


def _joints(replays: Replays) -> list[Panel]:
    setup = replays.setup
    solved: list[list[Line]] = [[] for _ in setup.ties]
    differences: list[list[Line]] = [[] for _ in setup.ties]
    for kind, motion in _simulations(replays):
        at = _thinned(len(motion.time))
        times = motion.time[at]
        truth = setup.reference.at_times(times)[0]
        for k, tie in enumerate(setup.ties):
            own = truth[:, setup.reference.columns[k]]
            simulated = motion.path[np.ix_(at, np.array(tie.positions))]
            if not solved[k]:
                solved[k].append(Line("solved", times, tie.shown(own)))
            solved[k].append(Line(kind, times, tie.shown(simulated)))
            differences[k].append(Line(kind, times, tie.gap(own, simulated)))
    return [Panel("joint", tie.name, tie.unit, solved[k], differences[k]) for k, tie in enumerate(setup.ties)]


def _outputs(replays: Replays) -> list[Panel]:
    setup = replays.setup
    found = []
    times = setup.solution.time
    for k, output in enumerate(setup.outputs):
        value = output.line.value
        lines, differences = [Line("solved", times, value.after)], []
        for kind, motion in _simulations(replays):
            simulated = motion.outputs[:, k]
            nearer = np.where(
                np.abs(simulated - value.before) < np.abs(simulated - value.after), value.before, value.after
            )
            lines.append(Line(kind, times, simulated))
            differences.append(Line(kind, times, simulated - nearer))
        found.append(Panel("output", output.line.name, output.unit, lines, differences))
    return found


def _signals(replays: Replays, group: str, signals: Signals, unit_of: Callable[[str], str]) -> list[Panel]:
    """The forces of the solution; the components of one force are in one plot."""
    solution = replays.setup.solution
    if not len(signals) or solution.n == 0:
        return []
    inside = max(2, min(8, _POINTS // solution.n))
    shares = np.linspace(0.0, 1.0, inside + 1)
    times = (solution.time[:-1, None] + shares * np.diff(solution.time)[:, None]).ravel()
    values = np.concatenate([signals.in_step(step, shares) for step in range(solution.n)])
    by_name: dict[str, list[Line]] = {}
    for k, line in enumerate(signals.lines):
        parts = group != "actuator" and line.path[-1][:1] in ("f", "m") and len(line.path) > 2
        name = ".".join(line.path[:-1]) if parts else line.name
        by_name.setdefault(name, []).append(
            Line("solved", times, values[:, k], line.path[-1] if parts else "")
        )
    return [
        Panel(group, name, unit_of(name) if group == "actuator" else _force_unit(lines), lines, [])
        for name, lines in by_name.items()
    ]


def _force_unit(lines: list[Line]) -> str:
    kinds = {line.label[:1] for line in lines}
    return "N" if kinds == {"f"} else "N m" if kinds == {"m"} else "N, N m"


def _actuator_units(replays: Replays) -> dict[str, str]:
    """N or N m if a control is the force on one joint, as for a motor with gear 1; otherwise ""."""
    import mujoco

    model, controls = replays.setup.compiled, replays.setup.controls
    units = {}
    for name, index in zip(controls.names, controls.actuators):
        plain = (
            int(model.actuator_trntype[index]) == int(mujoco.mjtTrn.mjTRN_JOINT)
            and int(model.actuator_gaintype[index]) == int(mujoco.mjtGain.mjGAIN_FIXED)
            and model.actuator_gear[index, 0] == 1.0
            and model.actuator_gainprm[index, 0] == 1.0
        )
        if plain:
            kind = model.jnt_type[model.actuator_trnid[index, 0]]
            units[name] = {
                int(mujoco.mjtJoint.mjJNT_SLIDE): "N",
                int(mujoco.mjtJoint.mjJNT_HINGE): "N m",
            }.get(int(kind), "")
    return units
