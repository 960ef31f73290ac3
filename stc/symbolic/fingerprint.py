"""Fingerprints: the value of an expression at one random point of a finite field.

Two expressions that are equal as polynomials have equal fingerprints, however they are written; two that differ
have different ones but for a chance of about their degree in 2^61 (Schwartz, J. ACM 27, 1980; for expressions,
Martin, J. ACM 18, 1971).  The field is that of the integers modulo a prime near 2^61, where literals, being
fractions, have exact values: no rounding enters.

An operation that is not polynomial gives a random element that depends on the fingerprints of the operands, by a
mixture whose differences do not reveal those of the operands: of a hash that is nearly linear, `1/(a + 1) - 1/a` and
`1/(b + 1) - 1/b` would often be the same.  Sines and cosines of one argument are the two coordinates of a rational
point of the circle, so that the squares add up to one; exponentials and hyperbolic functions likewise; odd and even
functions keep their symmetry.  The reciprocal of a divisor is *not* its inverse in the field: ``x/x`` is undefined at
0 and its fingerprint must not be that of 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

PRIME: Final = (1 << 61) - 2373
"""The largest prime p below 2^61 of which (p - 1)/2 is a prime too.

So no power of two of a double is 1 in the field, as 2^61 is modulo 2^61 - 1, and -1 is not a square.
"""

UNKNOWN: Final = math.nan
"""The fingerprint of infinite and undefined literals: spreads through arithmetic and equals nothing."""

Fingerprint = int | float

_WORD: Final = (1 << 64) - 1


def element(kind: int, value: Fingerprint) -> Fingerprint:
    """A random nonzero element that depends on two numbers, the same in every process."""
    return _mixed(kind, value) % (PRIME - 1) + 1


def _mixed(kind: int, value: Fingerprint) -> Fingerprint:
    """64 bits each of which depends on all bits of two numbers (Steele, Lea and Flood, OOPSLA 2014: SplitMix64)."""
    if not isinstance(value, int):
        return UNKNOWN
    x = value + kind * 0x9E3779B97F4A7C15 & _WORD
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9 & _WORD
    x = (x ^ x >> 27) * 0x94D049BB133111EB & _WORD
    return x ^ x >> 31


def _of_pair(kind: int, first: Fingerprint, second: Fingerprint) -> Fingerprint:
    """A random nonzero element that depends on two operands and their order."""
    return element(kind, _mixed(kind, first) + second)


def _unsigned(value: Fingerprint) -> tuple[Fingerprint, int]:
    """One of ``value`` and ``-value``, the same for both, and the sign that was taken off."""
    if value + value > PRIME:
        return PRIME - value, -1
    return value, 1


def _inverse(value: Fingerprint) -> Fingerprint:
    return pow(value, -1, PRIME) if isinstance(value, int) else UNKNOWN


def of_literal(value: float) -> Fingerprint:
    """The fingerprint of a literal."""
    if not math.isfinite(value):
        return UNKNOWN
    numerator, denominator = value.as_integer_ratio()
    return numerator * pow(denominator, -1, PRIME) % PRIME


def reciprocal(value: Fingerprint) -> Fingerprint:
    """The fingerprint of ``1/b``: opaque, but odd in ``b``; a division by zero has none."""
    if value == 0:
        return UNKNOWN
    size, sign = _unsigned(value)
    return sign * element(1, size) % PRIME


def power(base: Fingerprint, exponent: Fingerprint, literal: float | None) -> Fingerprint:
    """The fingerprint of ``a^b``; ``literal`` is the exponent's value where it is one."""
    if literal is not None and abs(literal) <= 64 and literal.is_integer() and isinstance(base, int):
        whole = pow(base, abs(int(literal)), PRIME)
        return whole if literal >= 0 else reciprocal(whole)
    return _of_pair(2, base, exponent)


def _circle(argument: Fingerprint) -> tuple[Fingerprint, Fingerprint]:
    """A point (sine, cosine) with coordinates whose squares add up to one."""
    size, sign = _unsigned(argument)
    t = element(3, size)
    scale = _inverse(1 + t * t)  # never zero: -1 is not a square modulo this prime
    return sign * 2 * t * scale % PRIME, (1 - t * t) * scale % PRIME


def _exponential(argument: Fingerprint) -> tuple[Fingerprint, Fingerprint]:
    """The exponentials of an argument and of its opposite: inverses of each other."""
    size, sign = _unsigned(argument)
    e = element(4, size)
    return (e, _inverse(e)) if sign > 0 else (_inverse(e), e)


_HALF: Final = (PRIME + 1) // 2


def _sinh(argument: Fingerprint) -> Fingerprint:
    e, opposite = _exponential(argument)
    return (e - opposite) * _HALF % PRIME


def _cosh(argument: Fingerprint) -> Fingerprint:
    e, opposite = _exponential(argument)
    return (e + opposite) * _HALF % PRIME


def _tan(argument: Fingerprint) -> Fingerprint:
    sine, cosine = _circle(argument)
    return sine * reciprocal(cosine) % PRIME


def _odd(kind: int) -> Callable[[Fingerprint], Fingerprint]:
    def function(argument: Fingerprint) -> Fingerprint:
        size, sign = _unsigned(argument)
        return sign * element(kind, size) % PRIME

    return function


OF_FUNCTION: Final[dict[str, Callable[[Fingerprint], Fingerprint]]] = {
    "sin": lambda a: _circle(a)[0],
    "cos": lambda a: _circle(a)[1],
    "tan": _tan,
    "asin": _odd(5),
    "acos": lambda a: element(6, a),
    "atan": _odd(7),
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": lambda a: _sinh(a) * _inverse(_cosh(a)) % PRIME,
    "exp": lambda a: _exponential(a)[0],
    "log": lambda a: element(8, a),
    "sqrt": lambda a: element(9, a),
}
"""The fingerprints of functions of one argument."""


OF_PAIR: Final[dict[str, Callable[[Fingerprint, Fingerprint], Fingerprint]]] = {
    "atan2": lambda y, x: _of_pair(10, y, x),
    "look": lambda x, place: _of_pair(12, x, place),
    "at": lambda y, table: _of_pair(13, y, table),
}
"""The fingerprints of functions of two operands."""
