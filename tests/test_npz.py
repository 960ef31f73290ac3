"""Files of arrays are what NumPy and every ZIP program take them for."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

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


def test_what_is_too_large_is_left_to_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(npz, "_MOST_BYTES", 3000)
    stream = io.BytesIO()
    npz.save(stream, {"a": np.arange(500.0), "é": np.arange(3)})
    with np.load(io.BytesIO(stream.getvalue())) as found:
        assert found["a"].sum() == 499 * 250
        assert found.files == ["a", "é"]
