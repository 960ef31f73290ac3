"""From the outputs of kernels to matrix entries, in compiled calls.

Nearly every entry is one output of one kernel.  Outputs that add up to an entry are added into the first of them
within the kernels' buffer; after that every entry has one place to come from:

    fold       buffer[into] += buffer[source]        few
    collect    out = scale * buffer[first]           all

An output belongs to no more than one entry, which makes this possible.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.calls import Bound
from stc.core.functions import function
from stc.records import dataclass

FloatArray = NDArray[np.float64]
PlaceArray = NDArray[np.int32]
IntArray = NDArray[np.int64]

_begin = function("gather_begin")
_add_up = function("gather_add_up")
_copy = function("gather_copy")
_place = function("gather_place")
_note = function("gather_note")
_all_same = function("gather_all_same")
_fold = function("gather_fold")
_fold_long = function("gather_fold_long")
_copy_runs = function("gather_copy_runs")
_scale_runs = function("gather_scale_runs")
_scatter = function("gather_scatter")
_total = function("gather_total")

#: Entries of more outputs than this (those of parameters: one per frame) are summed in vectors.
FEW = 8
#: Shorter runs of places are gathered one by one.
RUN = 8


@dataclass(slots=True)
class Folding:
    """Which outputs are added up within a buffer.

    Attributes:
        doubled: int32 outputs that count twice.
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
        """The positions in the buffer that adding up changes."""
        return np.concatenate([self.doubled, self.into, self.long_into])

    def bind(self, buffer: FloatArray) -> list[Bound]:
        """Calls that fold ``buffer``."""
        calls: list[Bound] = []
        if len(self.doubled):
            twice = self.doubled
            calls.append(_fold.bind(len(twice), twice, twice, buffer))
        if len(self.into):
            calls.append(_fold.bind(len(self.into), self.source, self.into, buffer))
        if len(self.long_into):
            long = (self.long_into, self.long_start, self.long_source)
            calls.append(_fold_long.bind(len(self.long_into), *long, buffer))
        return calls


def _places(values: NDArray[np.integer]) -> PlaceArray:
    return np.ascontiguousarray(values, np.int32)


def begin(status: FloatArray, counter: IntArray) -> Bound:
    """A call that sets ``status`` (1,) to 0 and adds 1 to ``counter`` (1,)."""
    return _begin.bind(status, counter)


def place(values: FloatArray, scale: FloatArray, into: FloatArray) -> Bound:
    """A call for ``into = values * scale``; all of one length."""
    if (scale == 1.0).all():
        return _copy.bind(len(values), values, into)
    return _place.bind(len(values), values, scale, into)


def note(values: FloatArray, noted: FloatArray, same: IntArray) -> Bound:
    """A call that tells, by ``same`` (1,) too, whether ``noted`` is ``values`` (k,) already; from then on it is."""
    return _note.bind(len(values), values, noted, same)


def all_same(same: IntArray) -> Bound:
    """A call that tells whether all of ``same`` (k,) are 1."""
    return _all_same.bind(len(same), same)


@dataclass(slots=True)
class Copying:
    """What is copied from a buffer to where it belongs: ``out[at] = scale * buffer[source]``.

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
        calls: list[Bound] = []
        if len(self.run_first):
            runs = self.run_source, self.run_at, self.run_length
            common = buffer, out, status
            if (scale == 1.0).all():
                calls.append(_copy_runs.bind(len(self.run_first), *runs, *common))
            else:
                factors = self.run_first, scale
                calls.append(_scale_runs.bind(len(self.run_first), *runs, *factors, *common))
        if len(self.single):
            rest = self.single_source, self.single_at, scale[self.single], buffer, out, status
            calls.append(_scatter.bind(len(self.single), *rest))
        return calls


def total(
    buffer: FloatArray, source: PlaceArray, scale: FloatArray, out: FloatArray, status: FloatArray
) -> Bound:
    """A call for ``out[0] = scale[0] * sum(buffer[source])``; status as in :meth:`Copying.bind`."""
    return _total.bind(len(source), source, scale, buffer, out, status)


def add_up(part: FloatArray, into: FloatArray) -> Bound:
    """A call that adds ``part`` (1,) to ``into`` (1,) and sets ``part`` to 0."""
    return _add_up.bind(part, into)
