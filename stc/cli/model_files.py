"""What `stc show robot.xml` lists, and the spec that `stc new --model robot.xml` writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stc import models
from stc.errors import UsageError
from stc.language.model.scope import controls_of, coordinates_of, path_of, quoted
from stc.mechanism.mechanism import Geom, Joint, Mechanism
from stc.mechanism.read import read_model
from stc.mechanism.refusals import refusals, without

#: Endings of files that MuJoCo reads as models.
ENDINGS = (".xml", ".urdf", ".mjcf")
#: Places of contact that are this much above the lowest one, in m, stand too.
_LEVEL = 5e-3


def is_model(name: str) -> bool:
    """Whether a name is that of a model file, and not of a spec."""
    return Path(name).suffix.lower() in ENDINGS


def find(name: str) -> Path:
    """A model file, or a bundled model.

    Raises:
        UsageError: there is none.
    """
    if Path(name).is_file():
        return Path(name)
    bundled = models.locate(name)
    if bundled is None:
        raise UsageError(f"there is no model `{name}`", f"bundled ones are {', '.join(models.names())}")
    return bundled


def listing(name: str) -> str:
    """Names, keyframes and sizes of a model, and what of it cannot be stated."""
    path = find(name)
    mechanism = read_model(path)
    lines = [
        f"{path.name}: {len(mechanism.bodies) - 1} bodies, {mechanism.n_freedoms} degrees of freedom, "
        f"{len(mechanism.actuators)} actuators, {sum(body.mass for body in mechanism.bodies):.6g} kg"
    ]
    rows: dict[str, list[str]] = {
        "joints": [f"{path_of('joint', joint.name)} ({_joint(joint)})" for joint in mechanism.joints],
        "actuators": [
            name + (f" in {_range(limits)}" if limits else "")
            for one in mechanism.actuators
            for name, limits in zip(controls_of(one), one.control_ranges, strict=True)
        ],
        "bodies": [path_of("body", body.name) for body in mechanism.bodies[1:]],
        "sites": [path_of("site", site.name) for site in mechanism.sites if site.name],
        "geoms": [f"{path_of('geom', geom.name)} ({geom.kind})" for geom in mechanism.geoms if geom.name],
        "equalities": [path_of("equality", one.name) for one in mechanism.equalities if one.active],
        "poses": [f"keyframe.{quoted(k.name)}" for k in mechanism.keyframes if k.name]
        + ["keyframe.reference"],
    }
    for what, names in rows.items():
        if names:
            lines.append(f"{what}:")
            lines += [f"  {each}" for each in names]
    refused = refusals(mechanism)
    lines.append("cannot be stated:" if refused else "all of it can be stated")
    lines += [f"  {refusal} (or `without {refusal.kind}`)" for refusal in refused]
    return "\n".join(lines)


def _joint(joint: Joint) -> str:
    return f"{joint.kind}, {_range(joint.bounds)}" if joint.limited else joint.kind


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.6g} to {ends[1]:.6g}"


def starter(name: str, title: str, word: str) -> str:
    """A commented spec that holds a model's first pose against its weight, and solves as it stands."""
    path = find(name)
    mechanism = read_model(path)
    left = sorted({refusal.kind for refusal in refusals(mechanism)})
    mechanism = without(mechanism, left)
    poses = [f"keyframe.{quoted(k.name)}" for k in mechanism.keyframes if k.name]
    pose = poses[0] if poses else "keyframe.reference"
    feet = _feet(mechanism)
    floating = any(joint.kind == "free" for joint in mechanism.joints)
    lines = [
        f"# {title}: {path.stem} holds a pose with the least effort.  A page to start from.",
        "#",
        f"#     stc run {word}              solve it, then let MuJoCo replay it",
        f"#     stc show {path.name}        what the model's joints, actuators, sites and poses are called",
        "",
        "constants:",
        "  n = 20,                 # frames are 0, 1, ..., n",
        "  T = 0.5, h = T/n;       # seconds in all, and from one frame to the next",
        "",
        f'model: "{path.name if path.parent == Path() or models.locate(path.name) else path}"'
        + (f" without {', '.join(left)}" if left else "")
        + ";",
        "",
    ]
    if floating and feet:
        lines += ["contact:                  # what touches the floor, and on which frames"]
        lines += [f"  {contact} = {place};" for contact, place in feet]
        lines += [f"  [0, n]: {' '.join(f'{contact};' for contact, _ in feet)}", ""]
    base = f"{pose} grounded" if floating and feet else pose
    lines += ["poses:", f"  begin = {base};", "", "constraints:", "  [0]: begin; rest;"]
    if not floating or feet:
        lines += ["  [n]: begin; rest;          # move it: begin + (0.1, 0, 0), or another pose"]
    lines += ["", "objective:"]
    lines += [f"  [0, n]: integral({'effort' if mechanism.actuators else '0'});"]
    return "\n".join(lines) + "\n"


def _feet(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Places that can stand on the floor in the model's first pose: the lowest spheres and boxes of named geoms."""
    from stc.language import syntax
    from stc.language.model.scope import ModelScope
    from stc.problem import ConstantRef, VariableRef
    from stc.symbolic.expr import evaluate

    scope = ModelScope(syntax.ModelFile(0, 0, ""), Path(), mechanism)
    named = [k for k in mechanism.keyframes if k.name]
    q = named[0].qpos if named else mechanism.start
    known: dict[Any, float] = {ConstantRef(name): value for name, value in scope.constants.items()}
    for joint in mechanism.joints:
        one = coordinates_of(joint)
        known.update({VariableRef(each): q[joint.qpos + k] for k, each in enumerate(one.pose)})
    candidates: list[tuple[float, Geom]] = []
    for index, geom in enumerate(mechanism.geoms):
        frame = scope.dynamics.geoms[index]
        touches = bool(geom.contype or geom.conaffinity)
        if geom.name and frame.segment >= 0 and geom.kind in ("sphere", "box") and touches:
            height = scope.dynamics.kinematics.place_of(frame)[2]
            drop = geom.size[0] if geom.kind == "sphere" else geom.size[2]
            candidates.append((float(evaluate(height, known)) - drop, geom))
    lowest = min((height for height, _ in candidates), default=0.0)
    standing = [geom for height, geom in candidates if height < lowest + _LEVEL]
    return [
        (f"foot{k + 1}", f"{'point' if geom.kind == 'sphere' else 'foot'}({path_of('geom', geom.name)})")
        for k, geom in enumerate(standing)
    ]
