"""Files of arrays are what NumPy and every ZIP program take them for."""

from __future__ import annotations

import hashlib
import io
import json
import tracemalloc
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

import stc
from stc import npz

NAMES = st.text(
    st.characters(codec="utf-8", exclude_characters="/\\\0:", exclude_categories=("Cs",)), max_size=9
)
ARRAYS = st.one_of(
    arrays_of.arrays(dtype, arrays_of.array_shapes(min_dims=0, min_side=0, max_dims=3, max_side=4))
    for dtype in (np.float64, np.int32, np.uint8, np.bool_, ">f4")
)


@given(arrays=st.dictionaries(NAMES, ARRAYS, max_size=5))
def test_numpy_reads_what_was_written(arrays: dict[str, Any]) -> None:
    stream = io.BytesIO()
    npz.save(stream, arrays)
    with zipfile.ZipFile(io.BytesIO(stream.getvalue())) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == [f"{name}.npy" for name in arrays]
    with np.load(io.BytesIO(stream.getvalue()), allow_pickle=False) as found:
        assert found.files == list(arrays)
        for name, array in arrays.items():
            assert found[name].dtype == array.dtype
            np.testing.assert_array_equal(found[name], array)


def test_the_same_arrays_make_the_same_file() -> None:
    written = []
    for _ in range(2):
        stream = io.BytesIO()
        npz.save(stream, {"time": np.arange(5.0), "x": np.arange(12).reshape(3, 4)[:, ::2]})
        written.append(stream.getvalue())
    assert written[0] == written[1]


def test_objects_are_refused() -> None:
    with pytest.raises(ValueError, match="Object arrays"):
        npz.save(io.BytesIO(), {"x": np.array([None])})


@given(arrays=st.dictionaries(NAMES, ARRAYS, max_size=5))
def test_what_was_written_is_read(tmp_path_factory: pytest.TempPathFactory, arrays: dict[str, Any]) -> None:
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    with path.open("wb") as stream:
        npz.save(stream, arrays)
    found = npz.load(path)
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)


def header(shape: str, dtype: str = "<f8") -> bytes:
    """The beginning of an ``.npy`` file with no number after it."""
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


HUGE = [
    ("claims 1000000000000 numbers and holds 0", header("(1000000000000,)"), zipfile.ZIP_STORED),
    ("claims .* numbers", header("(4294967296, 4294967296)"), zipfile.ZIP_STORED),
    ("claims", header("(-1, -8)") + bytes(64), zipfile.ZIP_STORED),
    ("other data than numbers", header("(2,)", "|O") + bytes(16), zipfile.ZIP_STORED),
    ("no readable header", header("(1,").replace(b", }", b"   "), zipfile.ZIP_STORED),
    ("compressed", header("(100000000,)") + bytes(100_000_000), zipfile.ZIP_DEFLATED),
]


@pytest.mark.parametrize(("message", "content", "method"), HUGE)
def test_members_are_what_they_claim_before_memory_is_taken(
    tmp_path: Any, message: str, content: bytes, method: int
) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("facts.npy", content)
    tracemalloc.start()
    with pytest.raises(npz.ContentsError, match=message):
        npz.load(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10_000_000
    with pytest.raises(stc.SolutionError, match="not a solution file as stc writes it"):
        stc.read(path)


def test_members_that_share_their_bytes_are_refused(tmp_path: Any) -> None:
    """A thousand entries of a directory that lie on one member are more than the file holds."""
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("m0.npy", header("(12500,)") + bytes(100_000))
        first = archive.infolist()[0]
        for k in range(1, 1000):
            other = zipfile.ZipInfo(f"m{k}.npy")
            for name in ("header_offset", "file_size", "compress_size", "CRC", "compress_type"):
                setattr(other, name, getattr(first, name))
            archive.filelist.append(other)
            archive.NameToInfo[other.filename] = other
    with pytest.raises(npz.ContentsError, match=r"claim .* bytes together"):
        npz.load(path)


def test_a_text_of_endless_frames_takes_no_memory(tmp_path: Any) -> None:
    """The frames of the text are counted before they are laid out."""
    stc.load("constants: n = 3; variables: x; constraints: x = 1;").solve().save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive:
        arrays = dict(archive)
    facts = json.loads(arrays["facts"].tobytes())
    source = facts["source"].replace("n = 3", "n = 1000000000000")
    for n in (3, 10**12):
        told = {**facts, "source": source, "sha256": hashlib.sha256(source.encode()).hexdigest(), "n": n}
        text = np.frombuffer(json.dumps(told).encode(), np.uint8)
        np.savez(tmp_path / "b.npz", **{**arrays, "facts": text})
        with pytest.raises(stc.SolutionError, match=r"altered|states no motion|number of the last frame"):
            stc.read(tmp_path / "b.npz")
