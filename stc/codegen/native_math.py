"""Scalar functions that compiled functions may call; the very same names work in plain Python.

Invalid arguments give nan or an infinity as in C, where :mod:`math` would raise.
"""

from __future__ import annotations

import math

inf = math.inf
nan = math.nan


def sqrt(x: float) -> float:
    """Square root; nan below zero."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def fabs(x: float) -> float:
    """Magnitude."""
    return math.fabs(x)


def floor(x: float) -> float:
    """Largest whole number not above ``x``, as a float."""
    return float(math.floor(x)) if math.isfinite(x) else x


def ceil(x: float) -> float:
    """Smallest whole number not below ``x``, as a float."""
    return float(math.ceil(x)) if math.isfinite(x) else x


def isfinite(x: float) -> bool:
    """Neither infinite nor nan."""
    return math.isfinite(x)


def isnan(x: float) -> bool:
    """Not a number."""
    return math.isnan(x)


def copysign(x: float, y: float) -> float:
    """Magnitude of ``x`` with the sign of ``y``."""
    return math.copysign(x, y)


def count_bits(x: int) -> int:
    """How many ones a whole number has in binary, none below zero."""
    return x.bit_count()


def exp(x: float) -> float:
    """Exponential; infinite on overflow."""
    try:
        return math.exp(x)
    except OverflowError:
        return math.inf


def log(x: float) -> float:
    """Natural logarithm; -inf at zero, nan below."""
    if x == 0.0:
        return -math.inf
    return math.log(x) if x > 0.0 else math.nan


def divide(x: float, y: float) -> float:
    """Floating-point ``x / y`` of the machine: infinite or nan for ``y = 0``."""
    try:
        return x / y
    except ZeroDivisionError:
        if x == 0.0 or x != x:
            return math.nan
        return math.copysign(math.inf, x) * math.copysign(1.0, y)


def integer_power(x: float, n: int) -> float:
    """``x ** n`` by repeated squaring, in the order in which compiled code multiplies."""
    if n < 0:
        return divide(1.0, integer_power(x, -n))
    result: float | None = None
    square = x
    while n:
        if n & 1:
            result = square if result is None else result * square
        n >>= 1
        if n:
            square = square * square
    return type(x)(1) if result is None else result
