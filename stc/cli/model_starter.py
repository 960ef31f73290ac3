"""The spec that `stc new --model robot.xml` writes: the first of a few plain ones that solves.

A robot that stands is asked to stand, one that is mounted to hold its pose, and what can do neither is let go.
Which of these a model can do depends on its motors, ranges and shapes, so each page is solved before it is written.
"""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stc import pipeline
from stc.bundled import with_text
from stc.cli.model_files import find
from stc.errors import Source, StcError, UsageError
from stc.language import syntax
from stc.language.model.scope import ModelScope, coordinates_of, path_of, quoted
from stc.language.model.surfaces import floor
from stc.mechanism.mechanism import Geom, Mechanism
from stc.mechanism.read import read_model
from stc.mechanism.refusals import refusals, without
from stc.mechanism.tree import Frame
from stc.mechanism.vectors import Vector
from stc.problem import ConstantRef, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import evaluate_all

#: Places of contact that are this much above the lowest one, in m, stand in the same pose; if legs may bend, these.
_LEVEL, _NEAR = 1e-3, 0.1
#: Places of one body that are this much above its lowest one, in m, belong to its sole.
_SOLE = 5e-3
#: Limits of a trial solve: a page to start from is an easy one.
_ITERATIONS, _SECONDS = 300, 20.0
#: The share of a joint's range that a pose which lies outside of it is moved inside.
_INSIDE = 0.1


@dataclass(frozen=True, slots=True)
class _Page:
    """What one page asks for.

    Attributes
    ----------
    title
        What the model does there.
    seconds
        How long.
    feet
        Contacts that stand, and their places.
    pinned, ends
        Whether the first frame is the pose, and whether the last one is at rest, in the same pose if that is pinned.
    bent
        Whether joints at an end of their range are bent a little: straight legs that stand are singular.
    raised
        How far everything is above the pose, in m.
    """

    title: str
    seconds: float = 0.5
    feet: tuple[str, ...] = ()
    pinned: bool = True
    ends: bool = True
    bent: bool = False
    raised: float = 0.0


def starter(name: str, path: Path) -> str:
    """A commented spec that moves a model, and solves as it stands.

    Parameters
    ----------
    name
        The model file, or the name of a bundled model.
    path
        Where the spec is to be written.

    Raises
    ------
    UsageError
        There is no such model, or it has no joints.
    """
    mechanism = read_model(find(name))
    left = sorted({refusal.kind for refusal in refusals(mechanism)})
    mechanism = without(mechanism, left)
    if not mechanism.joints:
        raise UsageError(f"the model `{name}` has no joints: there is nothing to move")
    text = ""
    for page in _pages(mechanism):
        text = _text(page, mechanism, path, name, left)
        if _solves(text, path):
            return text
    return f"# Within {_SECONDS:g} s it was not solved.\n" + text


def _solves(text: str, path: Path) -> bool:
    try:
        model = pipeline.Model(with_text(Source("starter", text, str(path))))
        return bool(model.solve(max_iterations=_ITERATIONS, time_limit=_SECONDS).status == "optimal")
    except StcError:
        return False


def _pages(mechanism: Mechanism) -> Iterator[_Page]:
    """Pages from the most to the least that can be asked of a model."""
    travels = _travels(mechanism)
    if travels and mechanism.actuators and "contact" not in mechanism.options.disabled:
        level = _feet(mechanism, _LEVEL)
        if len(level) > 1:
            yield _Page("stands with the least effort", feet=level)
        near = _feet(mechanism, _NEAR)
        if near:
            title = "stands in a pose that takes the least effort"
            yield _Page(title, feet=near, pinned=False, bent=True)
    if not any(joint.kind == "free" for joint in mechanism.joints):
        yield _Page("holds a pose with the least effort")
    title = "is let go, and moves with the least effort"
    if travels:
        yield _Page(title, 0.2, ends=False, raised=0.5)
    yield _Page(title, 0.05, ends=False)


def _travels(mechanism: Mechanism) -> bool:
    """Whether a body that hangs on the world can be moved up and down."""
    return any(
        mechanism.bodies[joint.body].parent == 0
        and (joint.kind == "free" or (joint.kind == "slide" and abs(joint.axis[2]) > 1.0 - 1e-9))
        for joint in mechanism.joints
    )


def _text(page: _Page, mechanism: Mechanism, path: Path, name: str, left: Sequence[str]) -> str:
    changed = _moved_inside(mechanism, page.bent)
    base = _pose(mechanism)[0] + (f" + (0, 0, {page.raised:g})" if page.raised else "")
    changes = "".join(f", {joint} = {value:.6g}" for joint, value in changed)
    lines = [
        f"# {path.stem}: {Path(name).stem} {page.title}.  A page to start from.",
        "#",
        f"#     stc run {shlex.quote(str(path))}    solve it, then let MuJoCo replay it",
        f"#     stc show {shlex.quote(name)}    what the model's joints, actuators, sites and poses are called",
        "",
        "constants:",
        "  n = 20,                 # frames are 0, 1, ..., n",
        f"  T = {page.seconds:g}, h = T/n;       # seconds in all, and from one frame to the next",
        "",
        f'model: "{_written(name, path)}"' + (f" without {', '.join(left)}" if left else "") + ";",
        "",
    ]
    if page.feet:
        names = [f"foot{k + 1}" for k in range(len(page.feet))]
        lines += ["contact:                  # what touches the floor, and on which frames"]
        lines += [f"  {foot} = {place};" for foot, place in zip(names, page.feet, strict=True)]
        lines += [f"  [0, n]: {' '.join(f'{foot};' for foot in names)}", ""]
    lines += ["poses:", f"  begin = {base}{' grounded' if page.feet else ''}{changes};", "", "constraints:"]
    if page.pinned:
        lines += ["  [0]: begin; rest;"]
        if page.ends:
            lines += ["  [n]: begin; rest;          # ask for more: another pose, or values of joints"]
        else:
            lines += [
                "  # [n]: ...;                # what the last frame is to be: a pose, or values of joints"
            ]
    else:
        values = "".join(f" {joint} = {value:.6g};" for joint, value in changed)
        lines += [f"  [0]: rest;{values}", f"  [n]: rest;{values}"]
        lines += ["", "guess:", "  [0]: begin;", "  [n]: begin;"]
    if not mechanism.actuators:
        joint = path_of("joint", mechanism.joints[0].name)
        if mechanism.joints[0].kind in ("hinge", "slide"):
            lines += [
                "",
                "# The model has no actuators. A force on a joint is stated, and handed to MuJoCo, by",
            ]
            lines += [f"# variables: u;   forces: {joint}: u;   replay: apply {joint} = u;"]
    lines += ["", "objective:"]
    lines += [f"  [0, n]: integral({'effort' if mechanism.actuators else '0'});"]
    return "\n".join(lines) + "\n"


def _written(name: str, path: Path) -> str:
    """A model as a spec at ``path`` calls it: files are looked up beside the spec, then among the bundled ones."""
    if not Path(name).is_file() or Path(name).is_absolute():
        return name
    return Path(os.path.relpath(name, path.parent)).as_posix()


def _pose(mechanism: Mechanism) -> tuple[str, Sequence[float]]:
    """The model's first keyframe with a name, else the pose that the file draws: its path and coordinates."""
    for keyframe in mechanism.keyframes:
        if keyframe.name:
            return f"keyframe.{quoted(keyframe.name)}", keyframe.qpos
    return "keyframe.reference", mechanism.start


def _moved_inside(mechanism: Mechanism, bent: bool) -> list[tuple[str, float]]:
    """Joints that the first pose has outside of their range, or where ``bent`` at its end, and a value inside."""
    q = _pose(mechanism)[1]
    found = []
    for joint in mechanism.joints:
        if joint.limited and joint.kind in ("hinge", "slide"):
            lower, upper = joint.bounds
            room = 1e-3 * (upper - lower) if bent else 0.0
            if not lower + room <= q[joint.qpos] <= upper - room:
                margin = _INSIDE * (upper - lower)
                value = float(np.clip(q[joint.qpos], lower + margin, upper - margin))
                found.append((path_of("joint", joint.name), value))
    return found


def _feet(mechanism: Mechanism, near: float) -> tuple[str, ...]:
    """Places that can stand on the floor in the first pose: the lowest ones of geoms that may touch something."""
    scope = ModelScope(syntax.ModelFile(0, 0, ""), Path(), mechanism)
    q = _pose(mechanism)[1]
    known: dict[Any, float] = {ConstantRef(name): value for name, value in scope.constants.items()}
    for joint in mechanism.joints:
        one = coordinates_of(joint)
        known.update({VariableRef(each): q[joint.qpos + k] for k, each in enumerate(one.pose)})
    known.update({VariableRef(name): value for name, value in _moved_inside(mechanism, False)})
    kinematics, up = scope.dynamics.kinematics, np.array(floor(scope).normal)

    def numbers(vector: Vector) -> np.ndarray:
        return np.array([float(each) for each in evaluate_all(list(vector), known)])

    def seen(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        return numbers(kinematics.place_of(frame)), np.array([numbers(r) for r in kinematics.axes_of(frame)])

    candidates: dict[int, list[tuple[float, str]]] = {}
    for index, geom in enumerate(mechanism.geoms):
        frame, body = scope.dynamics.geoms[index], mechanism.bodies[geom.body].name
        if frame.segment >= 0 and (geom.contype or geom.conaffinity) and body:
            (place, axes), (origin, turn) = seen(frame), seen(scope.dynamics.body(geom.body))
            for at, text in _lowest(geom, axes, up):
                local = ", ".join(
                    f"{0.0 if abs(v) < 1e-9 else v:.6g}" for v in turn.T @ (place + at - origin)
                )
                written = text or f"point({path_of('body', body)}, {local})"
                candidates.setdefault(geom.body, []).append((float(up @ (place + at)), written))
    least = {body: min(height for height, _ in found) for body, found in candidates.items()}
    lowest = min(least.values(), default=0.0)
    standing = [
        text
        for body, found in candidates.items()
        for height, text in found
        if height < min(least[body] + _SOLE, lowest + near)
    ]
    return tuple(dict.fromkeys(standing))


def _lowest(geom: Geom, axes: np.ndarray, up: np.ndarray) -> list[tuple[np.ndarray, str]]:
    """Places of a geom that may be its lowest, seen from its middle, and what the language calls them, if anything."""
    size = np.array(geom.size)
    down = -axes.T @ up
    if geom.kind == "sphere":
        return [(-size[0] * up, f"point({path_of('geom', geom.name)})" if geom.name else "")]
    if geom.kind == "capsule":
        ends = [sign * size[1] * axes[:, 2] - size[0] * up for sign in (1.0, -1.0)]
        return [(end, "") for end in ends]
    if geom.kind == "ellipsoid":
        return [(axes @ (size**2 * down / math.sqrt(down @ (size**2 * down))), "")]
    if geom.kind == "cylinder":
        across = down * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(across))
        if length < 1e-3:  # it stands on an end
            turns = [
                np.array([math.cos(a), math.sin(a), 0.0])
                for a in (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)
            ]
        else:
            turns = [across / length]
        return [
            (axes @ (size[0] * side + np.array([0.0, 0.0, sign * size[1]])), "")
            for side in turns
            for sign in (1.0, -1.0)
        ]
    if geom.kind == "box":
        if geom.name and down[2] < -1.0 + 1e-6:
            return [(-size[2] * axes[:, 2], f"foot({path_of('geom', geom.name)})")]
        corners = [np.array([x, y, z]) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
        return [(axes @ (size * corner), "") for corner in corners]
    return []
