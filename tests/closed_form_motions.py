"""Solutions made by hand from motions that are known in closed form: no solver takes part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel, FloatArray

Curve = Callable[[FloatArray], FloatArray]


def nodes(method: str, time: FloatArray, curve: Curve) -> Channel:
    """A smooth curve at the nodes of a method."""
    mid = curve(0.5 * (time[:-1] + time[1:])) if method == "hermite-simpson" else None
    return Channel.smooth(curve(time), mid)


def scaled(channel: Channel, factor: float, offset: float = 0.0) -> Channel:
    """``factor * channel + offset`` at every node."""
    mid = None if channel.mid is None else factor * channel.mid + offset
    return Channel(factor * channel.before + offset, factor * channel.after + offset, mid)


def constant(like: Channel, value: float) -> Channel:
    """The same number at every node."""
    return scaled(like, 0.0, value)


def solution_of(
    method: str,
    time: FloatArray,
    trajectories: Mapping[tuple[str, int], Channel],
    replay: Sequence[ReplayChannel],
    model: str | None = "particle.xml",
    **more: Any,
) -> Solution:
    """A solved spec with these node values."""
    facts: dict[str, Any] = {
        "name": "by_hand",
        "source": "# by hand\n",
        "constants": {"n": len(time) - 1},
        "status": "optimal",
        **more,
    }
    return Solution(method=method, time=time, trajectories=trajectories, replay=replay, model=model, **facts)


def particle(
    method: str,
    time: FloatArray,
    x: Sequence[Channel],
    y: Sequence[Channel],
    m: float = 1.0,
    g: float = 9.8,
    **more: Any,
) -> Solution:
    """The particle's solution from (position, velocity, acceleration) channels of x and y."""
    fx, fy = scaled(x[2], m), scaled(y[2], m, m * g)
    trajectories = {(name, k): c for name, cs in (("x", x), ("y", y)) for k, c in enumerate(cs)}
    replay = [
        ReplayChannel("joint", ("x",), *x),
        ReplayChannel("joint", ("z",), *y),
        ReplayChannel("actuator", ("fx",), fx),
        ReplayChannel("actuator", ("fz",), fy),
        ReplayChannel("set", ("body", "particle", "mass"), constant(fx, m)),
        ReplayChannel("set", ("option", "gravity", "z"), constant(fx, -g)),
        *more.pop("lines", ()),
    ]
    trajectories |= {("fx", 0): fx, ("fy", 0): fy}
    return solution_of(method, time, trajectories, replay, **more)


def smooth_particle(
    method: str, time: FloatArray, x: Sequence[Curve], y: Sequence[Curve], **more: Any
) -> Solution:
    """The particle's solution from (position, velocity, acceleration) as functions of time."""
    return particle(
        method, time, [nodes(method, time, c) for c in x], [nodes(method, time, c) for c in y], **more
    )


def waypoint_spline(duration: float = 2.0) -> tuple[list[Curve], list[Curve]]:
    """The clamped cubic splines through five waypoints: position, velocity and acceleration of x and y."""
    from scipy.interpolate import CubicSpline

    knots = np.linspace(0.0, duration, 5)
    found: list[list[Curve]] = []
    for values in ([0, 0.5, 1.1, 1.6, 2], [0, 0.8, 0.5, 1, 0]):
        spline = CubicSpline(knots, values, bc_type="clamped")
        found.append([spline, spline.derivative(1), spline.derivative(2)])
    return found[0], found[1]
