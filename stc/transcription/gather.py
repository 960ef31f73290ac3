"""From the outputs of kernels to matrix entries, in compiled calls.

Nearly every entry is one output of one kernel.  Outputs that add up to an entry are added into the first of them
within the kernels' buffer; after that every entry has one place to come from:

    fold       buffer[into] += buffer[source]        few
    collect    out = scale * buffer[first]           all

An output belongs to no more than one entry, which makes this possible.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.codegen import engine
from stc.codegen.calls import Bound
from stc.codegen.native import NativeFunction, f64, f64s, i32s, i64, i64s, native
from stc.codegen.native_math import fabs
from stc.records import dataclass

FloatArray = NDArray[np.float64]
PlaceArray = NDArray[np.int32]
IntArray = NDArray[np.int64]

#: Entries of more outputs than this (those of parameters: one per frame) are summed in vectors.
FEW = 8
#: Shorter runs of places are gathered one by one.
RUN = 8


@dataclass(slots=True)
class Folding:
    """The outputs that are summed within a buffer.

    Attributes:
        doubled: int32 outputs that are counted twice.
        source, into: (k,) int32 single additions, made in this order.
        long_into: (sums,) int32 where each long sum goes.
        long_start: (sums + 1,) int32 where its outputs begin in ``long_source``.
        long_source: int32 outputs of the long sums, the one they go to excepted.
    """

    doubled: PlaceArray
    source: PlaceArray
    into: PlaceArray
    long_into: PlaceArray
    long_start: PlaceArray
    long_source: PlaceArray

    @classmethod
    def of(cls, start: IntArray, source: IntArray, doubled: IntArray) -> Folding:
        """For entries e that are sums of ``source[start[e]:start[e + 1]]``, one output or more each.

        ``doubled`` are those among all outputs of ``source`` that count twice.
        """
        count = np.diff(start)
        several, many = (count > 1) & (count <= FEW), np.flatnonzero(count > FEW)
        owner = np.repeat(np.arange(len(count)), count)
        later = np.ones(len(source), bool)
        later[start[:-1]] = False
        few = np.flatnonzero(later & several[owner]) if several.any() else np.zeros(0, np.int64)
        # One addition to each entry before the second one to any: consecutive ones do not wait for each other.
        few = few[np.argsort(few - start[owner[few]], kind="stable")]
        first = source[start[:-1]]
        rest = source[later & (count > FEW)[owner]] if len(many) else few[:0]
        return cls(
            _places(doubled),
            _places(source[few]),
            _places(first[owner[few]]),
            _places(first[many]),
            _places(np.concatenate([[0], np.cumsum(count[many] - 1)])),
            _places(rest),
        )

    def changed(self) -> PlaceArray:
        """Positions whose values folding changes."""
        return np.concatenate([self.doubled, self.into, self.long_into])

    def bind(self, buffer: FloatArray) -> list[Bound]:
        """Calls that fold ``buffer``."""
        calls = []
        if len(self.doubled):
            twice = self.doubled
            calls.append(_bind(_fold, _fold_numpy, len(twice), twice, twice, buffer))
        if len(self.into):
            calls.append(_bind(_fold, _fold_numpy, len(self.into), self.source, self.into, buffer))
        if len(self.long_into):
            long = (self.long_into, self.long_start, self.long_source)
            calls.append(_bind(_fold_long, _fold_long_numpy, len(self.long_into), *long, buffer))
        return calls


def _places(values: NDArray[np.integer]) -> PlaceArray:
    return np.ascontiguousarray(values, np.int32)


def begin(status: FloatArray, counter: IntArray) -> Bound:
    """A call that sets ``status`` (1,) to 0 and adds 1 to ``counter`` (1,)."""
    return _bind(_begin, _begin, status, counter)


def place(values: FloatArray, scale: FloatArray, into: FloatArray) -> Bound:
    """A call for ``into = values * scale``; all of one length."""
    if (scale == 1.0).all():
        return _bind(_copy, _copy_numpy, len(values), values, into)
    return _bind(_place, _place_numpy, len(values), values, scale, into)


def note(values: FloatArray, noted: FloatArray, same: IntArray) -> Bound:
    """A call that records ``values`` (k,) in ``noted``, and in ``same`` (1,) whether they were equal already."""
    return _bind(_note, _note_numpy, len(values), values, noted, same)


def all_same(same: IntArray) -> Bound:
    """A call that returns whether all of ``same`` (k,) are 1."""
    return _bind(_all_same, _all_same, len(same), same)


@dataclass(slots=True)
class Copying:
    """The copies from a buffer to its targets: ``out[at] = scale * buffer[source]``.

    Runs of consecutive places are copied, the rest is gathered.  Which those are is found once, whatever the scale.

    Attributes:
        run_source, run_at, run_length: (runs,) int32 of the runs; run_first: which of all places they begin with.
        single_source, single_at: (singles,) int32 of entries in no run; single: which of all places these are.
    """

    run_source: PlaceArray
    run_at: PlaceArray
    run_length: PlaceArray
    run_first: PlaceArray
    single_source: PlaceArray
    single_at: PlaceArray
    single: IntArray

    @classmethod
    def of(cls, source: PlaceArray, at: PlaceArray | None = None) -> Copying:
        """The transfer between two lists of places, both (k,); by default to 0, 1, 2, ..."""
        if at is None:
            at = np.arange(len(source), dtype=np.int32)
        new = np.ones(len(at), bool)
        new[1:] = (source[1:] - source[:-1] != 1) | (at[1:] - at[:-1] != 1)
        begins = np.flatnonzero(new)
        length = np.diff(begins, append=len(at))
        long = length >= RUN
        first = begins[long]
        single = np.flatnonzero(np.repeat(~long, length))
        return cls(
            _places(source[first]),
            _places(at[first]),
            _places(length[long]),
            _places(first),
            _places(source[single]),
            _places(at[single]),
            single,
        )

    @classmethod
    def to(cls, at: PlaceArray) -> Copying:
        """The transfer from places 0, 1, 2, ... to the given ones, (k,)."""
        return cls.of(np.arange(len(at), dtype=np.int32), at)

    def bind(self, buffer: FloatArray, scale: FloatArray, out: FloatArray, status: FloatArray) -> list[Bound]:
        """Calls that copy, and make ``status`` (1,) nan where an entry is not finite; ``scale`` (k,)."""
        calls = []
        if len(self.run_first):
            runs = self.run_source, self.run_at, self.run_length
            common = buffer, out, status
            if (scale == 1.0).all():
                calls.append(_bind(_copy_runs, _copy_runs_numpy, len(self.run_first), *runs, *common))
            else:
                factors = self.run_first, scale
                calls.append(
                    _bind(_scale_runs, _scale_runs_numpy, len(self.run_first), *runs, *factors, *common)
                )
        if len(self.single):
            rest = self.single_source, self.single_at, scale[self.single], buffer, out, status
            calls.append(_bind(_scatter, _scatter_numpy, len(self.single), *rest))
        return calls


def total(
    buffer: FloatArray, source: PlaceArray, scale: FloatArray, out: FloatArray, status: FloatArray
) -> Bound:
    """A call for ``out[0] = scale[0] * sum(buffer[source])``; status as in :meth:`Copying.bind`."""
    return _bind(_total, _total_numpy, len(source), source, scale, buffer, out, status)


def add_up(part: FloatArray, into: FloatArray) -> Bound:
    """A call that adds ``part`` (1,) to ``into`` (1,) and resets it."""
    return _bind(_add_up, _add_up, part, into)


def _bind(compiled: NativeFunction[..., Any], python: Callable[..., Any], *arguments: Any) -> Bound:
    """Machine code, or the equivalent in NumPy."""
    if engine.llvm_wanted():
        return compiled.bind(*arguments)
    if isinstance(python, NativeFunction):
        python = python.python
    return Bound.of_python(python, arguments)


# -- machine code ---------------------------------------------------------------------------------------------------


@native
def _begin(status: f64s, counter: i64s) -> None:
    status[0] = 0.0
    counter[0] += 1


@native
def _add_up(part: f64s, into: f64s) -> None:
    into[0] += part[0]
    part[0] = 0.0


@native
def _copy(count: i64, values: f64s, into: f64s) -> None:
    for k in range(count):
        into[k] = values[k]


@native
def _place(count: i64, values: f64s, scale: f64s, into: f64s) -> None:
    for k in range(count):
        into[k] = values[k] * scale[k]


@native(fast=True)
def _note(count: i64, values: f64s, noted: f64s, same: i64s) -> i64:
    difference = 0.0
    for k in range(count):
        difference += fabs(values[k] - noted[k])
        noted[k] = values[k]
    same[0] = 1 if difference == 0.0 else 0  # nan is not
    return same[0]


@native
def _all_same(count: i64, same: i64s) -> i64:
    for k in range(count):
        if same[k] == 0:
            return 0
    return 1


@native
def _fold(count: i64, source: i32s, into: i32s, buffer: f64s) -> None:
    for k in range(count):
        buffer[into[k]] += buffer[source[k]]


@native(fast=True, inline=True)
def _sum(count: i64, source: i32s, buffer: f64s) -> f64:
    """In parts: the rounding error of a long sum grows with the length of the parts only.

    Four numbers of a part are added at a time, for none has to wait for the one before.
    """
    result = 0.0
    for first in range(0, count, 128):
        end = min(first + 128, count)
        fours = first + 4 * ((end - first) // 4)
        a = 0.0
        b = 0.0
        c = 0.0
        d = 0.0
        for k in range(first, fours, 4):
            a += buffer[source[k]]
            b += buffer[source[k + 1]]
            c += buffer[source[k + 2]]
            d += buffer[source[k + 3]]
        for k in range(fours, end):
            a += buffer[source[k]]
        result += (a + b) + (c + d)
    return result


@native
def _fold_long(sums: i64, into: i32s, start: i32s, source: i32s, buffer: f64s) -> None:
    for k in range(sums):
        first = start[k]
        buffer[into[k]] += _sum(start[k + 1] - first, source[first:], buffer)


@native(fast=True, short=True)
def _copy_runs(
    runs: i64, source: i32s, into: i32s, length: i32s, buffer: f64s, out: f64s, status: f64s
) -> None:
    bad = 0.0
    for run in range(runs):
        values = buffer[source[run] :]
        target = out[into[run] :]
        for k in range(length[run]):
            value = values[k]
            target[k] = value
            bad += 0.0 * value
    status[0] += bad


@native(fast=True, short=True)
def _scale_runs(
    runs: i64,
    source: i32s,
    into: i32s,
    length: i32s,
    first: i32s,
    scale: f64s,
    buffer: f64s,
    out: f64s,
    status: f64s,
) -> None:
    bad = 0.0
    for run in range(runs):
        values = buffer[source[run] :]
        target = out[into[run] :]
        factors = scale[first[run] :]
        for k in range(length[run]):
            value = factors[k] * values[k]
            target[k] = value
            bad += 0.0 * value
    status[0] += bad


@native(fast=True)
def _scatter(count: i64, source: i32s, at: i32s, scale: f64s, buffer: f64s, out: f64s, status: f64s) -> None:
    bad = 0.0
    for k in range(count):
        value = scale[k] * buffer[source[k]]
        out[at[k]] = value
        bad += 0.0 * value
    status[0] += bad


@native
def _total(count: i64, source: i32s, scale: f64s, buffer: f64s, out: f64s, status: f64s) -> None:
    value = scale[0] * _sum(count, source, buffer)
    out[0] = value
    status[0] += 0.0 * value


# -- the same in NumPy ----------------------------------------------------------------------------------------------


def _copy_numpy(count: int, values: FloatArray, into: FloatArray) -> None:
    into[:] = values


def _place_numpy(count: int, values: FloatArray, scale: FloatArray, into: FloatArray) -> None:
    np.multiply(values, scale, out=into)


def _note_numpy(count: int, values: FloatArray, noted: FloatArray, same: IntArray) -> int:
    same[0] = np.array_equal(values, noted)
    noted[:] = values
    return int(same[0])


@np.errstate(all="ignore")
def _fold_numpy(count: int, source: PlaceArray, into: PlaceArray, buffer: FloatArray) -> None:
    np.add.at(buffer, into, buffer[source])


@np.errstate(all="ignore")
def _fold_long_numpy(
    sums: int, into: PlaceArray, start: PlaceArray, source: PlaceArray, buffer: FloatArray
) -> None:
    buffer[into] += np.add.reduceat(buffer[source], start[:-1])


@np.errstate(all="ignore")
def _copy_runs_numpy(
    runs: int,
    source: PlaceArray,
    into: PlaceArray,
    length: PlaceArray,
    buffer: FloatArray,
    out: FloatArray,
    status: FloatArray,
) -> None:
    ones = np.ones(int(length.sum()))
    _scale_runs_numpy(runs, source, into, length, np.cumsum(length) - length, ones, buffer, out, status)


@np.errstate(all="ignore")
def _scale_runs_numpy(
    runs: int,
    source: PlaceArray,
    into: PlaceArray,
    length: PlaceArray,
    first: NDArray[np.integer],
    scale: FloatArray,
    buffer: FloatArray,
    out: FloatArray,
    status: FloatArray,
) -> None:
    within = np.arange(int(length.sum())) - np.repeat(np.cumsum(length) - length, length)
    at = np.repeat(into, length) + within
    values = scale[np.repeat(first, length) + within] * buffer[np.repeat(source, length) + within]
    out[at] = values
    status[0] += (0.0 * values).sum()


@np.errstate(all="ignore")
def _scatter_numpy(
    count: int,
    source: PlaceArray,
    at: PlaceArray,
    scale: FloatArray,
    buffer: FloatArray,
    out: FloatArray,
    status: FloatArray,
) -> None:
    values = scale * buffer[source]
    out[at] = values
    status[0] += (0.0 * values).sum()


@np.errstate(all="ignore")
def _total_numpy(
    count: int, source: PlaceArray, scale: FloatArray, buffer: FloatArray, out: FloatArray, status: FloatArray
) -> None:
    out[0] = scale[0] * buffer[source].sum()
    status[0] += 0.0 * out[0]
