"""A motion for other programs: tables, MuJoCo's own files, and an animation for Blender and the web.

========= ============ =========================================================================================
format    file         holds
========= ============ =========================================================================================
csv       ``.csv``     time and every variable and derivative, a row per instant (:mod:`stc.validate.export.table`)
npz       ``.npz``     the same as NumPy arrays
keyframes ``.xml``     the model with the spec's numbers in it and a keyframe per frame, its assets beside it
                       (:mod:`stc.validate.export.keyframes`)
controls  ``.npz``     what a MuJoCo program applies step by step, the states it should meet, and tracking gains
                       (:mod:`stc.validate.export.controls`)
gltf      ``.glb``     the moving model as a glTF animation (:mod:`stc.validate.export.gltf`)
usd       ``.usda``    the same as a USD stage, or ``.usdc`` (:mod:`stc.validate.export.usd`)
joints    ``.csv``     joints, torques, controls and contact forces, units in the header
                       (:mod:`stc.validate.export.joints`)
ros       ``.yaml``    a ``trajectory_msgs/msg/JointTrajectory`` (:mod:`stc.validate.export.ros`)
========= ============ =========================================================================================
"""

from __future__ import annotations

import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from stc.arguments import spare
from stc.errors import UsageError
from stc.solution import Solution, read

#: Formats and the suffix of their files.
FORMATS = {
    "csv": ".csv",
    "npz": ".npz",
    "keyframes": ".xml",
    "controls": ".npz",
    "gltf": ".glb",
    "usd": ".usda",
    "joints": ".csv",
    "ros": ".yaml",
}

#: Further suffixes of a format.
_ALSO = {"usd": (".usdc",), "ros": (".yml",)}

#: Those that hold the variables of the spec, so that a motion needs no model for them.
TABLES = ("csv", "npz")

#: Those with so many instants a second, and those with time steps.
_RATED, _STEPPED = (*TABLES, "gltf", "usd", "joints", "ros"), ("keyframes", "controls")

#: What distinguishes a file from the solution it comes from, where no name is given.
_ENDINGS = {
    "csv": "_motion",
    "npz": "_motion",
    "keyframes": "_keyframes",
    "controls": "_controls",
    "gltf": "",
    "usd": "",
    "joints": "_joints",
    "ros": "_trajectory",
}


def default_name(solution: Solution, kind: str) -> str:
    """The default file name of an export."""
    return f"{solution.name}{_ENDINGS[kind]}{FORMATS[kind]}"


def _suffixes(kind: str) -> tuple[str, ...]:
    return FORMATS[kind], *_ALSO.get(kind, ())


def format_of(path: str | os.PathLike[str]) -> str:
    """The format of a file by its suffix; the first one if several formats share the suffix.

    Raises:
        UsageError: no format has it.
    """
    suffix = Path(path).suffix.lower()
    for kind in FORMATS:
        if suffix in _suffixes(kind):
            return kind
    known = ", ".join(dict.fromkeys(each for kind in FORMATS for each in _suffixes(kind)))
    raise UsageError(f"{path}: no format has this suffix", f"say which with --format, or use one of {known}")


def check_format(kind: str, rate: float | None, time_step: float | None) -> None:
    """Refuse an unknown format, a format whose library is missing, and options that the format does not have.

    Raises:
        UsageError: as :func:`export`.
    """
    if kind not in FORMATS:
        raise UsageError(f"unknown format `{kind}`", f"the formats are {', '.join(FORMATS)}")
    if kind == "usd" and find_spec("pxr") is None:
        raise UsageError(
            "USD files need the library usd-core, which is not installed",
            "`pip install usd-core` installs it",
        )
    for name, value, takes in (("rate", rate, _RATED), ("time step", time_step, _STEPPED)):
        if value is not None and kind not in takes:
            raise UsageError(f"the format {kind} has no {name}", f"those that have one: {', '.join(takes)}")
        if value is not None and not value > 0.0:
            raise UsageError(f"the {name} must be positive, not {value:g}")


def export(
    motion: Solution | str | os.PathLike[str],
    kind: str,
    path: str | os.PathLike[str] | None = None,
    *,
    model: str | os.PathLike[str] | None = None,
    rate: float | None = None,
    time_step: float | None = None,
) -> Path:
    """Write a motion in another format.

    Args:
        motion: a solution, or the path of a saved one.
        kind: one of :data:`FORMATS`.
        path: the file; by default one in the working directory that is named after the spec.
        model: a model file to use in place of the one that the spec names.
        rate: instants per second of tables and animations; by default the frames for tables and ROS messages, and 60
            for animations (for glTF the frames if there are more).
        time_step: longest time step of keyframes and controls, in seconds; by default that of the model.

    Returns:
        The path of the file.

    Raises:
        UsageError: an unknown format or one whose library is missing, a wrong suffix, a file that is an input of the
            motion, or a rate or time step that the format does not have, that is not positive, or that would make the
            file too large.
        ModelError: there is no model, or it cannot be written.
        SolutionError: the solution is damaged.
    """
    check_format(kind, rate, time_step)
    solution = motion if isinstance(motion, Solution) else read(motion)
    solution.require_increasing_times()
    target = Path(default_name(solution, kind) if path is None else path)
    if target.suffix.lower() not in _suffixes(kind):
        raise UsageError(f"{target}: the format {kind} is written to *{' or *'.join(_suffixes(kind))}")
    spare(target, [] if isinstance(motion, Solution) else [(motion, "the solution itself")])
    target.parent.mkdir(parents=True, exist_ok=True)
    if kind in TABLES:
        from stc.validate.export import table

        table.write(solution, target, rate)
        return target
    from stc.validate.model import model_inputs
    from stc.validate.setup import prepare

    beside = [] if isinstance(motion, Solution) else [Path(motion).parent]
    setup = prepare(solution, model, beside)
    spare(target, model_inputs(setup.path))
    number = time_step if kind in _STEPPED else rate
    import_module(f"stc.validate.export.{kind}").write(setup, target, number)
    return target
