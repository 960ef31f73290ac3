"""Vectors of eight in compiled functions, against NumPy and against plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.native import NativeError, f64, f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import (
    abs8,
    absw,
    gather8,
    largest8,
    load8,
    loadw,
    masked8,
    max8,
    maxw,
    negative8,
    negativew,
    prefetch8,
    scatter8,
    splat8,
    splatw,
    spread8,
    store8,
    storew,
    stream8,
    sum8,
    sums8,
    wide,
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


@native(fused=True)
def by_registers(rows: i64, x: f64s, most: f64s, total: f64s, negative: f64s) -> i64:
    part = 0
    turns = 0
    while part < 8:
        signs = splatw(0.0)
        total_of_part = splatw(0.5)
        for k in range(rows):
            value = loadw(x, 8 * k + part)
            total_of_part += 2.0 * value / (k + 1)
            signs += negativew(value)
            storew(most, part, maxw(absw(value), loadw(most, part)))
        storew(total, part, total_of_part)
        storew(negative, part, signs)
        part += wide()
        turns += 1
    return turns


@pytest.mark.parametrize("plain", [False, True])
def test_as_many_as_registers_hold(plain):
    x, most, total, negative = (
        np.random.default_rng(5).normal(size=(6, 8)),
        np.ones(8),
        np.zeros(8),
        np.zeros(8),
    )
    call = by_registers.python if plain else by_registers
    turns = call(6, x.reshape(-1), most, total, negative)
    compiled = not plain and by_registers.is_compiled
    assert turns == (8 // engine.vector_width() if compiled else 1)
    np.testing.assert_array_equal(most, np.maximum(1.0, np.abs(x).max(axis=0)))
    np.testing.assert_allclose(total, 0.5 + 2.0 * (1.0 / np.arange(1, 7)) @ x, rtol=1e-14)
    np.testing.assert_array_equal(negative, (x < 0.0).sum(axis=0))


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
def picked(masks: i32s, x: f64s, out: f64s) -> None:
    for k in range(4):
        store8(out, 8 * k, masked8(x, masks[2 * k], masks[2 * k + 1]))


@pytest.mark.parametrize("plain", [False, True])
def test_where_the_mask_is_0_nothing_needs_to_be(plain):
    rng = np.random.default_rng(5)
    x, out = rng.normal(size=13), np.full(32, np.nan)
    masks = np.array([[-3, 0b00111000], [8, 0b00011111], [2, 0], [1, 255]], dtype=np.int32)
    expected = np.zeros((4, 8))
    expected[0, 3:6], expected[1, :5], expected[3] = x[:3], x[8:], x[1:9]
    (picked.python if plain else picked)(masks.reshape(-1), x, out)
    np.testing.assert_array_equal(out, expected.reshape(-1))


@native(fast=True)
def summed(x: f64s, out: f64s) -> None:
    store8(out, 1, sums8(x, 3))


@pytest.mark.parametrize("plain", [False, True])
def test_sums_of_eight_vectors(plain):
    x, out = np.random.default_rng(6).normal(size=70), np.zeros(10)
    (summed.python if plain else summed)(x, out)
    np.testing.assert_allclose(out[1:9], x[3:67].reshape(8, 8).sum(axis=1), rtol=1e-13)
    assert out[0] == out[9] == 0.0


@native
def turned(x: f64s, places: i32s, out: f64s) -> None:
    spread8(x, places, 1, out, 8, 32, 0, 20)


@pytest.mark.parametrize("plain", [False, True])
def test_four_vectors_whose_lanes_follow_one_another(plain):
    x, places = (
        np.random.default_rng(7).normal(size=50),
        np.array([99, 3, 46, 0, 7, 8, 21, 21, 40], dtype=np.int32),
    )
    out = np.full(42, np.nan)
    (turned.python if plain else turned)(x, places, out)
    for ahead, at in enumerate((8, 32, 0, 20)):
        np.testing.assert_array_equal(out[at : at + 8], x[places[1:] + ahead])
    assert np.isnan(out[[16, 19, 28, 31, 40]]).all()


def test_what_is_picked_and_summed_are_floats():
    @native
    def wrong(x: i64s) -> f64:
        return sum8(masked8(x, 0, 255))

    @native
    def too_few(x: f64s) -> f64:
        return sum8(masked8(x, 0))

    @native
    def wrong_sums(x: i64s) -> f64:
        return sum8(sums8(x, 0))

    @native
    def too_many(x: f64s) -> f64:
        return sum8(sums8(x, 0, 1))

    @native
    def wrong_places(x: f64s) -> None:
        spread8(x, x, 0, x, 0, 8, 16, 24)

    @native
    def too_few_places(x: f64s, places: i32s) -> None:
        spread8(x, places, 0, x, 0, 8)

    for function, message in (
        (wrong, "needs an array of floats"),
        (too_few, "takes 3 arguments"),
        (wrong_places, "one of 32-bit integers"),
        (too_few_places, "takes 8 arguments"),
        (wrong_sums, "needs an array of floats"),
        (too_many, "takes 2 arguments"),
    ):
        with pytest.raises(NativeError, match=message):
            function(np.zeros(64, dtype=np.int64))


@native
def doubled_past_caches(count: i64, x: f64s, out: f64s) -> f64:
    for k in range(count):
        stream8(out, 8 * k, 2.0 * load8(x, 8 * k))
    return out[8 * count - 1]


@pytest.mark.parametrize("plain", [False, True])
def test_what_is_written_past_the_caches_is_there(plain):
    x, out = np.arange(80.0), aligned_zeros(88)
    last = (doubled_past_caches.python if plain else doubled_past_caches)(10, x, out)
    assert last == 158.0
    np.testing.assert_array_equal(out, np.concatenate([2.0 * x, np.zeros(8)]))


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
