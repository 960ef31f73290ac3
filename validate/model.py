"""The MuJoCo model of a solution: find the file, and find in it the elements that the spec names."""

from __future__ import annotations

import difflib
import hashlib
import importlib
import itertools
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc import models
from stc.errors import StcError
from stc.model_source import opened
from stc.solution import ReplayChannel, Solution
from stc.urdf import mesh_files
from stc.validate.switches import take_out

if TYPE_CHECKING:
    import mujoco


class ModelError(StcError):
    """There is no model file, or a ``replay:`` line does not fit it."""


def find_model(name: str, folders: Iterable[str | Path]) -> Path:
    """The file of a model: an absolute path, a file in one of the folders, or a bundled model.

    Raises:
        ModelError: there is none.
    """
    tried = [Path(folder) for folder in folders if str(folder)]
    if Path(name).is_absolute():
        if Path(name).is_file():
            return Path(name)
        raise ModelError(f"there is no model {name}")
    for folder in tried:
        if (folder / name).is_file():
            return folder / name
    bundled = models.locate(name)
    if bundled is not None:
        return bundled
    places = [f"in {folder}" for folder in dict.fromkeys(tried)] + ["among the bundled models"]
    beside = [path.name for folder in tried for path in sorted(folder.glob("*.xml"))]
    # A misspelt file that lies beside the spec is likelier to be meant than a bundled one.
    known = nearest(name, beside) if difflib.get_close_matches(name, beside, n=1) else ""
    known = known or nearest(name, [*beside, *models.names()])
    raise ModelError(f"there is no model {name}: looked {' and '.join(places)}{known}")


def require_mujoco() -> None:
    """Import MuJoCo, which looks for OpenGL on import; without OpenGL if there is none.

    ``MUJOCO_GL`` may name a library that does not exist; then only pictures fail, with a message when they are
    requested.

    Raises:
        ModelError: it cannot be imported.
    """
    try:
        importlib.import_module("mujoco")
    except Exception as error:
        behind: BaseException | None = error
        while behind is not None:
            if isinstance(behind, KeyboardInterrupt):  # compiled modules make a failure of their own of it
                raise KeyboardInterrupt from None
            behind = behind.__cause__ or behind.__context__
        asked = os.environ.get("MUJOCO_GL")
        why = f"MuJoCo cannot be imported ({' '.join(str(error).split())})"
        if asked is None:
            raise ModelError(why) from error
        os.environ["MUJOCO_GL"] = "off"
        try:
            importlib.import_module("mujoco")
        except Exception:
            raise ModelError(f"{why}; MUJOCO_GL={asked} may be the reason") from error
        finally:
            os.environ["MUJOCO_GL"] = asked


def load_model(path: Path, additions: Sequence[str] = ()) -> mujoco.MjModel:
    """Compile a model file.

    Args:
        path: of the file.
        additions: what is added to it, in words of :data:`stc.model_source.ADDITIONS`.

    Raises:
        ModelError: MuJoCo does not accept it (the message includes MuJoCo's own); or it takes too much time or
            memory.
    """
    require_mujoco()
    import mujoco

    from stc.validate.ordinary import refusal

    if why := refusal(path):
        raise ModelError(f"MuJoCo does not accept {path}: {why}")
    try:
        model = opened(path, additions).model
    except (ValueError, OSError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        text = " ".join(str(error).split())
        raise ModelError(f"MuJoCo does not accept {path}: {text}") from None
    take_out(model)
    return model


def as_bytes(path: str | os.PathLike[str]) -> str:
    """A path in the form that MuJoCo accepts, whatever characters the locale has.

    MuJoCo's functions encode text, and refuse names with characters that the locale does not have; bytes are passed on.
    """
    return os.fsencode(path)  # type: ignore[return-value]


def model_files(path: Path) -> list[Path]:
    """All files that form a model: its own, included files, meshes, textures.

    Args:
        path: of a model that MuJoCo accepts.
    """
    require_mujoco()
    import mujoco

    if path.suffix.lower() == ".urdf":
        return sorted({path, *mesh_files(path)})
    try:
        names = mujoco.mju_getXMLDependencies(as_bytes(path))
    except UnicodeDecodeError:  # names that are no UTF-8
        return [path]
    return sorted({path, *(Path(os.fsdecode(name.encode())) for name in names)})


def model_inputs(path: Path) -> list[tuple[Path, str]]:
    """The files of a model, each with its description, for :func:`stc.arguments.spare`."""
    return [
        (file, f"the model {path.name}" if file == path else f"a file of the model {path.name}")
        for file in model_files(path)
    ]


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def nearest(name: str, known: Sequence[str]) -> str:
    """The end of a message about an unknown name: the closest name, or all names if there are few."""
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean {close[0]}?"
    if known:
        return f"; known: {', '.join(known[:12])}" + (", ..." if len(known) > 12 else "")
    return ""


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """The names of all joints, actuators, bodies, cameras, geoms, sites or sensors that have a name."""
    import mujoco

    object_type = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    found = (mujoco.mj_id2name(model, object_type, index) for index in range(_count(model, kind)))
    return [name for name in found if name]


def body_names(model: mujoco.MjModel) -> list[str]:
    """The name of each body in the model's order, or its number if it has no name."""
    return _called(model, "body", [f"body{body}" for body in range(model.nbody)])


def joint_names(model: mujoco.MjModel) -> list[str]:
    """The name of each joint in the model's order, or the name of its body if it has no name."""
    bodies = body_names(model)
    return _called(model, "joint", [bodies[body] for body in model.jnt_bodyid])


def actuator_names(model: mujoco.MjModel) -> list[str]:
    """The name of each actuator, or the name of its joint, tendon or site if it has no name."""
    import mujoco

    kinds, joints = mujoco.mjtTrn, joint_names(model)
    tendons = _called(model, "tendon", [f"tendon{k + 1}" for k in range(model.ntendon)])
    wanted = []
    for actuator, (kind, target) in enumerate(zip(model.actuator_trntype, model.actuator_trnid[:, 0])):
        own = f"actuator{actuator + 1}"
        if kind in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
            own = joints[target]
        elif kind == int(kinds.mjTRN_TENDON):
            own = tendons[target]
        elif kind in (int(kinds.mjTRN_SITE), int(kinds.mjTRN_SLIDERCRANK)):
            own = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, target) or own
        wanted.append(own)
    return _called(model, "actuator", wanted)


def _called(model: mujoco.MjModel, kind: str, wanted: Sequence[str]) -> list[str]:
    """Names of all objects of a kind; an object without a name gets the default one, with a number if that is taken."""
    import mujoco

    object_type = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    found = [mujoco.mj_id2name(model, object_type, index) or "" for index in range(len(wanted))]
    taken = set(found)
    for index, own in enumerate(found):
        if not own:
            free = itertools.chain([wanted[index]], (f"{wanted[index]}_{k}" for k in itertools.count(2)))
            found[index] = next(name for name in free if name not in taken)
            taken.add(found[index])
    return found


def _count(model: mujoco.MjModel, kind: str) -> int:
    arrays = {
        "actuator": model.actuator_trntype,
        "body": model.body_parentid,
        "camera": model.cam_bodyid,
        "geom": model.geom_type,
        "joint": model.jnt_type,
        "sensor": model.sensor_type,
        "site": model.site_type,
    }
    return len(arrays[kind])


def find_object(model: mujoco.MjModel, kind: str, name: str, line: str) -> int:
    """The index of a named object; ``line`` is the replay line for the message.

    Raises:
        ModelError: the model has no such object; the message suggests the closest name.
    """
    import mujoco

    titles = {"body": body_names, "joint": joint_names, "actuator": actuator_names}.get(kind)
    if titles is not None:
        known = titles(model)
        index = known.index(name) if name in known else -1
    else:
        known = names_of(model, kind)
        index = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if index < 0:
        raise ModelError(f"{line}: the model has no {kind} {name}{nearest(name, known)}")
    return index


def lines_of(solution: Solution, kind: str) -> list[ReplayChannel]:
    """The replay lines of one kind.

    Raises:
        ModelError: two lines have the same path, or a value is not finite.
    """
    lines = [line for line in solution.replay if line.kind == kind]
    seen: set[str] = set()
    for line in lines:
        if line.name in seen:
            raise ModelError(f"{kind} {line.name} stands in the replay section twice")
        seen.add(line.name)
        _require_finite(line)
    return lines


def _require_finite(line: ReplayChannel) -> None:
    for channel in (line.value, line.rate, line.acceleration):
        for values in (channel.before, channel.after, channel.mid) if channel is not None else ():
            if values is not None and not np.all(np.isfinite(values)):
                frame = int(np.flatnonzero(~np.isfinite(values))[0])
                raise ModelError(f"{line.kind} {line.name}: not a finite number at frame {frame}")


def find_control(model: mujoco.MjModel, name: str) -> tuple[int, int]:
    """The index of an actuator, and the index of its control in ``ctrl``.

    Args:
        name: name of the actuator; for an actuator with several controls, with the control: ``servo.pos``.

    Raises:
        ModelError: there is no such actuator, or the name does not select one of several controls.
    """
    owner, _, part = name.rpartition(".")
    several = name not in actuator_names(model) and owner in actuator_names(model)
    index = find_object(model, "actuator", owner if several else name, f"actuator {name}")
    parts = inputs_of(model, index)
    if part in parts and several:
        return index, int(model.actuator_ctrladr[index]) + parts.index(part)
    if several or len(parts) != 1:
        takes = f": write its .{', .'.join(parts)}" if len(parts) > 1 else ""
        count = len(parts) or "no"
        raise ModelError(f"actuator {name}: it takes {count} control{'s' * (len(parts) != 1)}{takes}")
    return index, int(model.actuator_ctrladr[index])


def find_activation(model: mujoco.MjModel, name: str) -> int | None:
    """The index in ``act`` of a state of an actuator, ``servo.activation``; None for other names."""
    owner, _, part = name.rpartition(".")
    known = actuator_names(model)
    if name in known or owner not in known:
        return None
    index = known.index(owner)
    count = int(model.actuator_actnum[index])
    parts = ["activation"] if count == 1 else [f"activation{k + 1}" for k in range(count)]
    return int(model.actuator_actadr[index]) + parts.index(part) if part in parts else None


def inputs_of(model: mujoco.MjModel, actuator: int) -> list[str]:
    """The names of the controls of an actuator in the order of ``ctrl``: ``pos``, ``vel``, ``ff``, ``voltage``."""
    import mujoco

    count, given = int(model.actuator_ctrlnum[actuator]), int(model.actuator_ctrlspec[actuator])
    members = {int(bit): name for name, bit in mujoco.mjtCtrlInput.__members__.items() if given & int(bit)}
    named = [members[bit].removeprefix("mjINPUT_").lower() for bit in sorted(members)]
    return named if len(named) == count else [f"control{k + 1}" for k in range(count)]


def single_number(line: ReplayChannel) -> float:
    """The value of a ``set`` line, which must be constant along the motion.

    Raises:
        ModelError: it changes.
    """
    values = np.concatenate([line.value.before, line.value.after])
    first = float(values[0])
    if np.max(np.abs(values - first)) > 1e-12 * max(1.0, abs(first)):
        raise ModelError(
            f"set {line.name}: the value changes along the motion, but a model field is one number"
        )
    return first
