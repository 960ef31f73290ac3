"""Vectors of eight in compiled functions, against NumPy and against plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from stc.codegen.native import NativeError, f64, f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import (
    abs8,
    expand8,
    gather8,
    largest8,
    load8,
    max8,
    negative8,
    prefetch8,
    scatter8,
    splat8,
    store8,
    sum8,
)


@native(fast=True)
def product(rows: i64, factors: f64s, table: f64s, sums: f64s) -> f64:
    total = splat8(0.0)
    most = splat8(-1.0)
    for k in range(rows):
        row = load8(table, 8 * k)
        total += factors[k] * row
        most = max8(most, abs8(-row))
    store8(sums, 1, 2.0 * total - 1)
    sums[0] = sum8(load8(sums, 1))
    return largest8(most)


@native
def from_integers(x: f64s) -> None:
    store8(x, 0, 3)


@pytest.mark.parametrize("plain", [False, True])
def test_products_and_extremes(plain):
    rng = np.random.default_rng(3)
    table, factors, sums = rng.normal(size=(5, 8)), rng.normal(size=5), np.zeros(10)
    call = product.python if plain else product
    assert call(5, factors, table.reshape(-1), sums) == np.abs(table).max()
    np.testing.assert_allclose(sums[1:9], 2.0 * factors @ table - 1.0, rtol=1e-14)
    assert sums[0] == pytest.approx(sums[1:9].sum(), rel=1e-13)
    assert sums[9] == 0.0
    from_integers(sums)
    assert (sums[:8] == 3.0).all()


@native
def quotients(count: i64, x: f64s, places: i32s, out: f64s, signs: f64s) -> None:
    for k in range(count):
        value = gather8(x, places, 8 * k)
        scatter8(out, places, 8 * k, 1.0 / value - value / 2.0)
        store8(signs, 8 * k, negative8(value))


@pytest.mark.parametrize("plain", [False, True])
def test_gathering_scattering_dividing_and_signs(plain):
    rng = np.random.default_rng(4)
    x, places = rng.normal(size=24), rng.permutation(24).astype(np.int32)
    x[places[3]] = 0.0
    out, signs = np.zeros(24), np.zeros(16)
    with np.errstate(divide="ignore"):
        (quotients.python if plain else quotients)(2, x, places, out, signs)
        expected = np.zeros(24)
        expected[places[:16]] = (1.0 / x - x / 2.0)[places[:16]]
    np.testing.assert_array_equal(out, expected)
    np.testing.assert_array_equal(signs, x[places[:16]] < 0.0)


@native
def expansions(masks: i32s, x: f64s, out: f64s) -> None:
    begin = 0
    for k in range(4):
        store8(out, 8 * k, expand8(x, begin, masks[2 * k]))
        begin += masks[2 * k + 1]


@pytest.mark.parametrize("plain", [False, True])
def test_expanding_what_stands_close_together(plain):
    rng = np.random.default_rng(5)
    held = rng.random((4, 8)) < 0.4
    held[1], held[2] = True, False
    x, out = rng.normal(size=held.sum()), np.full(32, np.nan)
    masks = np.stack([held @ (1 << np.arange(8)), held.sum(axis=1)], axis=1).reshape(-1).astype(np.int32)
    expected = np.zeros((4, 8))
    expected[held] = x
    (expansions.python if plain else expansions)(masks, x, out)
    np.testing.assert_array_equal(out, expected.reshape(-1))


def test_what_is_expanded_are_floats():
    @native
    def wrong(x: i64s) -> f64:
        return sum8(expand8(x, 0, 255))

    @native
    def too_few(x: f64s) -> f64:
        return sum8(expand8(x, 0))

    for function, message in ((wrong, "needs an array of floats"), (too_few, "takes 3 arguments")):
        with pytest.raises(NativeError, match=message):
            function(np.zeros(8, dtype=np.int64))


@native
def doubled_ahead(count: i64, x: f64s) -> None:
    for k in range(count):
        prefetch8(x, 8 * k + 4096)
        store8(x, 8 * k, 2.0 * load8(x, 8 * k))


@pytest.mark.parametrize("plain", [False, True])
def test_asking_for_memory_changes_nothing(plain):
    """Nor does it matter whether there is any."""
    x = np.arange(24.0)
    (doubled_ahead.python if plain else doubled_ahead)(3, x)
    np.testing.assert_array_equal(x, 2.0 * np.arange(24.0))


def test_what_is_asked_for_are_floats():
    @native
    def wrong(x: i64s) -> None:
        prefetch8(x, 0)

    @native
    def too_few(x: f64s) -> None:
        prefetch8(x)

    for function, message in ((wrong, "needs an array of floats"), (too_few, "takes 2 arguments")):
        with pytest.raises(NativeError, match=message):
            function(np.zeros(8, dtype=np.int64))


def test_places_are_integers():
    @native
    def wrong(x: f64s, y: f64s) -> f64:
        return sum8(gather8(x, y, 0))

    with pytest.raises(NativeError, match="32-bit"):
        wrong(np.zeros(8), np.zeros(8))


def test_vectors_are_no_conditions():
    @native
    def compared(x: f64s) -> f64:
        vector = load8(x, 0)
        return 1.0 if vector > 0.0 else 0.0

    with pytest.raises(NativeError, match="vector"):
        compared(np.zeros(8))
