"""Functions given by tables: piecewise polynomials of one or two arguments, as numbers and as leaves of expressions.

Between neighbouring abscissae a function of one argument is a cubic polynomial, in a variable that is zero at the left
one.  There are two more pieces outside of the table, so that extrapolation needs no special code.
A function of two arguments is the same thing twice: interpolation is linear in what is interpolated, so that the
coefficients along the first argument are themselves interpolated along the second one (de Boor, A Practical Guide to
Splines, chapter 17).

In an expression a table is a leaf, ``look(x, T)`` its value at ``x`` and ``look(x, at(y, T))`` that of one with two
arguments: operators have two operands at most, and ``at`` only carries the second argument.  A
derivative is the same with another leaf, a :class:`TableRef` of a higher order.
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass

__all__ = ["KINDS", "OUTSIDE", "At", "Table", "TableRef", "interpolated", "look"]

FloatArray = NDArray[np.float64]

KINDS: Final = ("cubic", "monotone", "linear")
"""The interpolations: with continuous second derivatives, without overshoot, or linear."""

OUTSIDE: Final = ("extend", "hold", "error")
"""The continuations outside a table: a straight line with the slope at the end, the last value, or none."""

ORDER: Final = 4
"""Coefficients per piece and argument: those of a cubic polynomial, from the constant term up."""

# ---- how tables lie in memory, see ``storage`` -----------------------------------------------------------------------

AXIS: Final = 7
LOWEST, SCALE, LAST, BUCKETS, BEGINS, ORIGIN, STEP = range(AXIS)
"""Places in the header of an axis.

``LOWEST``, ``SCALE``, ``LAST``: ``(x - LOWEST)*SCALE``, rounded down and kept between 0 and ``LAST``, is the piece of x
where places are evenly spaced, else its bucket.
``ORIGIN``, ``STEP``: for evenly spaced places; piece k is zero at ``ORIGIN + k*STEP``.
``BUCKETS``: for other places; the index of the description of the buckets, counted from the first number of the table.
If no bucket has more than :data:`TOLD` places in it, each is described by four numbers: the zero of its first piece,
the places after it, and the number of this piece; otherwise by that number alone.
``BEGINS``: in the latter case, the index of the zeros and the beginnings of all pieces, counted likewise.
"""
BUCKET: Final = 4
FIRST: Final = BUCKET - 1
TOLD: Final = BUCKET - 2
"""The index of the first piece's number among the numbers of a bucket, and the number of places among them."""
HEADER: Final = 2 * AXIS + 2
COEFFICIENTS, ROW = 2 * AXIS, 2 * AXIS + 1
"""After the headers of two axes: the index of the first coefficient, and the stride of the first argument."""

CLIP, REACHES, READ = "clip", "reaches", "read"
"""The operations of a look-up (:data:`stc.codegen.tape.LOOKUPS`)."""

MOST_BUCKETS: Final = 1 << 18
"""Largest number of buckets, unless the table has more places."""
MOST_AT_HAND: Final = 1 << 12
"""Number of buckets that fit into the nearest caches."""
#: Places that are as even as rounding lets them be are taken to be so, in units of the last digit of the largest.
_EVEN: Final = 4.0
_SLACK: Final = 2.0**-46


class Axis:
    """The abscissae of a table along one argument.

    Args:
        x: (k,) numbers, strictly rising, two or more.

    Attributes:
        begins: where all pieces but the first one begin: the last place itself belongs to the table.
        origins: where each piece's variable is zero.
        search: 0 for evenly spaced points; up to :data:`TOLD` the largest number of points in a bucket; above it, that
            number plus the bisection steps that find a piece in its bucket.
    """

    def __init__(self, x: FloatArray) -> None:
        self.x = np.array(x, dtype=np.float64)
        self.x.flags.writeable = False
        self.begins = self.x.copy()
        self.begins[-1] = np.nextafter(self.x[-1], np.inf)
        low, high, last = self.x[0], self.x[-1], len(self.x) - 1
        self.step = float((high - low) / last)
        off = np.abs(self.x - (low + self.step * np.arange(last + 1))).max()
        even = off <= _EVEN * np.spacing(max(abs(low), abs(high)))
        self._buckets = last
        self._scale = float(last / (high - low))
        self._of_knot = np.zeros(0, np.int64)
        self.search = 0 if even else self._fill_buckets()
        self.origins = np.concatenate([[low - self.step] if even else [low], self.x])

    def _fill_buckets(self) -> int:
        """Choose the number of buckets so that hardly any contains several points, and how these are distinguished.

        Comparing an argument with two or three places costs less than to wait for a bucket that is not in a cache.
        """
        count, best = len(self.x), 0
        buckets = count - 1
        most = max(min(16 * count + 4096, MOST_BUCKETS), count)
        while not best or (buckets <= most and best > (1 if buckets <= MOST_AT_HAND else TOLD)):
            scale = float(buckets / (self.x[-1] - self.x[0]))
            of_knot = np.clip((self.begins - self.x[0]) * scale, 0.0, buckets - 1.0).astype(np.int64)
            fullest = int(np.bincount(of_knot).max())
            if not best or fullest < best:
                best, self._buckets, self._scale, self._of_knot = fullest, buckets, scale, of_knot
            buckets *= 2
        return best if best <= TOLD else TOLD + best.bit_length()

    @property
    def halved(self) -> int:
        """The number of bisection steps that find a piece in its bucket; 0 if a bucket lists its points."""
        return max(self.search - TOLD, 0)

    def __len__(self) -> int:
        """The number of pieces, including those outside."""
        return len(self.x) + 1

    def pieces(self, x: Any) -> NDArray[np.intp]:
        """The index of the piece that contains each argument."""
        return np.searchsorted(self.begins, np.real(x), side="right")

    def storage(self, at: int) -> tuple[FloatArray, FloatArray]:
        """The header, and what lies at ``at``, counted from the first number of the table."""
        header = np.zeros(AXIS)
        header[SCALE] = self._scale
        if not self.search:  # the first piece is the one to the left
            count, origin, high = len(self.x), float(self.origins[0]), float(self.x[-1])
            # Both ends belong to the table, whatever rounding does: pieces begin a little earlier than they should,
            # and the last one lasts a little longer.
            slack = _SLACK * max(abs(origin), abs(high))
            header[LOWEST], header[LAST] = origin - slack, count
            header[SCALE] = count * (1.0 - _SLACK / 16.0) / (high - origin + slack)
            header[ORIGIN], header[STEP] = origin, self.step
            return header, np.zeros(0)
        first = np.searchsorted(self._of_knot, np.arange(self._buckets))
        header[LOWEST], header[LAST] = self.x[0], self._buckets - 1
        header[BUCKETS] = at
        if not self.halved:
            # The last ones tell places before them as well, which all numbers in them reach.
            first = np.minimum(first, len(self.x) - self.search)
            zeros = np.concatenate([self.origins[:1], self.begins, self.begins[-1:]])
            return header, np.column_stack([*(zeros[first + k] for k in range(TOLD + 1)), first]).ravel()
        header[BEGINS] = at + len(first)
        # A search ends at most at the last piece: what follows it no number reaches.
        beyond = np.full(1 << self.halved, np.nan)
        return header, np.concatenate([first.astype(np.float64), self.x[:1], self.begins, beyond])


class Table:
    """A function of one or two arguments, given by numbers.

    Attributes:
        axes: one for each argument.
        coefficients: (pieces, 4) or (pieces of the first axis, pieces of the second one, 4, 4).
        degree: of the pieces as polynomials in each argument: 0, 1 or 3.
        kind: how it is interpolated, of :data:`KINDS`, or ``steps``.
        outside: its continuation, one of :data:`OUTSIDE`.
        digest: distinguishes it from tables with other numbers.
    """

    def __init__(
        self, axes: Sequence[Axis], coefficients: FloatArray, degree: int, kind: str, outside: str
    ) -> None:
        self.axes = tuple(axes)
        self.coefficients = np.ascontiguousarray(coefficients, dtype=np.float64)
        self.coefficients.flags.writeable = False
        self.degree = degree
        self.kind = kind
        self.outside = outside
        content = sha256(f"{kind} {outside} {self.coefficients.shape}".encode())
        for array in (*(axis.x for axis in axes), self.coefficients):
            content.update(array.tobytes())
        self.digest = str(content.hexdigest())
        self._storage: FloatArray | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def value(self, arguments: Sequence[Any], orders: Sequence[int]) -> Any:
        """The function, or a partial derivative of it, at arguments of any common shape; one NumPy pass each."""
        with np.errstate(all="ignore"):
            return self._value(arguments, orders)

    def _value(self, arguments: Sequence[Any], orders: Sequence[int]) -> Any:
        where = tuple(axis.pieces(x) for axis, x in zip(self.axes, arguments, strict=True))
        found = self.coefficients[where]
        for axis, x, piece, order in zip(self.axes, arguments, where, orders, strict=True):
            # Of what is left the coefficients of this argument stand in the first axis after those of the places.
            at = np.asarray(x - axis.origins[piece])
            rank = at.ndim
            at = at.reshape(at.shape + (1,) * (found.ndim - rank - 1))
            result: Any = 0.0
            for k in reversed(range(order, ORDER)):
                factor = 1.0
                for j in range(order):
                    factor *= k - j
                result = result * at + factor * found[(slice(None),) * rank + (k,)]
            # Beyond the last order there is nothing left but where there is no value.
            found = np.asarray(result) + (
                0.0 * found[(slice(None),) * rank + (0,)] if order >= ORDER else 0.0
            )
        return found[()]

    def storage(self) -> FloatArray:
        """All numbers in a row, as compiled programs look them up; places are counted from the first one."""
        if self._storage is None:
            self._storage = self._stored()
        return self._storage

    def _stored(self) -> FloatArray:
        head = np.zeros(HEADER)
        parts: list[FloatArray] = [head]
        end = HEADER
        for k, axis in enumerate(self.axes):
            head[AXIS * k : AXIS * (k + 1)], search = axis.storage(end)
            parts.append(search)
            end += len(search)
        head[COEFFICIENTS] = end
        head[ROW] = self.coefficients[0].size
        # four numbers are read together, though fewer may be wanted
        return np.concatenate([*parts, self.coefficients.ravel(), np.zeros(ORDER)])


@dataclass(frozen=True, slots=True)
class TableRef:
    """A table in an expression, or a partial derivative of it: the payload of a leaf.

    Attributes:
        name: its name in the spec.
        table: the numbers.
        orders: how often it is differentiated by each argument.
        of_time: a reference: its argument is always the time.
    """

    name: str
    table: Table
    orders: tuple[int, ...]
    of_time: bool = False

    def __repr__(self) -> str:
        # What is derived from expressions is kept under their text, whatever the numbers are.
        searches = [axis.search for axis in self.table.axes]
        return f"TableRef({self.name!r}, {self.orders}, {self.table.degree}, {searches})"

    def __str__(self) -> str:
        if not any(self.orders):
            return self.name
        if len(self.orders) == 1:
            return self.name + "'" * self.orders[0]
        return f"{self.name}_{'x' * self.orders[0]}{'y' * self.orders[1]}"

    @property
    def base(self) -> TableRef:
        """The function that this is a derivative of."""
        return TableRef(self.name, self.table, (0,) * len(self.orders), self.of_time)

    def derivative(self, argument: int) -> TableRef | None:
        """The partial derivative by an argument, counted from 0; None if it is zero everywhere."""
        orders = tuple([order + (k == argument) for k, order in enumerate(self.orders)])
        if max(orders) > self.table.degree:
            return None
        return TableRef(self.name, self.table, orders, self.of_time)


class At(NamedTuple):
    """The value of ``at(y, T)``: a second argument for a table."""

    second: Any
    ref: TableRef


def look(x: Any, place: TableRef | At, by: int | None = None) -> Any:
    """The value of ``look(x, place)``; ``by`` asks for its slope by that argument instead."""
    second, ref = (place.second, place.ref) if isinstance(place, At) else (None, place)
    wanted = ref if by is None else ref.derivative(by)
    if wanted is None:
        return 0.0 * x
    if second is None:
        return ref.table.value([x], wanted.orders)
    return ref.table.value(np.broadcast_arrays(x, second), wanted.orders)


# ---- interpolation ---------------------------------------------------------------------------------------------------


def interpolated(abscissae: Sequence[FloatArray], values: FloatArray, kind: str, outside: str) -> Table:
    """The table that takes given values at given places.

    Args:
        abscissae: one or two lists of numbers, strictly rising, (k,) or (k,) and (m,); two numbers at least each.
        values: (k,) or (k, m), finite.  Coefficients that are too large for numbers come out infinite.
        kind: of :data:`KINDS`.  ``cubic`` is the spline with continuous second derivatives whose third derivative is
            continuous at the second and the last but one place too ("not a knot"; de Boor, chapter IV), a parabola
            through three places and a line through two; ``monotone`` rises and falls where the numbers do (Fritsch
            and Butland, SIAM J. Sci. Stat. Comput. 5, 1984), with continuous first derivatives only.
        outside: of :data:`OUTSIDE`.
    """
    axes = [Axis(np.asarray(x, dtype=np.float64)) for x in abscissae]
    slopes_of = {"cubic": _spline_slopes, "monotone": _monotone_slopes, "linear": _line_slopes}[kind]
    found = np.asarray(values, dtype=np.float64)
    with np.errstate(all="ignore"):
        for number, axis in enumerate(axes):
            # (pieces, 4, ...) along the first axis; then those of the axis before come last
            along = np.moveaxis(found, 2 * number, 0)
            pieces = _pieces(axis.x, axis.origins[0], along, slopes_of, kind, outside)
            found = np.moveaxis(pieces, (0, 1), (2 * number, 2 * number + 1))
    if len(axes) == 2:
        found = found.transpose(0, 2, 1, 3)
    return Table(axes, found, 1 if kind == "linear" else 3, kind, outside)


def _pieces(
    x: FloatArray, origin: float, values: FloatArray, slopes_of: Any, kind: str, outside: str
) -> FloatArray:
    """Coefficients (k + 1, 4, ...) of the pieces between k places and outside, of values (k, ...).

    ``origin`` is where the variable of the first piece is zero.
    """
    step = np.diff(x).reshape(-1, *(1,) * (values.ndim - 1))
    secant = np.diff(values, axis=0) / step
    slope = slopes_of(step, secant)
    found = np.zeros((len(x) + 1, ORDER, *values.shape[1:]))
    found[1:-1, 0] = values[:-1]
    if kind == "linear":
        found[1:-1, 1] = secant
        ends = secant[0], secant[-1]
    else:
        bend = (slope[:-1] + slope[1:] - 2.0 * secant) / step
        found[1:-1, 1] = slope[:-1]
        found[1:-1, 2] = (secant - slope[:-1]) / step - bend
        found[1:-1, 3] = bend / step
        ends = slope[0], slope[-1]
    off = x[0] - origin  # how far the variable of the first piece is from zero where the table begins
    for piece, value, end in ((0, values[0] - off * ends[0], ends[0]), (-1, values[-1], ends[1])):
        found[piece, 0] = value if outside == "extend" else np.nan
        found[piece, 1] = end if outside == "extend" else 0.0
    if outside == "hold":
        found[0, 0], found[-1, 0] = values[0], values[-1]
    return found


def _line_slopes(step: FloatArray, secant: FloatArray) -> FloatArray:
    return secant


def _spline_slopes(step: FloatArray, secant: FloatArray) -> FloatArray:
    """The slopes at all places that make second derivatives continuous, (k, ...) from k - 1 steps and secants."""
    count = len(step) + 1
    if count == 2:
        return np.concatenate([secant, secant])
    if count == 3:  # one parabola
        middle = (step[1] * secant[0] + step[0] * secant[1]) / (step[0] + step[1])
        return np.stack([2.0 * secant[0] - middle, middle, 2.0 * secant[1] - middle])
    h = step.ravel().tolist()
    diagonal = [h[1], *(2.0 * (a + b) for a, b in pairwise(h)), h[-2]]
    below = [0.0, *h[1:], h[-2] + h[-1]]
    above = [h[0] + h[1], *h[:-1], 0.0]
    ends = [
        ((near + 2.0 * (near + far)) * far * own + near * near * other) / (near + far)
        for near, far, own, other in (
            (h[0], h[1], secant[0], secant[1]),
            (h[-1], h[-2], secant[-1], secant[-2]),
        )
    ]
    inner = 3.0 * (step[1:] * secant[:-1] + step[:-1] * secant[1:])
    right: list[Any] = [ends[0], *(inner.tolist() if inner.ndim == 1 else inner), ends[1]]
    for k in range(1, count):  # without pivots: the rows between the ends are dominated by their diagonals
        factor = below[k] / diagonal[k - 1]
        diagonal[k] -= factor * above[k - 1]
        right[k] = right[k] - factor * right[k - 1]
    right[-1] = right[-1] / diagonal[-1]
    for k in range(count - 2, -1, -1):
        right[k] = (right[k] - above[k] * right[k + 1]) / diagonal[k]
    return np.array(right)


def _monotone_slopes(step: FloatArray, secant: FloatArray) -> FloatArray:
    """Weighted harmonic means of neighbouring secants, zero where these have different signs."""
    if len(step) == 1:
        return np.concatenate([secant, secant])
    before, after = secant[:-1], secant[1:]
    one, other = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    same = before * after > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(same, (one + other) / (one / before + other / after), 0.0)
    return np.concatenate(
        [_end_slope(step[0], step[1], secant[0], secant[1])[None], inner,
         _end_slope(step[-1], step[-2], secant[-1], secant[-2])[None]]
    )  # fmt: skip


def _end_slope(near: Any, next_: Any, first: Any, second: Any) -> FloatArray:
    """The slope at an end of three places, kept from overshooting."""
    slope = ((2.0 * near + next_) * first - near * second) / (near + next_)
    slope = np.where(np.sign(slope) != np.sign(first), 0.0, slope)
    overshoots = (np.sign(first) != np.sign(second)) & (np.abs(slope) > 3.0 * np.abs(first))
    return np.asarray(np.where(overshoots, 3.0 * first, slope))
