"""The text of a model as MuJoCo compiles it, with the numbers that a spec sets.

MuJoCo's writer keeps six digits.  Numbers that shape the motion are put back with all of them, from the compiled model;
elements of the text come in the order of the model's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mujoco

#: Per element the attributes of its text, and the fields of the compiled model that hold their numbers.
_OF_JOINT = {
    "pos": "jnt_pos",
    "axis": "jnt_axis",
    "range": "jnt_range",
    "actuatorfrcrange": "jnt_actfrcrange",
    "stiffness": "jnt_stiffness",
    "solreflimit": "jnt_solref",
    "solimplimit": "jnt_solimp",
}
_OF_DOF = {"damping": "dof_damping", "armature": "dof_armature", "frictionloss": "dof_frictionloss"}
_OF_COORDINATE = {"ref": "qpos0", "springref": "qpos_spring"}
_OF_GEOM = {
    "pos": "geom_pos",
    "quat": "geom_quat",
    "size": "geom_size",
    "friction": "geom_friction",
    "solref": "geom_solref",
    "solimp": "geom_solimp",
}
_OF_PAIR = {"solref": "pair_solref", "solimp": "pair_solimp"}
_OF_CONSTRAINT = {"solref": "eq_solref", "solimp": "eq_solimp"}
_OF_SITE = {"pos": "site_pos", "quat": "site_quat", "size": "site_size"}
_OF_CAMERA = {"pos": "cam_pos", "quat": "cam_quat"}
_OF_LIGHT = {"pos": "light_pos", "dir": "light_dir"}
_OF_ACTUATOR = {
    "ctrlrange": "actuator_ctrlrange",
    "forcerange": "actuator_forcerange",
    "gear": "actuator_gear",
    "gainprm": "actuator_gainprm",
    "biasprm": "actuator_biasprm",
    "dynprm": "actuator_dynprm",
    "armature": "actuator_armature",
}
_OF_TENDON = {
    "stiffness": "tendon_stiffness",
    "damping": "tendon_damping",
    "range": "tendon_range",
    "springlength": "tendon_lengthspring",
    "armature": "tendon_armature",
    "frictionloss": "tendon_frictionloss",
}
#: The stiffness of contacts and equalities where nothing else is said.
_USUAL = {"solref": (0.02, 1.0), "solimp": (0.9, 0.95, 0.001, 0.5, 2.0)}
#: Attributes, and which numbers of an equality they are.
_OF_EQUALITY = (("polycoef", 0, 5), ("anchor", 0, 3), ("relpose", 3, 10))


def text(values: Any) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def written(description: mujoco.MjSpec, model: mujoco.MjModel) -> ET.Element:
    """A model as MJCF, with the numbers of a compiled one in which some may be others than in the description."""
    root = ET.fromstring(description.to_xml())
    for compiler in root.findall("compiler"):
        compiler.set("angle", "radian")
    option = root.find("option")
    if option is None:
        option = ET.SubElement(root, "option")
    for name in ("gravity", "wind", "density", "viscosity", "impratio"):
        option.set(name, text(getattr(model.opt, name)))
    world = root.find("worldbody")
    if world is not None:
        _without_frames(world)
        for body, element in enumerate(_bodies(world)):
            _set_body(element, model, body)
    for index, element in enumerate(_in_section(root, "actuator")):
        _put(element, model, _OF_ACTUATOR, index)
    for index, element in enumerate(_in_section(root, "tendon")):
        _put(element, model, _OF_TENDON, index)
        for wrap, step in enumerate(element, int(model.tendon_adr[index])):
            if step.tag == "joint":
                step.set("coef", text(model.wrap_prm[wrap]))
    pairs = [element for element in _in_section(root, "contact") if element.tag == "pair"]
    for index, element in enumerate(pairs):
        _put(element, model, _OF_PAIR, index)
    for index, element in enumerate(_in_section(root, "equality")):
        _put(element, model, _OF_CONSTRAINT, index)
        for name, first, last in _OF_EQUALITY:
            if name in element.attrib:
                element.set(name, text(model.eq_data[index, first:last]))
    return root


def _in_section(root: ET.Element, section: str) -> list[ET.Element]:
    """The elements of all sections of a name."""
    return [each for part in root.findall(section) for each in part]


#: What places an element that is placed by a frame.
_PLACED = {
    "geom": {"pos": "0 0 0", "quat": "1 0 0 0"},
    "site": {"pos": "0 0 0", "quat": "1 0 0 0"},
    "camera": {"pos": "0 0 0", "quat": "1 0 0 0"},
    "joint": {"pos": "0 0 0", "axis": "0 0 1"},
    "light": {"pos": "0 0 0", "dir": "0 0 -1"},
}


def _without_frames(element: ET.Element) -> None:
    """Put the elements of frames in the place of these; their own places are those of the compiled model."""
    for index, child in reversed(list(enumerate(element))):
        _without_frames(child)
        if child.tag != "frame":
            continue
        element.remove(child)
        for offset, inner in enumerate(child):
            if "childclass" in child.attrib:
                name = "childclass" if inner.tag in ("body", "frame") else "class"
                inner.attrib.setdefault(name, child.attrib["childclass"])
            for name, value in _PLACED.get(inner.tag, {}).items():
                inner.attrib.setdefault(name, value)
            element.insert(index + offset, inner)


def _bodies(body: ET.Element) -> Iterator[ET.Element]:
    """The world, and all bodies in the order of the model."""
    yield body
    for child in body.findall("body"):
        yield from _bodies(child)


def _set_body(element: ET.Element, model: mujoco.MjModel, body: int) -> None:
    import mujoco

    if body:
        element.set("pos", text(model.body_pos[body]))
        element.set("quat", text(model.body_quat[body]))
        if model.body_gravcomp[body] or "gravcomp" in element.attrib:
            element.set("gravcomp", text(model.body_gravcomp[body]))
        if model.body_mass[body]:
            set_inertia(element, model, body)
    first = int(model.body_jntadr[body])
    joints = [child for child in element if child.tag in ("joint", "freejoint")]
    for joint, child in enumerate(joints, first):
        if child.tag == "joint":
            _put(child, model, _OF_JOINT, joint)
            _put(child, model, _OF_DOF, int(model.jnt_dofadr[joint]))
            _put(child, model, _OF_COORDINATE, int(model.jnt_qposadr[joint]))
            if model.jnt_limited[joint]:
                child.set("limited", "true")
                child.set("range", text(model.jnt_range[joint]))
    for geom, child in enumerate(element.findall("geom"), int(model.body_geomadr[body])):
        _put(child, model, _OF_GEOM, geom)
        if int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_MESH):
            _place_mesh(child, model, geom)
    for tag, bodies, fields in (
        ("site", model.site_bodyid, _OF_SITE),
        ("camera", model.cam_bodyid, _OF_CAMERA),
        ("light", model.light_bodyid, _OF_LIGHT),
    ):
        for index, child in zip(np.flatnonzero(bodies == body).tolist(), element.findall(tag), strict=True):
            _put(child, model, fields, index)


def _place_mesh(element: ET.Element, model: mujoco.MjModel, geom: int) -> None:
    """Place the geom of a mesh: compiled, it is where the mesh has its centre and its principal axes."""
    import mujoco

    mesh = int(model.geom_dataid[geom])
    back, turn, moved = np.zeros(4), np.zeros(4), np.zeros(3)
    mujoco.mju_negQuat(back, model.mesh_quat[mesh])
    mujoco.mju_mulQuat(turn, model.geom_quat[geom], back)
    mujoco.mju_rotVecQuat(moved, model.mesh_pos[mesh], turn)
    element.set("pos", text(model.geom_pos[geom] - moved))
    element.set("quat", text(turn))


def set_inertia(element: ET.Element, model: mujoco.MjModel, body: int) -> None:
    """State mass, centre of mass and inertia of a body in its element."""
    inertial = element.find("inertial")
    if inertial is None:
        inertial = ET.Element("inertial")
        element.insert(0, inertial)
    inertial.attrib.clear()
    inertial.set("pos", text(model.body_ipos[body]))
    inertial.set("quat", text(model.body_iquat[body]))
    inertial.set("mass", text(model.body_mass[body]))
    inertial.set("diaginertia", text(model.body_inertia[body]))


def _put(element: ET.Element, model: mujoco.MjModel, fields: dict[str, str], index: int) -> None:
    """Write the numbers of a compiled model into the attributes of an element, so that its file states them.

    ``fields`` has the field of the model for each attribute.  An attribute that the element lacks is added where a spec
    may set its value and the value is not the one that MuJoCo takes without it.
    """
    for name, field in fields.items():
        said: Sequence[str] = element.get(name, "").split()
        values = np.atleast_1d(getattr(model, field)[index])
        if said:
            kept = said[len(values) :]  # such as the higher terms of a damping
            element.set(name, " ".join([text(values[: len(said)]), *kept]))
        elif (name in _OF_DOF or name == "stiffness") and values[0]:
            element.set(name, text(values[:1]))
        elif name in ("springref", "gear", "friction") or (name == "pos" and "fromto" not in element.attrib):
            element.set(name, text(values))
        elif name in _USUAL and not np.array_equal(values, _USUAL[name]):
            element.set(name, text(values))
