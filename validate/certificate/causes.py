"""Causes of a failure that can be found in the solved motion itself and that more frames do not correct."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.drifting import drifting_equalities
from stc.validate.metrics import FloatArray
from stc.validate.solved_pose import beyond_range

if TYPE_CHECKING:
    from stc.validate.setup import Setup
    from stc.validate.unmentioned_contacts import Touch

#: A force swings from node to node where it goes up and down for so many nodes, each time by more than this share of
#: its largest value.
_SWINGS, _SHARE = 8, 0.02
_ONLY_RATES = "since the spec states only its velocities or accelerations"


def beyond_limits(setup: Setup) -> list[str]:
    """A line for each joint that the solution moves beyond its limits in the model."""
    found = []
    for tie in setup.ties:
        beyond, end, bound = beyond_range(setup, tie) or (0.0, 0.0, 0.0)
        if beyond > limits.BEYOND_RANGE:
            found.append(
                f"joint {tie.name} goes to {end:.4g} {tie.unit}, its limit in the model is {bound:.4g} {tie.unit}"
            )
    return found


def clamped_controls(setup: Setup) -> list[str]:
    """A line for each solved control that the model clamps."""
    model, found = setup.compiled, []
    clamped = setup.controls.beyond_range(model)
    for name, index, channel in zip(setup.controls.names, setup.controls.addresses, setup.controls.channels):
        if name in clamped:
            values = np.concatenate([channel.before, channel.after])
            lower, upper = model.actuator_ctrlrange[index]
            end = values.min() if lower - values.min() > values.max() - upper else values.max()
            found.append(
                f"the control of {name} goes to {end:.4g}, the model clamps it to {lower:.4g} ... {upper:.4g}"
            )
    return found


def drifts(setup: Setup) -> list[str]:
    """A line for each equality of the model that drifts open along the solved motion."""
    return [
        f"{name} holds at the first frame and drifts open between the frames, "
        + ("faster than the spec's condition closes it" if pulled else _ONLY_RATES)
        for name, pulled in drifting_equalities(setup).items()
    ]


def drift_step(setup: Setup, more_frames: str, drifts: Sequence[str]) -> str:
    """Advice on equalities that drift open, as found by :func:`drifts`."""
    fast = float(f"{0.5 / np.diff(setup.solution.time).max():.1g}")
    frames = f"take more frames: {more_frames}" if more_frames else "take more frames"
    if not any(line.endswith(_ONLY_RATES) for line in drifts):
        return frames
    # With more frames the solver may find another motion, which drifts elsewhere.
    return (
        f"constrain the position too: for a condition g = 0, write g'' + {2.0 * fast:g}*g' + {fast**2:g}*g = 0 in "
        f"place of g'' = 0; or {frames}, which closes the loop as long as the motion remains the same"
    )


def swinging_forces(setup: Setup) -> list[str]:
    """A line for each solved contact force that alternates from node to node."""
    found = []
    for line in setup.contact.lines:
        values = _node_values(line.value.after, line.value.mid)
        per_frame = 1 if line.value.mid is None else 2
        bends = np.diff(values, 2)
        size = _SHARE * float(np.abs(values).max(initial=0.0))
        # The bend of what swings has another sign at each node, and four times its size.
        swings = (bends[1:] * bends[:-1] < 0.0) & (
            np.minimum(np.abs(bends[1:]), np.abs(bends[:-1])) > 4.0 * size
        )
        edges = np.flatnonzero(np.diff(np.concatenate([[False], swings, [False]]).astype(int))).reshape(-1, 2)
        long = [(int(a), int(b)) for a, b in edges if b - a >= _SWINGS]
        if long:
            a, b = max(long, key=lambda run: run[1] - run[0])
            first, last = a // per_frame, -(-(b + 2) // per_frame)
            found.append(
                f"the force of contact {line.name} alternates from node to node in frames {first} to {last}"
            )
    return found


def _node_values(frames: FloatArray, mid: FloatArray | None) -> FloatArray:
    """Values at the frames and, if there are any, the midpoints, in the order of time."""
    if mid is None:
        return frames
    found = np.empty(2 * len(frames) - 1)
    found[::2], found[1::2] = frames, mid
    return found


def steps(setup: Setup, touching: Sequence[Touch] = ()) -> list[str]:
    """Advice on the causes found in the solved motion, one line each.

    Args:
        setup: the motion.
        touching: geoms that touch where the spec has no contact force.
    """
    found = [
        f"{line}: state that limit in the spec, or give the model's joint another range"
        for line in beyond_limits(setup)
    ]
    found += [
        f"{line}: state that bound in the spec, or give the model's actuator another ctrlrange"
        for line in clamped_controls(setup)
    ]
    found += [f"{touch.line}: {touch.advice}" for touch in touching]
    return found


def swing_steps(setup: Setup) -> list[str]:
    """Advice on forces that alternate from node to node, in one line; those of right motions may do so too."""
    lines = swinging_forces(setup)
    if not lines:
        return []
    more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
    return [
        f"{lines[0]}{more}, which no contact of the model can follow: add the change of the force to the objective "
        "(for the contact `left`, a small weight times left_fz'^2) or a little acceleration (such as "
        "`1e-3*joint.*''^2` beside `effort`), or state the forces of bodies at rest with fewer unknowns"
    ]
