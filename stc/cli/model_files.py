"""The listing of `stc show robot.xml`."""

from __future__ import annotations

from pathlib import Path

from stc import models
from stc.errors import UsageError
from stc.language.model.scope import controls_of, path_of, quoted
from stc.mechanism.mechanism import Joint
from stc.mechanism.read import read_model
from stc.mechanism.refusals import refusals

#: Endings of files that MuJoCo reads as models.
ENDINGS = (".xml", ".urdf", ".mjcf")


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
    """Names, keyframes and sizes of a model, and its unsupported elements."""
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
    if mechanism.is_urdf:
        lines += [
            "a URDF states neither motors nor whether its root is free: here it is fixed to the world. A spec adds",
            f'these, and a floor, by words: model: "{path.name}" with freejoint, motors, floor;',
        ]
        lines += [f"left out or changed: {change}" for change in mechanism.changes]
    overlap, fate = mechanism.excluded, "do not touch"
    if not mechanism.is_urdf:
        overlap = tuple(set(read_model(path, additions=("excludes",)).excluded) - set(overlap))
        fate = "MuJoCo pushes them apart, unless a spec has `with excludes`"
    if overlap:
        pairs = [" and ".join(mechanism.bodies[body].name for body in pair) for pair in sorted(overlap)]
        lines.append(f"these overlap in the pose that the file draws, and {fate}: {'; '.join(pairs)}")
    lines += [f"warning: {doubt}" for doubt in mechanism.warnings]
    lines += [
        f"tendon {one.name} is {_range(one.bounds)} long: a bound of the motion, which does not pull as a rope does"
        for one in mechanism.tendons
        if one.limited
    ]
    for one in filter(mechanism.welded_to_mocap, mechanism.equalities):
        first, second = (path_of("body", mechanism.bodies[body].name) for body in (one.first, one.second))
        lines += [
            f"{path_of('equality', one.name)} welds {first} and {second} to each other, of which one is a mocap body.",
            "it is where the file draws it; `with mocap`: where the motion begins; `with release`: no such weld",
        ]
    refused = refusals(mechanism)
    lines.append("cannot be stated:" if refused else "every element of the model is supported")
    lines += [f"  {refusal} (or `without {refusal.kind}`)" for refusal in refused]
    return "\n".join(lines)


def _joint(joint: Joint) -> str:
    return f"{joint.kind}, {_range(joint.bounds)}" if joint.limited else joint.kind


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.6g} to {ends[1]:.6g}"
