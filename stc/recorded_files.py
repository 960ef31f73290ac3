"""The files of a solution's model, with their hashes and, if small, their contents.

A verdict is about one model.  With these records a reader of a solution file can check whether the model beside it is
the right one and, if there is none, use the stored one.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from hashlib import sha256
from pathlib import Path, PurePosixPath

from stc.records import dataclass
from stc.urdf import mesh_files

#: The text of a model and of what it includes is carried whole up to so many bytes, other files up to the second
#: number; larger ones by their hashes alone.
TEXT_CARRIED, CARRIED = 2**20, 2**12

#: The role of a file of numbers that a spec reads; solutions carry them whole.
DATA_ROLE = "data"

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_TAG = re.compile(rb"<\s*(\w+)([^<>]*)>")
_ATTRIBUTE = re.compile(rb"""(\w+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
#: Which folder of the compiler's holds the files of an element.
_FOLDERS = {b"mesh": b"meshdir", b"skin": b"meshdir", b"flexcomp": b"meshdir", b"hfield": b"meshdir"}
_FOLDERS |= {b"texture": b"texturedir"}


@dataclass(frozen=True, slots=True)
class RecordedFile:
    """A file that a motion depends on, as it was when the motion was solved.

    Attributes:
        role: ``model`` for the model's own file, ``part`` for those that it includes, meshes and the like, ``data`` for
            the numbers that a spec reads.
        path: relative to the model's folder, with ``/`` between folders; of data as the spec writes it.
        sha256: hash of its content, hexadecimal.
        size: of its content, in bytes.
        content: all of it, or None where only the hash is kept.
    """

    role: str
    path: str
    sha256: str
    size: int
    content: bytes | None = None


def record(model: Path) -> list[RecordedFile]:
    """The files of a MuJoCo model, its own first; those that cannot be read are left out.

    Args:
        model: path of its XML file.
    """
    found: dict[str, RecordedFile] = {}
    for role, path in _files(model):
        if path in found:
            continue
        try:
            content = (model.parent / path).read_bytes()
        except (OSError, ValueError):
            continue
        most = TEXT_CARRIED if _is_text(role, path) else CARRIED
        kept = content if len(content) <= most else None
        found[path] = RecordedFile(role, path, sha256(content).hexdigest(), len(content), kept)
    return list(found.values())


def changed(files: Sequence[RecordedFile], model: Path) -> list[str]:
    """The paths of recorded files that are missing or have changed in the present folder of the model's file."""
    found = []
    for file in files:
        path = model if file.role == "model" else model.parent / file.path
        try:
            same = path.stat().st_size == file.size and sha256(path.read_bytes()).hexdigest() == file.sha256
        except (OSError, ValueError):
            same = False
        if not same:
            found.append(file.path)
    return found


#: Folders that models have been written out to, by the hashes of their files.
_unpacked: dict[tuple[str, ...], Path] = {}


def present(files: Sequence[RecordedFile], places: Iterable[Path]) -> Path | None:
    """The first of some places at which the model's own file exists and all files are the recorded ones."""
    return next((place for place in places if place.is_file() and not changed(files, place)), None)


def unpacked(files: Sequence[RecordedFile]) -> Path | None:
    """The path of a model written from the stored files, in a folder that is removed when the process ends.

    None if a file is not stored, or would be outside of that folder.
    """
    import atexit
    from shutil import rmtree
    from tempfile import mkdtemp

    if not any(file.role == "model" for file in files):
        return None
    for file in files:
        path = PurePosixPath(file.path)
        if file.content is None or path.is_absolute() or ".." in path.parts:
            return None
    key = tuple([file.path + file.sha256 for file in files])
    if key in _unpacked:
        return _unpacked[key]
    folder = Path(mkdtemp(prefix="stc-model-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    for file in files:
        target = folder / file.path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.content or b"")
    _unpacked[key] = folder / next(file.path for file in files if file.role == "model")
    return _unpacked[key]


def _files(model: Path) -> Iterator[tuple[str, str]]:
    """Role and path of the model's own file and of all that it names, found without a simulator."""
    yield "model", model.name
    texts: dict[str, bytes] = {}
    pending = [model.name]
    while pending:
        path = pending.pop(0)
        try:
            texts[path] = _COMMENT.sub(b"", (model.parent / path).read_bytes())
        except (OSError, ValueError):
            continue
        if path.endswith(".urdf"):
            for mesh in mesh_files(model.parent / path):
                yield "part", _beside(mesh, model.parent)
            texts[path] = b""
        pending += [
            name
            for name in _named([texts[path]])
            if _is_text("part", name) and name not in {*texts, *pending}
        ]
    # What is included is part of one text: the folders that one file names hold the meshes of the others.
    for name in [*texts, *_named(list(texts.values()))]:
        yield "part", name


def _beside(path: Path, folder: Path) -> str:
    """A path relative to a folder, as files of a model are recorded."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _is_text(role: str, path: str) -> bool:
    return role == "model" or path.endswith((".xml", ".mjcf", ".urdf"))


def _named(texts: Sequence[bytes]) -> Iterator[str]:
    """The files that the texts of a model name, relative to the model's folder, in any folder where they may lie."""
    tags = [
        (tag, {k: a or b for k, a, b in _ATTRIBUTE.findall(rest)})
        for text in texts
        for tag, rest in _TAG.findall(text)
    ]
    settings = [item for tag, attributes in tags if tag == b"compiler" for item in attributes.items()]
    for tag, attributes in tags:
        kinds = (_FOLDERS[tag], b"assetdir") if tag in _FOLDERS else ()
        folders = dict.fromkeys([folder for key, folder in settings if key in kinds] + [b""])
        for attribute, value in attributes.items():
            if attribute.startswith(b"file") and value:
                for folder in folders:
                    name = PurePosixPath(folder.decode(errors="replace")) / value.decode(errors="replace")
                    yield name.as_posix()
