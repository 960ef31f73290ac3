"""Node values of one quantity along a motion, and the curve that a transcription defines through them.

A motion has frames ``0..n`` at times ``time[0] < ... < time[n]``; step i runs from frame i to frame i+1.
Inside a step every curve is a polynomial in ``s``, the share of the step that has passed (0 at the left
frame, 1 at the right one).  The rule is the same for every method: the highest derivative that is known at
the nodes is interpolated, each lower one is its integral over the step.

==================  ==============================================  =======================================
method              highest derivative (order d)                    lower ones
==================  ==============================================  =======================================
hermite-simpson     parabola through frame, midpoint, frame         integrals: cubic, quartic, ...
trapezoidal         straight line between the frames                integrals: parabola, cubic, ...
stepping            in each step the value where it ends            integrals: line, parabola, ...
central             straight line between the frames                variable: cubic with the velocities of the
                                                                    central differences; first derivative:
                                                                    that cubic's own
==================  ==============================================  =======================================

Integrals start at the left frame's value.  The remaining difference at the right frame (the
violation of the links; for the trapezoidal rule also the difference between the trapezoid rule and the exact
integral of a parabola, third order in the step) is spread linearly over the step, so that every curve passes
through the values of all frames.  See Kelly (2017), "An introduction to trajectory optimization", sections
3.4 and 4.3, for the curves of the two collocation methods.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from stc.errors import UsageError
from stc.records import dataclass

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

METHODS = ("central", "trapezoidal", "hermite-simpson", "stepping")


def require_method(method: object) -> None:
    """Refuse what is no transcription.

    Raises:
        UsageError: its hint is the closest name, or all names.
    """
    if method not in METHODS:
        from difflib import get_close_matches

        near = get_close_matches(str(method), METHODS, n=1)
        hint = f"did you mean `{near[0]}`?" if near else f"the methods are {', '.join(METHODS)}"
        raise UsageError(f"unknown method {method!r}", hint)


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """Values of one quantity at the nodes of a motion of n steps.

    Attributes:
        before: (n+1,) value at each frame for the step to its left.
        after: (n+1,) value at each frame for the step to its right; equal to ``before`` if nothing jumps.
        mid: (n,) value at the midpoint of each step (hermite-simpson), else None.
    """

    before: FloatArray
    after: FloatArray
    mid: FloatArray | None = None

    @staticmethod
    def smooth(values: npt.ArrayLike, mid: npt.ArrayLike | None = None) -> Channel:
        """A channel without jumps: ``values`` (n+1,) at the frames, ``mid`` (n,) at the midpoints."""
        frames = np.array(values, dtype=np.float64)
        return Channel(frames, frames, None if mid is None else np.array(mid, dtype=np.float64))

    @property
    def jumps(self) -> bool:
        """Whether any frame has two different values."""
        return self.before is not self.after and not np.array_equal(self.before, self.after, equal_nan=True)

    def frames_apart(self) -> IntArray:
        """Indices of the frames where the two values differ."""
        if self.before is self.after:
            return np.zeros(0, np.intp)
        both = np.isnan(self.before) & np.isnan(self.after)
        return np.flatnonzero((self.before != self.after) & ~both)

    def held_outside(self, first: int, last: int) -> Channel:
        """The same channel; frames before ``first`` and after ``last`` get the value of the nearest of these."""
        frames = np.arange(len(self.before))
        early, late = frames < first, frames > last

        def held(values: FloatArray) -> FloatArray:
            return np.where(early, self.after[first], np.where(late, self.before[last], values))

        mid = self.mid
        if mid is not None:
            mid = np.where(early[:-1], self.after[first], np.where(late[1:], self.before[last], mid))
        return Channel(held(self.before), held(self.after), mid)


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The positions of some instants in the motion; every array has the shape (m,).

    Attributes:
        step: index of the step that holds the instant.
        share: position inside the step, 0 at its left frame and 1 at its right one.
        frame: index of the frame that the instant falls on, or -1 between frames.
        corner: the share, 0 or 1, at which the step meets that frame.
    """

    step: IntArray
    share: FloatArray
    frame: IntArray
    corner: FloatArray


#: An instant closer to a frame than this share of a step counts as on the frame, so that rounding in a sum of
#: steps does not decide which side of a jump is read.
FRAME_TOLERANCE = 1e-9


def places(time: FloatArray, instants: FloatArray, side: str) -> Places:
    """Locate ``instants`` (m,) among increasing frame times ``time`` (n+1,); the caller checks the range.

    An instant on a frame belongs to the step on the given ``side`` of it, where there is one.
    """
    if len(time) == 1:
        return places_by_index(0, np.zeros(len(instants)), side)
    last = len(time) - 1
    step = np.clip(np.searchsorted(time, instants, side="right") - 1, 0, last - 1)
    return _sided(step, (instants - time[step]) / (time[step + 1] - time[step]), last, side)


def places_by_index(last: int, index: FloatArray, side: str) -> Places:
    """As :func:`places`, the instants being given as frame indices (m,) in 0..``last``, fractions allowed."""
    step = np.clip(np.floor(index).astype(np.intp), 0, max(last - 1, 0))
    return _sided(step, index - step, last, side)


def _sided(step: IntArray, share: FloatArray, last: int, side: str) -> Places:
    """Move instants that lie on a frame to the step on the given side of it."""
    frame = np.where(share <= FRAME_TOLERANCE, step, np.where(share >= 1.0 - FRAME_TOLERANCE, step + 1, -1))
    beside = np.clip(frame if side == "after" else frame - 1, 0, max(last - 1, 0))
    own = np.where(frame >= 0, beside, step)
    return Places(own, share + (step - own), frame, np.where(frame > own, 1.0, 0.0))


def parabola(left: FloatArray, mid: FloatArray, right: FloatArray) -> list[FloatArray]:
    """Coefficients in s, lowest first, of the parabolas through values (k,) at s = 0, 1/2 and 1; (k,) each."""
    return [left, -3.0 * left + 4.0 * mid - right, 2.0 * left - 4.0 * mid + 2.0 * right]


def horner(coefficients: list[FloatArray], share: FloatArray) -> FloatArray:
    """Values of polynomials at ``share``, coefficients lowest first; all are broadcast to one shape, (k,) or (s, k)."""
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = value * share + coefficient
    return value


def _integrate(
    rate: list[FloatArray], length: FloatArray, left: FloatArray, right: FloatArray
) -> list[FloatArray]:
    """The integral of ``rate`` over a step, from ``left`` and, by a linear remainder, to ``right``."""
    terms = [length * c / (k + 1) for k, c in enumerate(rate)]
    remainder = right - left - sum(terms[1:], terms[0])
    return [left, terms[0] + remainder, *terms[1:]]


def interpolant(method: str, channel: Channel, step: IntArray) -> list[FloatArray]:
    """The polynomials, coefficients lowest first, that a method defines through node values on steps (k,).

    They are parabolas where there are midpoints, constants under stepping, else straight lines.
    """
    left, right = channel.after[step], channel.before[step + 1]
    if method == "stepping":
        return [right]
    if channel.mid is not None:
        return parabola(left, channel.mid[step], right)
    return [left, right - left]


def _central(
    orders: Mapping[int, Channel], step: IntArray, length: FloatArray
) -> dict[int, list[FloatArray]]:
    """Coefficients under central differences; see the module's table."""
    curves = {order: interpolant("central", channel, step) for order, channel in orders.items()}
    if 0 in orders and 1 in orders:
        x, v = orders[0], orders[1]
        x0, x1 = x.after[step], x.before[step + 1]
        v0, v1 = length * v.after[step], length * v.before[step + 1]
        cubic = [x0, v0, 3.0 * (x1 - x0) - 2.0 * v0 - v1, 2.0 * (x0 - x1) + v0 + v1]
        curves[0] = cubic
        curves[1] = [k * c / length for k, c in enumerate(cubic)][1:]
    return curves


def curves(
    method: str, orders: Mapping[int, Channel], step: IntArray, length: FloatArray
) -> dict[int, list[FloatArray]]:
    """Polynomials in s of a variable and its derivatives on some steps.

    Args:
        method: one of :data:`METHODS`.
        orders: node values of the variable (0) and its derivatives (1, 2, ...), without gaps.
        step: (m,) the steps asked for.
        length: (m,) their duration.

    Returns:
        For every order its coefficients, lowest first, each of shape (m,).
    """
    if method == "central":
        return _central(orders, step, length)
    highest = max(orders)
    found = {highest: interpolant(method, orders[highest], step)}
    for order in range(highest - 1, -1, -1):
        channel = orders[order]
        found[order] = _integrate(found[order + 1], length, channel.after[step], channel.before[step + 1])
    return found


def sample(
    method: str, orders: Mapping[int, Channel], time: FloatArray, where: Places, side: str
) -> dict[int, FloatArray]:
    """Values of a variable and its derivatives at some places, ``side`` deciding at frames that jump.

    Exactly on a frame it is the stored value of that frame.

    Returns:
        For every order an array of the shape of ``where.step``.
    """
    frame = np.maximum(where.frame, 0)
    stored = {k: (c.before if side == "before" else c.after)[frame] for k, c in orders.items()}
    if len(time) == 1:
        return stored
    found = {}
    for k, curve in curves(method, orders, where.step, time[where.step + 1] - time[where.step]).items():
        inside = horner(curve, where.share)
        found[k] = np.where(where.frame >= 0, stored[k] + (inside - horner(curve, where.corner)), inside)
    return found
