"""The model of a motion as MJCF with a keyframe per frame, including the fields that the spec sets.

Numbers are inserted into the model's own text with all their digits; MuJoCo's writer would keep six.  URDFs, and models
of which the spec or the file itself makes parts, have no such text (:mod:`stc.validate.export.writing`).
Included files become part of the text, and the assets are copied beside it, so that file and folder can be moved.
The written file is read back and compared with the model of the validation.
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.arguments import same_file, spare
from stc.atomic import replacing
from stc.urdf import is_urdf
from stc.validate.export.controls import steps
from stc.validate.export.writing import set_inertia, text, written
from stc.validate.model import ModelError, load_model, model_files
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

#: Elements that make others, which are not in the text.
_MADE = ("replicate", "attach")

#: Fields of a compiled model that must come back as they were, up to rounding.
_COMPARED = (
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_pos",
    "body_quat",
    "jnt_pos",
    "jnt_axis",
    "body_gravcomp",
    "dof_damping",
    "dof_armature",
    "dof_frictionloss",
    "jnt_limited",
    "jnt_range",
    "jnt_stiffness",
    "qpos_spring",
    "geom_friction",
    "actuator_gear",
    "actuator_gainprm",
    "actuator_biasprm",
    "actuator_ctrlrange",
    "wrap_prm",
)


def write(setup: Setup, path: Path, time_step: float | None = None) -> None:
    """Write the model with its keyframes.

    Args:
        setup: the motion and its model.
        path: the file; assets are written to a folder beside it.
        time_step: longest time step, in seconds; the file asks for the one that the control sequence has.

    Raises:
        ModelError: the model's text cannot hold the fields that the spec sets.
        UsageError: a copy of an asset would overwrite another file of the model.
    """
    content = setup.path.read_text(encoding="utf-8", errors="replace")
    own = not setup.solution.additions and not is_urdf(setup.path, content)
    if own:
        root = ET.parse(setup.path).getroot()
        _include(root, setup.path.parent)
        own = not any(element.tag in _MADE for element in root.iter())
    if not own:
        root = written(setup.description(), setup.compiled)
    assets = path.with_name(f"{path.stem}_assets")
    with _whole_or_not(assets):
        _collect_assets(root, setup.path, assets)
        if own:
            _set_fields(root, setup)
        option = _child(root, "option")
        option.set("timestep", repr(steps(setup, time_step)[1]))
        for old in root.findall("keyframe"):
            root.remove(old)
        root.append(_keyframes(setup))
        ET.indent(root)
        with replacing(path) as temporary:
            temporary.write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
            _check(load_model(temporary), setup, path)


@contextmanager
def _whole_or_not(folder: Path) -> Iterator[None]:
    """A context for filling a folder: if it fails, files that did not exist before are removed."""
    before = set(folder.iterdir()) if folder.is_dir() else None
    try:
        yield
    except BaseException:
        if folder.is_dir():
            for new in set(folder.iterdir()) - (before or set()):
                new.unlink()
            if before is None:
                folder.rmdir()
        raise


def _keyframes(setup: Setup) -> ET.Element:
    """One key per frame: time, positions, velocities, controls."""
    solution = setup.solution
    made = ET.Element("keyframe")
    for frame in range(solution.n + 1):
        part = "after" if frame < solution.n else "before"
        position, velocity = setup.reference.at(part, frame)[:2]
        qpos, qvel = np.array(setup.compiled.qpos0), np.zeros(setup.compiled.nv)
        qpos[setup.reference.positions], qvel[setup.reference.velocities] = position, velocity
        ctrl = np.zeros(setup.compiled.nu)
        ctrl[setup.controls.addresses] = setup.controls.at(part, frame)
        key = ET.SubElement(made, "key", name=f"frame{frame}", time=repr(float(solution.time[frame])))
        act = np.zeros(setup.compiled.na)
        act[setup.activations.addresses] = setup.activations.at(part, frame)
        for name, values in (("qpos", qpos), ("qvel", qvel), ("act", act), ("ctrl", ctrl)):
            if len(values):
                key.set(name, text(values))
    return made


def _child(parent: ET.Element, tag: str) -> ET.Element:
    """The last child with a tag, which is the one that MJCF uses; a new one if there is none."""
    found = parent.findall(tag)
    return found[-1] if found else ET.SubElement(parent, tag)


def _include(element: ET.Element, folder: Path) -> None:
    """Replace include elements by the contents of the included files."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag == "include":
            inner = ET.parse(folder / child.get("file", "")).getroot()
            element.remove(child)
            for offset, grandchild in enumerate(inner):
                element.insert(index + offset, grandchild)
    if any(child.tag == "include" for child in element):
        _include(element, folder)
    for child in element:
        _include(child, folder)


def _collect_assets(root: ET.Element, model: Path, folder: Path) -> None:
    """Copy the files that the model names into one folder, and name them there."""
    folders = dict.fromkeys(("meshdir", "texturedir"), "")
    for compiler in root.findall("compiler"):
        shared = compiler.attrib.pop("assetdir", None)
        for name in folders:
            folders[name] = compiler.attrib.pop(name, shared if shared is not None else folders[name])
        compiler.attrib.pop("strippath", None)
    files = [e for e in root.iter() if "file" in e.attrib]
    copies: dict[Path, Path] = {}
    inputs = model_files(model)
    for element in files:
        if element.tag not in ("mesh", "texture", "hfield", "skin"):
            raise ModelError(
                f"{model.name}: a model with <{element.tag} file=...> cannot be exported as keyframes"
            )
        directory = folders["texturedir" if element.tag == "texture" else "meshdir"]
        source = model.parent / directory / element.attrib["file"]
        if not element.get("name"):
            element.set("name", source.stem)
        folder.mkdir(parents=True, exist_ok=True)
        if source not in copies:  # files of one name may come from several folders
            taken = {copy.name for copy in copies.values()}
            numbered = (f"{source.stem}_{k}{source.suffix}" for k in itertools.count(2))
            copies[source] = folder / next(
                n for n in itertools.chain([source.name], numbered) if n not in taken
            )
        copy = copies[source]
        spare(copy, [(other, "a file of the model") for other in inputs if not same_file(other, source)])
        with replacing(copy) as temporary:  # a full disk is told of with the copy's name
            temporary.write_bytes(source.read_bytes())
        element.set("file", f"{folder.name}/{copy.name}")


# ------------------------------------------------------------------------------------------- what the spec set


def _set_fields(root: ET.Element, setup: Setup) -> None:
    """Put the values of the spec's ``set`` lines into the text."""
    model = setup.compiled
    degrees = all(c.get("angle", "degree") == "degree" for c in root.findall("compiler"))
    for path in setup.fields:
        kind, name, *_ = path.split(".")
        if kind == "option":
            value = getattr(model.opt, name)
            _child(root, "option").set(name, text(np.asarray(value, dtype=float)))
        elif kind == "body":
            _set_body(root, model, name)
        elif kind == "joint":
            _set_joint(root, model, name, path.split(".")[2], degrees)
        elif kind == "geom":
            _named(root, "geom", name).set("friction", text(model.geom_friction[model.geom(name).id]))
        elif kind == "actuator":
            _actuator(root, name).set("gear", text(model.actuator_gear[model.actuator(name).id]))


def _set_body(root: ET.Element, model: mujoco.MjModel, name: str) -> None:
    element, body = _named(root, "body", name), int(model.body(name).id)
    element.set("pos", text(model.body_pos[body]))
    if model.body_gravcomp[body] or element.get("gravcomp"):
        element.set("gravcomp", text(model.body_gravcomp[body]))
    set_inertia(element, model, body)


def _set_joint(root: ET.Element, model: mujoco.MjModel, name: str, field: str, degrees: bool) -> None:
    import mujoco

    element, index = _named(root, "joint", name), int(model.joint(name).id)
    hinge = int(model.jnt_type[index]) == int(mujoco.mjtJoint.mjJNT_HINGE)
    scale = math.degrees(1.0) if degrees and hinge else 1.0
    if field in ("lower", "upper"):
        element.set("limited", "true")
        element.set("range", text(scale * model.jnt_range[index]))
    elif field == "springref":
        element.set("springref", text(scale * model.qpos_spring[model.jnt_qposadr[index]]))
    elif field == "stiffness":
        element.set("stiffness", text(model.jnt_stiffness[index]))
    else:
        element.set(field, text(getattr(model, f"dof_{field}")[model.jnt_dofadr[index]]))


def _named(root: ET.Element, tag: str, name: str) -> ET.Element:
    for element in root.iter(tag):
        if element.get("name") == name:
            return element
    raise ModelError(
        f"the model's text has no {tag} {name}, whose numbers the spec sets: it cannot be exported"
    )


def _actuator(root: ET.Element, name: str) -> ET.Element:
    found: Iterator[ET.Element] = (
        e for part in root.findall("actuator") for e in part if e.get("name") == name
    )
    element = next(found, None)
    if element is None:
        raise ModelError(
            f"the model's text has no actuator {name}, whose numbers the spec sets: it cannot be exported"
        )
    return element


def _check(written: mujoco.MjModel, setup: Setup, path: Path) -> None:
    """Compare the written model with the model of the motion."""
    wanted = setup.compiled
    for name in _COMPARED:
        a, b = np.asarray(getattr(written, name)), np.asarray(getattr(wanted, name))
        scale = float(np.abs(b).max(initial=0.0)) or 1.0
        if a.shape != b.shape or not np.allclose(a, b, rtol=1e-9, atol=1e-12 * scale):
            raise ModelError(
                f"{path}: the model that was written differs in {name} from the one of the motion"
            )
    if not np.allclose(written.opt.gravity, wanted.opt.gravity, rtol=1e-12, atol=0.0):
        raise ModelError(
            f"{path}: the model that was written differs in its gravity from the one of the motion"
        )
