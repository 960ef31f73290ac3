"""A URDF in the form that MuJoCo's reader accepts: with the paths of its meshes, and the elements that the reader
ignores.

URDFs are written for other programs.  They name meshes by packages (``package://go1_description/meshes/trunk.dae``),
which MuJoCo does not look for, and two meshes of one name in different folders are one to it.  So every mesh gets a
name of its own in the text, without changing its lines, and a list tells which file each stands for.
"""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from stc.records import dataclass

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")
_MESH = re.compile(r"<mesh\b[^>]*>")
_FILENAME = re.compile(r"""(\bfilename\s*=\s*)(?:"([^"]*)"|'([^']*)')""")
_SCALE = re.compile(r"""\bscale\s*=\s*["']([^"']*)["']""")
_SETTING = re.compile(r"""\b(meshdir|assetdir)\s*=\s*["']([^"']*)["']""")
_ROBOT = re.compile(r"<robot\b[^>]*>")
_FLOATING = re.compile(r"""<joint\b[^>]*\btype\s*=\s*["']floating["'].*?</joint>""", re.DOTALL)
_PARENT = re.compile(r"""<parent\b[^>]*\blink\s*=\s*["']([^"']*)["']""")
_CHILD = re.compile(r"""<child\b[^>]*\blink\s*=\s*["']([^"']*)["']""")

#: What MuJoCo's reader does unless it is told otherwise: throws away what is only to be seen, and joins links that
#: are fixed to one another, whose names are then gone.
_OPTIONS = '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco>'

#: Variables of the environment that list folders in which ROS looks for packages.
_PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


@dataclass(frozen=True, slots=True)
class Mesh:
    """A mesh that a URDF names.

    Attributes:
        written: as the URDF names it.
        line: where, counted from 1.
        file: where it lies; None where it is in none of the places in which packages lie.
    """

    written: str
    line: int
    file: Path | None


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another one: its coordinate is ``multiplier`` times the other's and ``offset``."""

    joint: str
    source: str
    multiplier: float
    offset: float


def is_urdf(path: str | os.PathLike[str], text: str) -> bool:
    """Whether a model file is a URDF and no MJCF, whatever it is called."""
    return os.fspath(path).lower().endswith(".urdf") or (
        "<mujoco" not in text.split("<robot", 1)[0] and _ROBOT.search(text) is not None
    )


def without_comments(text: str) -> str:
    """A text without its comments, and with the same lines."""
    return _COMMENT.sub(lambda match: "\n" * match.group().count("\n"), text)


def prepared(text: str, folder: Path) -> tuple[str, dict[str, Mesh]]:
    """A URDF's text with a name for every mesh, and what these names stand for.

    Parameters
    ----------
    text
        Of the URDF.
    folder
        In which it lies.
    """
    settings = dict(_SETTING.findall(text))
    meshes: dict[str, Mesh] = {}
    known: dict[tuple[str, str], str] = {}

    def named(match: re.Match[str]) -> str:
        tag = match.group()
        file = _FILENAME.search(tag)
        if file is None:
            return tag
        written = file.group(2) if file.group(2) is not None else file.group(3)
        scale = _SCALE.search(tag)
        key = (written, scale.group(1) if scale else "")
        if key not in known:
            name = wanted = re.sub(r"\W", "_", Path(written).stem) or "mesh"
            count = 1
            while name in meshes:
                count += 1
                name = f"{wanted}_{count}"
            known[key] = name
            line = text.count("\n", 0, match.start()) + 1
            meshes[name] = Mesh(written, line, located(written, folder, settings))
        return tag[: file.start()] + f'{file.group(1)}"{known[key]}"' + tag[file.end() :]

    made = _MESH.sub(named, text)
    root = _root_of_floating(made)
    if root:  # MuJoCo has free joints in the world alone, and takes a link of this name for it
        named_root = rf"""(<(?:link|parent)\b[^>]*?\b(?:name|link)\s*=\s*)["']{re.escape(root)}["']"""
        made = re.sub(named_root, r'\1"world"', made)
    if "<mujoco" not in made:
        made = _ROBOT.sub(lambda match: match.group() + _OPTIONS, made, count=1)
    return made, meshes


def _root_of_floating(text: str) -> str:
    """The link that is fixed to the world and has another one float in it; empty if there is none."""
    parents = [_PARENT.search(joint) for joint in _FLOATING.findall(text)]
    children = set(_CHILD.findall(text))
    return next((found.group(1) for found in parents if found and found.group(1) not in children), "")


def mesh_files(path: Path) -> list[Path]:
    """The meshes of a URDF that are there."""
    text = path.read_text(encoding="utf-8", errors="replace")
    return [mesh.file for mesh in prepared(text, path.parent)[1].values() if mesh.file is not None]


def located(written: str, folder: Path, settings: dict[str, str] | None = None) -> Path | None:
    """The file that a URDF means by a name, None where there is none.

    Parameters
    ----------
    written
        ``package://NAME/PATH``, ``model://NAME/PATH``, ``file://PATH``, or a path.
    folder
        In which the URDF lies; packages are looked for beside and around it, and where ROS does.
    settings
        ``meshdir`` or ``assetdir`` of a URDF that has words for MuJoCo.
    """
    try:
        return next((each for each in _places(written, folder, settings or {}) if each.is_file()), None)
    except (OSError, ValueError):  # a name that no file can have
        return None


def _places(written: str, folder: Path, settings: dict[str, str]) -> Iterator[Path]:
    scheme, separator, rest = written.partition("://")
    path = Path(unquote(rest).lstrip("/") if separator else written)
    if separator and scheme == "file":
        yield Path("/") / path
        return
    for key in ("meshdir", "assetdir"):
        if key in settings:
            yield folder / settings[key] / path
            yield folder / settings[key] / path.name
    if not separator:
        yield folder / path
        return
    folder = folder.resolve()
    inside = Path(*path.parts[1:])
    for above in (folder, *folder.parents):
        yield above / path
        if above.name == path.parts[0]:
            yield above / inside
    for variable in _PACKAGE_PATHS:
        for each in os.environ.get(variable, "").split(os.pathsep):
            if each:
                yield from (Path(each) / path, Path(each) / "share" / path)
                if Path(each).name == path.parts[0]:
                    yield Path(each) / inside
    # A package whose folder has another name, as a clone of its repository has: beside the folder of the URDF.
    yield folder.parent / inside
    yield folder / inside


def mimics(text: str) -> list[Mimic]:
    """The ``mimic`` elements of joints, which MuJoCo's reader ignores."""
    if "<mimic" not in text:
        return []
    found = []
    for joint in ET.fromstring(text.encode()).iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            of = mimic.attrib
            numbers = float(of.get("multiplier", 1.0)), float(of.get("offset", 0.0))
            found.append(Mimic(joint.get("name", ""), of.get("joint", ""), *numbers))
    return found


def text_vertices(path: Path) -> list[float] | None:
    """The corners of the triangles of an STL file that is written as text, coordinate by coordinate; None of others.

    Raises
    ------
    ValueError
        What stands there is no number.
    OSError
        There is no such file.
    """
    if path.suffix.lower() != ".stl":
        return None
    with path.open("rb") as stream:
        begin = stream.read(1024)
    if (
        not begin.lstrip().startswith(b"solid") or b"facet" not in begin
    ):  # binary ones may begin with the word, too
        return None
    return [float(number) for vertex in _VERTEX.findall(path.read_bytes()) for number in vertex]
