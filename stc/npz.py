"""Arrays into an ``.npz`` file, as :func:`numpy.savez` writes them, in a fifth of its time.

Such a file is a ZIP archive of ``.npy`` files, not compressed (PKWARE APPNOTE 6.3.10, sections 4.3 and 4.4).  NumPy
writes it through :mod:`zipfile`, which loads three compressors to do without: most of what saving a small solve takes.
"""

from __future__ import annotations

import io
import math
import os
import struct
from binascii import crc32
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

#: Sizes and counts beyond these need the archive format's extension to 64 bits, which is left to NumPy.
_MOST_BYTES, _MOST_ENTRIES = 2**31, 2**16 - 1

_LOCAL = struct.Struct("<4s5H3I2H")
_CENTRAL = struct.Struct("<4s6H3I5H2I")
_END = struct.Struct("<4s4H2IH")
_VERSION, _STORED, _UTF8_NAME = 20, 0, 0x800
_TIME, _DATE = 0, 1 << 5 | 1  # the first of January 1980: the same arrays make the same file
_READABLE = 0o600 << 16


def save(stream: IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays under their names; :func:`numpy.load` reads them.

    Args:
        stream: open for writing, at the start of the file.
        arrays: of plain numbers.

    Raises:
        ValueError: an array of objects.
    """
    if sum(array.nbytes + 1024 for array in arrays.values()) > _MOST_BYTES or len(arrays) > _MOST_ENTRIES:
        named: Any = arrays  # type checkers take the names for options
        np.savez(stream, **named)
        return
    central: list[bytes] = []
    offset = 0
    for name, array in arrays.items():
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, np.asanyarray(array), allow_pickle=False)
        content = buffer.getbuffer()
        text = f"{name}.npy".encode()
        size = len(content)
        # What the local header and the directory at the end both say.
        common = (_VERSION, _UTF8_NAME, _STORED, _TIME, _DATE, crc32(content), size, size, len(text), 0)
        stream.write(_LOCAL.pack(b"PK\x03\x04", *common) + text)
        stream.write(content)
        entry = _CENTRAL.pack(b"PK\x01\x02", _VERSION, *common, 0, 0, 0, _READABLE, offset)
        central.append(entry + text)
        offset += _LOCAL.size + len(text) + size
    directory = b"".join(central)
    count = len(arrays)
    stream.write(directory + _END.pack(b"PK\x05\x06", 0, 0, count, count, len(directory), offset, 0))


def load(path: str | os.PathLike[str] | bytes, compressed: bool = False) -> dict[str, np.ndarray]:
    """Read the arrays of an ``.npz`` file from anyone: plain numbers alone, and no more memory than the file is large.

    What members claim to be is held against what is there before any memory is taken for it.

    Args:
        path: of the file, or all that is in it.
        compressed: whether members may be compressed; together they may then come to 256 MiB.

    Raises:
        ContentsError: the archive claims more than it holds, or holds other things than numbers.
        zipfile.BadZipFile, OSError, ValueError, EOFError: it is damaged.
    """
    import zipfile

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
    """An archive whose members are not what they claim to be, or no arrays of numbers."""


#: What compressed members may come to together, in bytes.
_MOST_UNPACKED = 2**28


def _array(name: str, content: bytes) -> np.ndarray:
    """An array in the format of ``.npy`` files; a view of what was read."""
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
