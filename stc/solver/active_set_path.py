"""Finds the active set of a quadratic program along a path of programs: a parametric active set method.

The solution with a wrong active set is that of another quadratic program: with wider bounds, so that it is inside,
and another gradient, so that no multiplier has the wrong sign.  From there bounds and gradient go to those at hand.
Meanwhile the solution moves along straight lines; where two of them meet, a constraint becomes active or inactive
(M. J. Best, An algorithm for the solution of the parametric quadratic programming problem, 1996; H. J. Ferreau,
H. G. Bock and M. Diehl, An online active set strategy to overcome the limitations of explicit MPC, 2008).

The matrix is factorised for the first active set alone.  Each change adds the response to one constraint, which takes
one solve, and a row to a small dense system (P. E. Gill, W. Murray, M. A. Saunders and M. H. Wright, A Schur-complement
method for sparse quadratic programming, 1990).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stc.solver.nlp import Floats
from stc.solver.products import NOTHING

__all__ = ["ActiveSetPath", "Response"]

MOST = 60
"""How many constraints may differ from the first active set."""

Response = Callable[[int], tuple[Floats, Floats]]
"""What a unit of the k-th constraint does to all values and multipliers, (c,), with the first active set: of its value
if it is active there, otherwise of its multiplier."""


class ActiveSetPath:
    """The path from one active set to that of the solution.

    The c constraints are bounds and inequality rows, whose values are those of a step.

    Args:
        signs: the first active set: -1 for the lower bound, 1 for the upper one, else 0; (c,).
        values, multipliers: in the solution with it, (c,). Multipliers are positive at an upper bound.
        low, high: bounds of the values, (c,); infinite where there is none.
        response: see :data:`Response`.
        most: how many constraints may differ.
    """

    def __init__(
        self, signs: Floats, values: Floats, multipliers: Floats, low: Floats, high: Floats, response: Response,
        most: int = MOST,
    ) -> None:  # fmt: skip
        self._first, self._response, self._most = signs, response, most
        self.signs = signs.copy()
        self._values = values.copy()
        self._multipliers = signs * np.maximum(signs * multipliers, 0.0)
        self._low, self._high = np.minimum(low, values), np.maximum(high, values)
        for bound, own, sign in ((self._low, low, -1), (self._high, high, 1)):
            bound[signs == sign] = own[signs == sign]
        with np.errstate(invalid="ignore"):
            self._low_rate, self._high_rate = np.nan_to_num(low - self._low), np.nan_to_num(high - self._high)
        self._rate = np.zeros_like(values), np.where(signs != 0, multipliers - self._multipliers, 0.0)
        self._changed: list[int] = []
        self._responses = np.empty((2, most + 1, signs.size))

    def follow(self) -> bool:
        """Go along the path; whether its end was reached: ``signs`` is the active set there.

        It is not where too many constraints change, or where the curvature on an active set is not positive.
        """
        try:
            left = 1.0
            for _ in range(2 * self._most):
                rates = self._adapted(*self._rate, moving=True)
                enough, at_upper = self._room_left(*rates)
                k = int(np.argmin(enough))
                step = min(left, float(enough[k]))
                self._values += step * rates[0]
                self._multipliers += step * rates[1]
                self._low += step * self._low_rate
                self._high += step * self._high_rate
                left -= step
                if left <= 0.0:
                    return True
                if not self._change(k, 0 if self.signs[k] else 1 if at_upper[k] else -1):
                    return False
        except np.linalg.LinAlgError:  # what holds the changed constraints depends on itself
            pass
        return False

    def _room_left(self, values: Floats, multipliers: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """How far each constraint may go on at these rates, (c,), and whether to its upper bound."""
        active = self.signs != 0
        off = self.signs * multipliers < 0.0
        up = ~active & (values > self._high_rate)
        down = ~active & (values < self._low_rate)
        enough = np.full(values.size, np.inf)
        np.divide(-self._multipliers, multipliers, out=enough, where=off)
        np.divide(self._high - self._values, values - self._high_rate, out=enough, where=up)
        below = np.full(values.size, np.inf)
        np.divide(self._low - self._values, values - self._low_rate, out=below, where=down)
        return np.maximum(np.minimum(enough, below), 0.0), enough <= below

    def _change(self, k: int, sign: int) -> bool:
        """Give a constraint another sign; whether that can be done."""
        if len(self._changed) == self._most and k not in self._changed:
            return False
        values, multipliers = self._unit(k)
        if sign == 0:
            if multipliers[k] >= 0.0:  # the curvature along what it has held
                return False
        elif values[k] >= -NOTHING * abs(self._responses[0, self._place(k), k]):
            # It depends on active ones, one of which gives way to it.
            falling = self.signs * sign * multipliers
            where = falling < 0.0
            where[k] = False
            enough = np.full(falling.size, np.inf)
            np.divide(-self.signs * self._multipliers, falling, out=enough, where=where)
            other = int(np.argmin(enough))
            if not np.isfinite(enough[other]):
                return False
            self._multipliers += enough[other] * sign * multipliers
            self._put(k, sign)
            if other not in self._changed:
                if len(self._changed) == self._most:
                    return False
                self._responses[:, len(self._changed)] = self._response(other)
            k, sign = other, 0
        self._put(k, sign)
        return True

    def _place(self, k: int) -> int:
        return self._changed.index(k) if k in self._changed else len(self._changed)

    def _put(self, k: int, sign: int) -> None:
        """Note the new sign of a constraint whose response is at its place."""
        self.signs[k] = sign
        if sign == 0:
            self._multipliers[k] = 0.0
        place, count = self._place(k), len(self._changed)
        if place == count:
            self._changed.append(k)
        elif sign == self._first[k]:
            self._responses[:, place : count - 1] = self._responses[:, place + 1 : count]
            del self._changed[place]

    def _unit(self, k: int) -> tuple[Floats, Floats]:
        """What a unit of a constraint does (see :data:`Response`) with the active set at hand."""
        place = self._place(k)
        if place == len(self._changed):
            self._responses[:, place] = self._response(k)
            values, multipliers = self._responses[:, place]
            return self._adapted(values, multipliers, moving=False)
        shares = np.linalg.solve(self._system(), np.eye(len(self._changed))[place])
        others = self._responses[:, : len(self._changed)]
        return shares @ others[0], shares @ others[1]

    def _system(self) -> Floats:
        """What each of the changed constraints has to hold, by the responses to all of them."""
        values, multipliers = self._responses[:, : len(self._changed), self._changed]
        return np.where(self.signs[self._changed] != 0, values, multipliers).T

    def _adapted(self, values: Floats, multipliers: Floats, moving: bool) -> tuple[Floats, Floats]:
        """Values and multipliers with the first active set, (c,), as the active set at hand has them.

        Args:
            moving: whether bounds move as well.
        """
        at = self._changed
        if not at:
            return values, multipliers
        signs = self.signs[at]
        bound = np.where(signs < 0, self._low_rate[at], self._high_rate[at]) if moving else 0.0
        missing = np.where(signs != 0, bound - values[at], -multipliers[at])
        shares = np.linalg.solve(self._system(), missing)
        others = self._responses[:, : len(at)]
        return values + shares @ others[0], multipliers + shares @ others[1]
