"""The model of a motion as MJCF with a keyframe per frame, including the fields that the spec sets.

Numbers have all their digits (:mod:`stc.validate.export.writing`).  Included files become part of the text, and the
assets are copied beside it, so that file and folder can be moved.  The written file is read back and compared with the
model of the validation.
"""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.arguments import same_file, spare
from stc.atomic import replacing
from stc.validate.export.controls import steps
from stc.validate.export.writing import text, written
from stc.validate.model import ModelError, load_model, model_files
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

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
    root = written(setup.description(), setup.compiled)
    assets = path.with_name(f"{path.stem}_assets")
    with _whole_or_not(assets):
        _collect_assets(root, setup.path, assets)
        for option in root.findall("option"):
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


def _check(written: mujoco.MjModel, setup: Setup, path: Path) -> None:
    """Compare the written model with the model of the motion."""
    wanted = setup.compiled
    for name in _COMPARED:
        a, b = np.asarray(getattr(written, name)), np.asarray(getattr(wanted, name))
        if name == "body_ipos" and a.shape == b.shape:  # where nothing weighs no place of it counts
            a, b = (values[wanted.body_mass > 0.0] for values in (a, b))
        scale = float(np.abs(b).max(initial=0.0)) or 1.0
        if a.shape != b.shape or not np.allclose(a, b, rtol=1e-9, atol=1e-12 * scale):
            raise ModelError(
                f"{path}: the model that was written differs in {name} from the one of the motion"
            )
    if not np.allclose(written.opt.gravity, wanted.opt.gravity, rtol=1e-12, atol=0.0):
        raise ModelError(
            f"{path}: the model that was written differs in its gravity from the one of the motion"
        )
