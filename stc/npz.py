"""Write arrays to ``.npz`` files, and read such files from untrusted sources."""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np


def save(stream: IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays under their names; :func:`numpy.load` reads them.

    :func:`numpy.savez` would confuse names with its own options, such as ``file``, and pickle objects.

    Args:
        stream: a stream open for writing, at the start of the file.
        arrays: arrays of plain numbers.

    Raises:
        ValueError: an array of objects.
    """
    with zipfile.ZipFile(stream, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


def load(path: str | os.PathLike[str] | bytes, compressed: bool = False) -> dict[str, np.ndarray]:
    """Read the arrays of an untrusted ``.npz`` file: plain numbers only, and no more memory than the size of the file.

    The stated sizes of members are compared with the file before memory is allocated.

    Args:
        path: path of the file, or its content.
        compressed: whether members may be compressed; together they may then come to 256 MiB.

    Raises:
        ContentsError: the archive claims more than it holds, or holds other things than numbers.
        zipfile.BadZipFile, OSError, ValueError, EOFError: it is damaged.
    """
    found: dict[str, np.ndarray] = {}
    with zipfile.ZipFile(io.BytesIO(path) if isinstance(path, bytes) else path) as archive:
        entries = archive.infolist()
        packed = any(entry.compress_type != zipfile.ZIP_STORED for entry in entries)
        if packed and not compressed:
            raise ContentsError("its members are compressed, which those of solution files are not")
        claimed = sum(entry.file_size for entry in entries)
        size = len(path) if isinstance(path, bytes) else Path(path).stat().st_size
        most = _MOST_UNPACKED if packed else size
        if claimed > most:
            raise ContentsError(
                f"its members claim {claimed} bytes together, where {most} are the most there can be"
            )
        for entry in entries:
            name = entry.filename.removesuffix(".npy")
            if name in found:
                raise ContentsError(f"it has two members {name}")
            with archive.open(entry) as stream:
                content = stream.read(entry.file_size + 1)
            if len(content) != entry.file_size:
                raise ContentsError(f"its member {name} holds not as many bytes as it claims")
            found[name] = _array(name, content)
    return found


class ContentsError(ValueError):
    """An archive whose members have wrong sizes, or are not arrays of numbers."""


#: What compressed members may come to together, in bytes.
_MOST_UNPACKED = 2**28


def _array(name: str, content: bytes) -> np.ndarray:
    """An array in the format of ``.npy`` files; a view of the bytes that were read."""
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise ContentsError(f"its member {name} has an unknown format")
    read_header = (
        np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    )
    try:
        shape, by_columns, dtype = read_header(stream)
    except Exception:  # NumPy takes a header apart as Python's text, which fails in many ways
        raise ContentsError(f"its member {name} has no readable header") from None
    if dtype.kind not in "fiub":
        raise ContentsError(f"its member {name} holds other data than numbers")
    count, rest = math.prod(shape), len(content) - stream.tell()
    if count * dtype.itemsize != rest or min(shape, default=0) < 0:
        raise ContentsError(f"its member {name} claims {count} numbers and holds {rest // dtype.itemsize}")
    values = np.frombuffer(content, dtype, count, stream.tell())
    return values.reshape(shape, order="F" if by_columns else "C")
