"""From a model file, MJCF or URDF, to what MuJoCo compiles, with what a spec adds to it.

A URDF says what a robot is made of, and not where it stands or what drives it: the words of :data:`ADDITIONS` add that.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.urdf import Mesh, is_urdf, mimics, prepared, text_vertices, without_comments

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, slots=True)
class Opened:
    """A model that MuJoCo has read.

    Attributes:
        spec: its description, which may be changed and compiled again.
        model: compiled.
        told: MuJoCo's warnings while it compiled the model.
        changes: what of a URDF is left out or changed to make a model of it, each in a sentence; shapes that are only
            to be seen are left out without a word.
    """

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    told: tuple[str, ...]
    changes: tuple[str, ...]


def opened(source: str | os.PathLike[str], additions: Sequence[str] = (), text: str | None = None) -> Opened:
    """Read and compile a model.

    Parameters
    ----------
    source
        The path of an MJCF or URDF file.
    additions
        Words of :data:`ADDITIONS`.
    text
        The content, where it is not to be read from the file.

    Raises
    ------
    ValueError
        MuJoCo does not accept it, or the mesh of a link whose mass is computed from it is not there.
    OSError
        There is no such file.
    """
    import mujoco

    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)  # they would go to a file ``MUJOCO_LOG.TXT``
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            spec, changes = _described(source, text)
            for word in ADDITIONS:
                if word in additions:
                    ADDITIONS[word][1](spec)
            model = spec.compile()
    finally:
        mujoco.set_mju_user_warning(before)
    said += [str(warning.message) for warning in caught]
    told = tuple(dict.fromkeys([" ".join(each.split()) for each in said]))
    return Opened(spec, model, told, tuple(changes))


def _described(source: str | os.PathLike[str], text: str | None) -> tuple[mujoco.MjSpec, list[str]]:
    """The description of a model, and what of it is left out or changed."""
    import mujoco

    content = text if text is not None else _content(source)
    if content is None or not is_urdf(source, content):
        if text is None:
            return mujoco.MjSpec.from_file(os.fsencode(source)), []
        return mujoco.MjSpec.from_string(text), []
    content = without_comments(content)
    if re.search(r"""<xacro:|=\s*["'][^"']*\$[({]""", content):
        raise ValueError(
            "it has macros, which the program `xacro` writes out: `xacro robot.xacro > robot.urdf`"
        )
    try:
        return _robot(content, Path(source).parent)
    except ValueError:  # it may be due to the content of a mesh, and to look into all takes time
        return _robot(content, Path(source).parent, decode=True)


def _robot(content: str, folder: Path, decode: bool = False) -> tuple[mujoco.MjSpec, list[str]]:
    """The description of a URDF, and what of it is left out or changed.

    Parameters
    ----------
    decode
        Whether to look into each mesh for whether MuJoCo reads it.
    """
    import mujoco

    named, meshes = prepared(content, folder)
    spec = mujoco.MjSpec.from_string(named)
    changes = [
        *_find_meshes(spec, meshes, decode),
        *_without_size(spec),
        *_possible_inertias(spec),
        *_weighed(spec),
    ]
    _join_joints(spec)
    _tie_followers(spec, content)
    _let_overlap(spec)
    return spec, changes


def _content(source: str | os.PathLike[str]) -> str | None:
    """The text of a file; None where it has none."""
    try:
        return Path(source).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None


# ------------------------------------------------------------------------------------------------------- of a URDF


#: Endings of meshes that MuJoCo reads.
_READ = (".stl", ".obj", ".msh")

#: A link of less than this has no mass, in kg; and with less than this about an axis, in kg m^2, MuJoCo takes none.
_NO_MASS, _NO_INERTIA = 1e-10, 1e-13

#: The least principal moment of inertia that a link is given, as a share of its largest.
_LEAST = 1e-6


def _find_meshes(spec: mujoco.MjSpec, meshes: dict[str, Mesh], decode: bool) -> list[str]:
    """Tell a description where its meshes lie, and leave out what cannot be had.

    A shape that is only to be seen may be missing, and so may one that is to be touched where the URDF states the
    inertia of its link.

    Returns
    -------
    list of str
        The shapes to be touched that are left out.

    Raises
    ------
    ValueError
        The mass of a link is computed from what cannot be had.
    """
    import mujoco

    left, weighed = [], set()
    bad = {name: why for name, mesh in meshes.items() if (why := _unreadable(mesh, decode))}
    for body in spec.bodies:
        # The reader marks inertias that a URDF leaves open, or has as zeros.
        stated = body.explicitinertial and not math.isnan(body.fullinertia[0])
        seen = False
        for geom in list(body.geoms):
            looks = not (geom.contype or geom.conaffinity)
            mesh = geom.meshname if geom.type == mujoco.mjtGeom.mjGEOM_MESH else ""
            if not looks and not stated:
                weighed.add(mesh)
            if mesh not in bad:
                seen |= looks
                continue
            why = f'its mesh "{meshes[mesh].written}" (line {meshes[mesh].line}) {bad[mesh]}'
            if mesh in weighed:
                raise ValueError(
                    f'the mass of the link "{body.name}" is computed from its shapes, and {why}: put the file there, '
                    "or give the link an <inertial>"
                )
            if not looks:
                left.append(f'a shape of the link "{body.name}" touches nothing, as {why}')
            spec.delete(geom)
        if seen:  # what stands for a link in contacts need not be seen besides
            for geom in body.geoms:
                geom.group = 3 if geom.contype or geom.conaffinity else geom.group
    for one in list(spec.meshes):
        if one.name in bad:
            spec.delete(one)
        elif one.name in meshes:
            _load(one, meshes[one.name])
            if one.name not in weighed:  # as a shell it may be open, flat or inside out
                one.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return left


def _unreadable(mesh: Mesh, decode: bool) -> str:
    """Why MuJoCo does not read a mesh; "" where it does."""
    if mesh.file is None:
        return "is not there"
    if mesh.file.suffix.lower() not in _READ:
        return f"is no {', '.join(_READ[:-1])} or {_READ[-1]} file"
    if decode:
        import mujoco

        alone = mujoco.MjSpec()
        _load(alone.add_mesh(name="mesh", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL), mesh)
        try:
            alone.compile()
        except ValueError as error:
            return f"is not read by MuJoCo ({' '.join(str(error).split())})"
    return ""


def _load(element: mujoco.MjsMesh, mesh: Mesh) -> None:
    """Tell an element where its mesh lies; one in an STL file of text, which MuJoCo does not read, is put into it."""
    assert mesh.file is not None
    vertices = text_vertices(mesh.file)
    if vertices is None:
        element.file = str(mesh.file)
    else:
        element.file = ""
        element.uservert, element.userface = vertices, list(range(len(vertices) // 3))


def _without_size(spec: mujoco.MjSpec) -> list[str]:
    """Leave out shapes of no size, which MuJoCo refuses, and tell of those that are to be touched."""
    import mujoco

    kinds, left = mujoco.mjtGeom, set[str]()
    sizes = {kinds.mjGEOM_SPHERE: 1, kinds.mjGEOM_CYLINDER: 2, kinds.mjGEOM_CAPSULE: 2, kinds.mjGEOM_BOX: 3}
    for geom in list(spec.geoms):
        if geom.type in sizes and not np.all(geom.size[: sizes[geom.type]] > 0.0):
            if geom.contype or geom.conaffinity:
                left.add(geom.parent.name)
            spec.delete(geom)
    return [f'a shape of the link "{link}" has no size' for link in sorted(left)]


def _weighed(spec: mujoco.MjSpec) -> list[str]:
    """Give moving links with a mass and no inertia that of their shapes, of even density, about the centre of mass.

    Some programs take only the mass from a URDF, and people who write for these put zeros.
    """
    import mujoco

    bodies = [
        body
        for body in spec.bodies
        if body.explicitinertial
        and body.mass > 0.0
        and math.isnan(body.fullinertia[0])
        and (body.joints or body.parent.name == "world")
    ]
    if not bodies:
        return []
    probe = spec.copy()
    for joint in list(probe.joints):
        probe.delete(joint)
    probe.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    model, told = probe.compile(), []
    for body in bodies:
        index = probe.body(body.name).id
        share = body.mass / max(float(model.body_mass[index]), _NO_MASS)
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[index])
        made = share * axes.reshape(3, 3) @ np.diag(model.body_inertia[index]) @ axes.reshape(3, 3).T
        if model.body_mass[index] > _NO_MASS:
            body.fullinertia = made[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            told.append(f'the link "{body.name}" has a mass and no inertia: it gets that of its shapes')
    return told


def _possible_inertias(spec: mujoco.MjSpec) -> list[str]:
    """Replace inertias that no rigid body can have, and that MuJoCo refuses, by the nearest possible ones.

    URDFs contain them because numbers were rounded, for links without a body, and by mistake.

    Returns
    -------
    list of str
        The links whose inertia is changed.
    """
    changed = []
    for body in spec.bodies:
        if not body.explicitinertial or math.isnan(body.fullinertia[0]):
            continue
        xx, yy, zz, xy, xz, yz = body.fullinertia
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        possible = np.maximum(moments, max(_LEAST * moments[2], _NO_INERTIA))
        excess = possible[2] - possible[0] - possible[1]
        if excess > 0.0:  # the nearest moments of which none is larger than the sum of the others
            possible += (1.0 + 1e-6) * excess / 3.0 * np.array([1.0, 1.0, -1.0])
        if moments[2] <= 0.0 or np.array_equal(possible, moments):
            continue
        made = axes @ np.diag(possible) @ axes.T
        body.fullinertia = made[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        off = np.abs(possible - moments).max() / moments[2]
        changed.append(
            f'no body has the inertia of the link "{body.name}": its moments are changed by {off:.1g}'
        )
    return changed


#: Time and damping ratio of MuJoCo's springs in a gear, and how near to rigid they are.
_STIFF = (0.005, 1.0), (0.999, 0.9999, 0.001)


def _tie_followers(spec: mujoco.MjSpec, text: str) -> None:
    """Tie joints that follow others (``<mimic>``) to them; what follows one that is fixed is fixed as well."""
    import mujoco

    joints = {joint.name for joint in spec.joints}
    for mimic in mimics(text):
        if mimic.joint in joints:
            tie = spec.add_equality(
                name=mimic.joint,
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=mimic.joint,
                name2=mimic.source if mimic.source in joints else "",
            )
            tie.data = [mimic.offset, mimic.multiplier, *[0.0] * (len(tie.data) - 2)]
            tie.solref[:2], tie.solimp[:3] = _STIFF  # a gear hardly gives way


#: What a URDF says of a joint.
_OF_JOINT = ("name", "type", "pos", "axis", "range", "limited", "damping", "frictionloss", "actfrcrange")


def _join_joints(spec: mujoco.MjSpec) -> None:
    """Move the joints of links without mass that carry one link only to that link.

    A URDF has one joint for each link, and links that stand for nothing between the joints of a shoulder or of a base
    that moves in the plane.  MuJoCo has no moving bodies without mass, and several joints of one body.
    """
    import mujoco

    for body in spec.bodies:
        carried, joints = list(body.bodies), list(body.joints)
        weighs = body.mass > 0.0 or any(geom.contype or geom.conaffinity for geom in body.geoms)
        if weighs or not joints or len(carried) != 1 or not carried[0].joints:
            continue
        inner = carried[0]
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, inner.quat)
        kept = [
            {each: np.copy(getattr(joint, each)) for each in _OF_JOINT} for joint in (*joints, *inner.joints)
        ]
        for index, old in enumerate([*joints, *inner.joints]):
            if index < len(joints):
                kept[index]["axis"] = turn.reshape(3, 3).T @ old.axis
                kept[index]["pos"] = turn.reshape(3, 3).T @ (old.pos - inner.pos)
            spec.delete(old)
        for values in kept:
            joint = inner.add_joint()
            for each, value in values.items():
                setattr(joint, each, value if value.shape else value.item())


def _let_overlap(spec: mujoco.MjSpec) -> None:
    """Let bodies of one robot not touch that overlap in the pose that the file draws.

    Shapes are often as coarse as a planner may have them, and which of them may overlap stands in other files.  Bodies
    are of one robot where joints or equality constraints join them; the world and other objects are touched as before.
    """
    import mujoco

    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    robot = model.body_rootid.copy()
    for kind, *ends in zip(model.eq_objtype, model.eq_obj1id, model.eq_obj2id, strict=True):
        if kind == mujoco.mjtObj.mjOBJ_SITE:
            ends = [model.site_bodyid[end] for end in ends]
        elif kind != mujoco.mjtObj.mjOBJ_BODY:
            continue
        first, second = robot[ends]
        if first and second:
            robot[robot == second] = first
    pairs = {tuple(sorted(model.geom_bodyid[one.geom].tolist())) for one in data.contact if one.dist < 0.0}
    bodies = {body.id: body for body in spec.bodies}
    for pair in sorted(pairs):
        if pair[0] and robot[pair[0]] == robot[pair[1]]:
            for body in (bodies[each] for each in pair if not bodies[each].name):
                body.name = _free_name("body", [each.name for each in spec.bodies])
            spec.add_exclude(bodyname1=bodies[pair[0]].name, bodyname2=bodies[pair[1]].name)


# ------------------------------------------------------------------------------------------------- what specs add


def _free_roots(spec: mujoco.MjSpec) -> None:
    """A free joint for each body that is fixed to the world and carries joints; for all where none does."""
    fixed = [body for body in spec.worldbody.bodies if not body.joints]
    for body in [body for body in fixed if _carries_joints(body)] or fixed:
        body.add_freejoint()


def _carries_joints(body: mujoco.MjsBody) -> bool:
    return any(each.joints or _carries_joints(each) for each in body.bodies)


def _add_motors(spec: mujoco.MjSpec) -> None:
    """A motor for each hinge and slide that nothing drives and that follows no other, as strong as its joint allows."""
    import mujoco

    driven = {actuator.target for actuator in spec.actuators}
    driven |= {each.name1 for each in spec.equalities if each.type == mujoco.mjtEq.mjEQ_JOINT and each.name2}
    for joint in spec.joints:
        if joint.type not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            continue
        joint.name = joint.name or _free_name(
            joint.parent.name or "joint", [each.name for each in spec.joints]
        )
        if joint.name in driven:
            continue
        motor = spec.add_actuator(
            name=_free_name(joint.name, [each.name for each in spec.actuators]),
            target=joint.name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
        )
        low, high = joint.actfrcrange
        if low < high:
            motor.ctrlrange, motor.ctrllimited = (low, high), mujoco.mjtLimited.mjLIMITED_TRUE
            joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE  # the motor is the one that has the limit


def _add_floor(spec: mujoco.MjSpec) -> None:
    """The plane z = 0, where nothing of the world is a plane already."""
    import mujoco

    if any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in spec.worldbody.geoms):
        return
    spec.worldbody.add_geom(
        name=_free_name("floor", [geom.name for geom in spec.geoms]),
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0.0, 0.0, 0.05),
        rgba=(0.82, 0.83, 0.85, 1.0),
    )


def _release(spec: mujoco.MjSpec) -> None:
    """No weld or connect to a mocap body, which is fixed in the world until a program moves it."""
    import mujoco

    sites = {site.name: site.parent for site in spec.sites}
    bodies = {body.name: body for body in spec.bodies}
    for equality in list(spec.equalities):
        if equality.type in (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT):
            known = sites if equality.objtype == mujoco.mjtObj.mjOBJ_SITE else bodies
            ends = [known[name] for name in (equality.name1, equality.name2) if name in known]
            if any(body.mocap for body in ends):
                spec.delete(equality)


def _free_name(wanted: str, taken: Iterable[str]) -> str:
    known, name, number = set(taken), wanted, 1
    while name in known:
        number += 1
        name = f"{wanted}_{number}"
    return name


#: The words by which a spec adds to a model, what each stands for, and what does it.
ADDITIONS: dict[str, tuple[str, Callable[[mujoco.MjSpec], None]]] = {
    "excludes": (
        "no contact between bodies of a robot that overlap in the pose that the file draws",
        _let_overlap,
    ),
    "freejoint": ("free joints for bodies that are fixed to the world and carry joints", _free_roots),
    "motors": ("a motor for each hinge and slide that nothing drives", _add_motors),
    "floor": ("the plane z = 0, where there is none", _add_floor),
    "mocap": (
        "mocap bodies where what is welded to them is at the first frame, as a program that moves them begins",
        lambda _: None,  # the equations and the replay see to it
    ),
    "release": (
        "no weld or connect to mocap bodies, which stay where they are until a program moves them",
        _release,
    ),
}
