"""Looking up a table's piece and its numbers: the meaning of ``locate`` and ``read`` in NumPy, and as instructions.

How tables lie in memory is told in :mod:`stc.symbolic.tables`.  To find the piece that a number lies in takes one step
where no bucket has two knots in it, and few where some have: the same number of steps for every lane, without a branch
that depends on it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.codegen.vector import Vector
from stc.symbolic.tables import (
    BUCKETS,
    KNOTS,
    LAST_BUCKET,
    LOWEST,
    PIECES,
    SCALE,
    STRIDE,
    WIDTH,
)

__all__ = ["locate_call", "locate_definition", "meaning_of_locate", "meaning_of_read", "places", "read"]

FloatArray = NDArray[np.float64]


def meaning_of_locate(numbers: FloatArray, x: Any, table: Any) -> Any:
    """Where in ``numbers`` the piece begins that each x lies in, of the table that begins at ``table``."""
    begin = int(np.ravel(table)[0])
    head = numbers[begin:]
    bucket = np.multiply(np.subtract(x, head[LOWEST]), head[SCALE])
    bucket = np.where(bucket > 0.0, bucket, 0.0)
    bucket = np.where(bucket < head[LAST_BUCKET], bucket, head[LAST_BUCKET]).astype(np.int64)
    piece = head[int(head[BUCKETS]) + bucket].astype(np.int64)
    knots = head[int(head[KNOTS]) :]
    stride = int(head[STRIDE])
    while stride:
        piece = np.where(knots[piece + stride] <= x, piece + stride, piece)
        stride //= 2
    return begin + head[PIECES] + head[WIDTH] * piece


def meaning_of_read(numbers: FloatArray, place: Any, k: Any) -> Any:
    """The numbers ``k`` places after given ones."""
    return numbers[np.add(place, k).astype(np.int64)]


def locate_call(v: Vector, x: str, table: str) -> str:
    """The call of the function for so many lanes."""
    return v.let(f"call {v.f} @locate.{v.suffix}({v.f} {x}, {v.f} {table}, ptr %uniform)")


def locate_definition(lanes: int) -> str:
    """The function for so many lanes, ``locate``: an argument for each lane, a table for all, the numbers."""
    lines: list[str] = []
    v = Vector(lines, lanes, False, "l")
    table = _lanes(v, v.f, "%table")[0]
    begin = v.let(f"fptosi double {table} to i64")
    head = v.let(f"getelementptr inbounds double, ptr %uniform, i64 {begin}")

    def number(place: int) -> str:
        pointer = v.let(f"getelementptr inbounds double, ptr {head}, i64 {place}")
        return v.let(f"load double, ptr {pointer}, align 8")

    def spread(value: str) -> str:
        if lanes == 1:
            return value
        first = v.let(f"insertelement {v.f} poison, double {value}, i64 0")
        return v.let(f"shufflevector {v.f} {first}, {v.f} poison, <{lanes} x i32> zeroinitializer")

    def part(place: int) -> str:
        offset = v.let(f"fptosi double {number(place)} to i64")
        return v.let(f"getelementptr inbounds double, ptr {head}, i64 {offset}")

    last = spread(number(LAST_BUCKET))
    bucket = v.mul(v.sub("%x", spread(number(LOWEST))), spread(number(SCALE)))
    bucket = v.select(
        v.compare("ogt", bucket, v.real(0.0)), bucket, v.real(0.0)
    )  # what is no number is in the first
    bucket = v.select(v.compare("olt", bucket, last), bucket, last)
    buckets, knots = part(BUCKETS), part(KNOTS)
    stride = v.let(f"fptosi double {number(STRIDE)} to i64")
    pieces = v.let(f"fptosi double {number(PIECES)} to i64")
    width = v.let(f"fptosi double {number(WIDTH)} to i64")
    first = v.let(f"add i64 {begin}, {pieces}")
    found = []
    for place in places(v, bucket):
        pointer = v.let(f"getelementptr inbounds double, ptr {buckets}, i64 {place}")
        value = v.let(f"load double, ptr {pointer}, align 8")
        found.append(v.let(f"fptosi double {value} to i64"))
    each = _lanes(v, v.f, "%x")
    any_ = v.let(f"icmp ne i64 {stride}, 0")
    before = [f"  br i1 {any_}, label %search, label %found", "search:"]
    lines += before
    begins = [v.name() for _ in range(lanes)]
    further, left, ends = v.name(), v.name(), []
    lines.append(f"  {further} = phi i64 [ {stride}, %entry ], [ {left}, %search ]")
    at = len(lines)
    for k in range(lanes):
        there = v.let(f"add i64 {begins[k]}, {further}")
        pointer = v.let(f"getelementptr inbounds double, ptr {knots}, i64 {there}")
        knot = v.let(f"load double, ptr {pointer}, align 8")
        beyond = v.let(f"fcmp ole double {knot}, {each[k]}")
        ends.append(v.let(f"select i1 {beyond}, i64 {there}, i64 {begins[k]}"))
    lines[at:at] = [
        f"  {begins[k]} = phi i64 [ {found[k]}, %entry ], [ {ends[k]}, %search ]" for k in range(lanes)
    ]
    lines.append(f"  {left} = lshr i64 {further}, 1")
    more = v.let(f"icmp ne i64 {left}, 0")
    lines += [f"  br i1 {more}, label %search, label %found", "found:"]
    pieces_found = [v.name() for _ in range(lanes)]
    lines += [
        f"  {pieces_found[k]} = phi i64 [ {found[k]}, %entry ], [ {ends[k]}, %search ]" for k in range(lanes)
    ]
    result = "poison"
    for k in range(lanes):
        skipped = v.let(f"mul i64 {pieces_found[k]}, {width}")
        place = v.let(f"add i64 {first}, {skipped}")
        value = v.let(f"sitofp i64 {place} to double")
        result = value if lanes == 1 else v.let(f"insertelement {v.f} {result}, double {value}, i64 {k}")
    head_line = (
        f"define internal {v.f} @locate.{v.suffix}({v.f} %x, {v.f} %table, ptr noalias readonly %uniform)"
    )
    return "\n".join(
        [f"{head_line} noinline nounwind {{", "entry:", *lines, f"  ret {v.f} {result}", "}", ""]
    )


def places(v: Vector, place: str) -> list[str]:
    """The whole numbers in a vector, below 2^31, as a register for each lane."""
    if v.lanes == 1:
        return [v.let(f"fptosi double {place} to i64")]
    whole = f"<{v.lanes} x i32>"
    numbers = v.let(f"fptosi {v.f} {place} to {whole}")
    return [v.let(f"sext i32 {lane} to i64") for lane in _lanes(v, whole, numbers)]


def read(v: Vector, at: list[str], k: int = 0) -> str:
    """The numbers ``k`` places after given ones (:func:`places`)."""
    result = "poison"
    for lane, place in enumerate(at):
        pointer = v.let(f"getelementptr inbounds double, ptr %uniform, i64 {place}")
        if k:
            pointer = v.let(f"getelementptr inbounds double, ptr {pointer}, i64 {k}")
        value = v.let(f"load double, ptr {pointer}, align 8")
        result = value if v.lanes == 1 else v.let(f"insertelement {v.f} {result}, double {value}, i64 {lane}")
    return result


def _lanes(v: Vector, type_: str, vector: str) -> list[str]:
    if v.lanes == 1:
        return [vector]
    return [v.let(f"extractelement {type_} {vector}, i64 {k}") for k in range(v.lanes)]
