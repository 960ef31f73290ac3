"""Numbers from syntax: expressions of constants, and indices that are affine in ``i``."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from stc.language import syntax
from stc.symbolic.expr import FUNCTIONS

#: Distance from a whole number that counts as rounding noise.
NOISE = 1e-9

_MATH: dict[str, Callable[..., float]] = {name: getattr(math, name) for name in FUNCTIONS}

#: The functions with a kink, or a jump, and how many arguments each takes: at least, at most.
KINKED: dict[str, tuple[int, float]] = {
    "abs": (1, 1),
    "min": (2, math.inf),
    "max": (2, math.inf),
    "sign": (1, 1),
    "floor": (1, 1),
}

#: What the functions are of numbers.
OF_NUMBERS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "min": min,
    "max": max,
    "sign": lambda x: float((x > 0) - (x < 0)),
    "floor": lambda x: float(math.floor(x)),
}


def count_fits(function: str, given: int) -> bool:
    """Whether a function accepts a number of arguments."""
    least, most = KINKED[function]
    return least <= given <= most


class NotANumber(Exception):
    """An expression without a value: its position, the reason, and a hint."""

    def __init__(self, node: syntax.Node, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.node, self.message, self.hint = node, message, hint


class Unknown(Exception):
    """An expression without a value because of a mistake that was added elsewhere."""


Resolve = Callable[[syntax.Name], tuple[float, float]]
"""Returns the value of a name as ``(a, b)``, meaning ``a*i + b``; raises :class:`NotANumber` or :class:`Unknown`."""


def affine(node: syntax.Expression, resolve: Resolve) -> tuple[float, float]:
    """``(a, b)`` such that the expression is ``a*i + b``.

    Raises:
        NotANumber: it is not affine in ``i``, is not a real number, or contains something without a fixed value.
        Unknown: a name in it has no value, for a reason that was added already.
    """
    if isinstance(node, syntax.Number):
        return 0.0, node.value
    if isinstance(node, syntax.Name):
        return resolve(node)
    if isinstance(node, syntax.Negate):
        a, b = affine(node.operand, resolve)
        return -a, -b
    if isinstance(node, syntax.Sum):
        a = b = 0.0
        endless = False
        for sign, term in node.terms:
            c, d = affine(term, resolve)
            endless |= math.isinf(d)
            a, b = (a + c, b + d) if sign == "+" else (a - c, b - d)
        return _checked(node, a, b, endless)
    if isinstance(node, syntax.Product):
        a, b = affine(node.factors[0][1], resolve)
        endless = math.isinf(b)
        for operator, factor in node.factors[1:]:
            c, d = affine(factor, resolve)
            endless |= math.isinf(d)
            if operator == "/":
                if c:
                    raise NotANumber(factor, "an index cannot be divided by `i`")
                if d == 0.0:
                    raise NotANumber(factor, "division by zero")
                a, b = a / d, b / d
            elif a and c:
                raise NotANumber(node, "an index has to be of the form `a*i + b`")
            else:
                # Zero times infinity is not a number: a factor without `i` has no share in `a`.
                a, b = (a * d if a else 0.0) + (b * c if c else 0.0), b * d
        return _checked(node, a, b, endless)
    if isinstance(node, syntax.Power):
        base, exponent = _plain(node.base, resolve), _plain(node.exponent, resolve)
        return 0.0, _applied(node, "^", math.pow, base, exponent)
    if isinstance(node, syntax.Call) and node.function in _MATH:
        arguments = [_plain(argument, resolve) for argument in node.arguments]
        if len(arguments) != FUNCTIONS[node.function]:
            raise NotANumber(node, arity_message(node.function, len(arguments)))
        return 0.0, _applied(node, node.function, _MATH[node.function], *arguments)
    if isinstance(node, syntax.Call) and node.function in KINKED:
        if not count_fits(node.function, len(node.arguments)):
            raise NotANumber(node, f"`{node.function}` takes another number of arguments")
        values = [_plain(argument, resolve) for argument in node.arguments]
        return 0.0, _applied(node, node.function, OF_NUMBERS[node.function], *values)
    if isinstance(node, syntax.Prime):
        raise NotANumber(node, "a time derivative has no fixed value")
    if isinstance(node, syntax.Index):
        raise NotANumber(node, "the value at a frame is not known before solving")
    if isinstance(node, syntax.Vector):
        raise NotANumber(node, "a vector is not a number")
    if isinstance(node, syntax.Member):
        raise NotANumber(node, "positions are not known before the solve")
    raise NotANumber(node, f"`{node.function}` cannot stand here")


def _plain(node: syntax.Expression, resolve: Resolve) -> float:
    a, b = affine(node, resolve)
    if a:
        raise NotANumber(node, "an index has to be of the form `a*i + b`")
    return b


def _checked(node: syntax.Expression, a: float, b: float, endless: bool) -> tuple[float, float]:
    """The value if it is a number; infinity is allowed only if the expression contains it (``endless``)."""
    if math.isnan(a) or math.isnan(b):
        raise NotANumber(node, "this has no value (infinity less infinity, or zero times infinity)")
    if math.isinf(a) or (math.isinf(b) and not endless):
        raise NotANumber(node, "this number is too large", "the largest is 1.797e308")
    return a, b


def _applied(node: syntax.Expression, name: str, function: Callable[..., float], *arguments: float) -> float:
    try:
        value = function(*arguments)
    except (ValueError, ZeroDivisionError):
        shown = ", ".join(f"{argument:g}" for argument in arguments)
        if name == "^":
            base = f"{arguments[0]:g}" if arguments[0] >= 0 else f"({arguments[0]:g})"
            shown = f"{base}^{arguments[1]:g}"
            raise NotANumber(node, f"{shown} is not a real number") from None
        raise NotANumber(node, f"{name}({shown}) is not a real number") from None
    except OverflowError:
        raise NotANumber(node, "this number is too large", "the largest is 1.797e308") from None
    if math.isnan(value):
        raise NotANumber(node, "this is not a number")
    return value


def arity_message(function: str, given: int) -> str:
    """The message for a function called with the wrong number of arguments."""
    wanted = FUNCTIONS[function]
    return f"`{function}` takes {wanted} argument{'s' if wanted != 1 else ''}, not {given}"


def exact(value: float) -> Fraction | int | None:
    """The fraction that a number represents up to rounding; None if there is no simple one."""
    if not math.isfinite(value):
        return None
    nearest = round(value)
    if abs(value - nearest) <= NOISE:
        return nearest
    fraction = Fraction(value).limit_denominator(1_000_000)
    return fraction if abs(value - fraction) <= NOISE else None
