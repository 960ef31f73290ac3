"""Elementary functions without branches, for every lane at once.

Each function reduces its argument, evaluates one polynomial and undoes the reduction by integer arithmetic on
the representation or by selection.  Reductions follow Cody & Waite (Software Manual for the Elementary
Functions, 1980); the polynomials are Chebyshev interpolants computed in exact rational arithmetic and rounded
to double.

Largest errors measured, in units in the last place: sin, cos 1.4 up to \\|x\\| = 1e8 (1.8 without fused
multiply-add); tan 2.8; exp 1; log 0.7; sinh, cosh, tanh 2; asin, acos, atan, atan2 1.9; pow 1.2.

Invalid arguments give nan, poles infinities, as in C.  One limit: beyond :data:`LARGEST_ANGLE` (3.5e13, where
neighbouring doubles are 0.004 apart) sin, cos and tan give nan, for hardly an angle is left in the argument;
on machines without fused multiply-add that limit is :data:`LARGEST_ANGLE_UNFUSED`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from typing import Final

from stc.codegen.vector import Vector

LARGEST_ANGLE: Final = 2.0**45
LARGEST_ANGLE_UNFUSED: Final = 1.05e8

_TO_WHOLE: Final = 1.5 * 2.0**52  # adding it rounds to a whole number, which then fills the low bits
_PI: Final = math.pi
_PI_LOW: Final = 1.2246467991473532e-16
_HALF_PI: Final = tuple(
    map(float.fromhex, ("0x1.921fb54442d18p+0", "0x1.1a62633145c07p-54", "-0x1.f1976b7ed8fbcp-110"))
)
#: Parts of 26 bits: products with whole numbers below 2**27 are exact without fused multiply-add.
_HALF_PI_SHORT: Final = tuple(
    map(
        float.fromhex,
        (
            "0x1.921fb50000000p+0",
            "0x1.110b460000000p-26",
            "0x1.1a62630000000p-54",
            "0x1.8a2e030000000p-81",
            "0x1.c1cd128000000p-107",
        ),
    )
)
_LOG2_E: Final = float.fromhex("0x1.71547652b82fep+0")
_LN2_HIGH: Final = float.fromhex("0x1.62e42fee00000p-1")  # 32 bits: products with exponents are exact
_LN2_LOW: Final = float.fromhex("0x1.a39ef35793c76p-33")

# (sin r - r) / r^3 and (cos r - 1 + r^2/2) / r^4 in r^2, |r| <= pi/4
_SIN: Final = (
    -0.16666666666666666,
    0.008333333333330946,
    -0.0001984126983675497,
    2.755731610068303e-06,
    -2.5051131455427946e-08,
    1.591810123027412e-10,
)
_COS: Final = (
    0.041666666666666664,
    -0.0013888888888887395,
    2.4801587298763433e-05,
    -2.7557317270560326e-07,
    2.0876146024689747e-09,
    -1.1382614868556325e-11,
)
# (e^r - 1 - r) / r^2, |r| <= ln(2)/2
_EXP: Final = (
    0.5,
    0.1666666666666667,
    0.04166666666666667,
    0.008333333333326136,
    0.0013888888888883748,
    0.00019841269874820627,
    2.4801587325547743e-05,
    2.7557255400206422e-06,
    2.75572736431103e-07,
    2.5105217004720745e-08,
    2.0914686968086876e-09,
)
# (log((1+s)/(1-s)) - 2s) / s^3 in s^2, |s| <= (sqrt(2)-1)/(sqrt(2)+1)
_LOG: Final = (
    0.6666666666666666,
    0.4000000000000088,
    0.2857142857080285,
    0.22222222391887064,
    0.18181795621632782,
    0.15386240708969665,
    0.13268746195596595,
    0.1308690788796503,
)
# (atan t - t) / t^3 in t^2, |t| <= tan(pi/8)
_ATAN: Final = (
    -0.3333333333333333,
    0.19999999999999804,
    -0.14285714285659729,
    0.11111111105145725,
    -0.09090908753017178,
    0.07692296361048218,
    -0.06666424634599337,
    0.05878926110528101,
    -0.052304330074828924,
    0.04551496237494931,
    -0.03456806801496888,
    0.016282993238924487,
)
_TAN_EIGHTH_PI: Final = 0.41421356237309503


def _bits_of(value: float) -> int:
    return int(struct.unpack("<q", struct.pack("<d", value))[0])


# ---- circular functions -------------------------------------------------------------------------------


def sine_cosine(v: Vector, x: str, want_sine: bool = True, want_cosine: bool = True) -> tuple[str, str]:
    """sin x and cos x; one that is not wanted is returned as an empty name."""
    return sines_cosines(v, [(x, want_sine, want_cosine)])[0]


def sines_cosines(v: Vector, angles: Sequence[tuple[str, bool, bool]]) -> list[tuple[str, str]]:
    """The same for some angles at once, step by step: each step waits for the one before, those of others do not.

    A processor would look for these by itself, but an angle's are about as many as it can hold back.
    """
    largest = v.real(LARGEST_ANGLE if v.fused else LARGEST_ANGLE_UNFUSED)
    sizes = [v.call("fabs", x) for x, _, _ in angles]
    inside = [v.compare("ole", size, largest) for size in sizes]
    xs = [v.select(good, x, v.real(math.nan)) for good, (x, _, _) in zip(inside, angles, strict=True)]
    shifted = [v.fma(x, v.real(2.0 / _PI), v.real(_TO_WHOLE)) for x in xs]
    quarter_turns = [v.sub(each, v.real(_TO_WHOLE)) for each in shifted]
    turns = [v.bits(each) for each in shifted]  # the whole number in its low bits
    rs = xs
    for part in _HALF_PI if v.fused else _HALF_PI_SHORT:
        rs = [v.fma(quarter, v.real(-part), r) for quarter, r in zip(quarter_turns, rs, strict=True)]
    zs = [v.mul(r, r) for r in rs]
    sines = v.polynomials(zs, _SIN)
    sines = [v.fma(v.mul(z, r), sine, r) for z, r, sine in zip(zs, rs, sines, strict=True)]
    cosines = v.polynomials(zs, (1.0, -0.5, *_COS))
    results = []
    top = v.whole(-(2**63))
    for (_, want_sine, want_cosine), turn, sine, cosine in zip(angles, turns, sines, cosines, strict=True):
        odd = v.compare_whole("ne", v.integer("and", turn, v.whole(1)), v.whole(0))
        pair = ["", ""]
        if want_sine:
            sign = v.integer("and", v.integer("shl", turn, v.whole(62)), top)
            pair[0] = v.flip_sign(v.select(odd, cosine, sine), sign)
        if want_cosine:
            following = v.integer("add", turn, v.whole(1))
            sign = v.integer("and", v.integer("shl", following, v.whole(62)), top)
            pair[1] = v.flip_sign(v.select(odd, sine, cosine), sign)
        results.append((pair[0], pair[1]))
    return results


def _arc(v: Vector, y: str, x: str) -> str:
    """Angle of the point (x, y), in [-pi, pi], for any signs, zeros and infinities."""
    zero = v.real(0.0)
    width, height = v.call("fabs", x), v.call("fabs", y)
    steep = v.compare("ogt", height, width)
    small, large = v.select(steep, width, height), v.select(steep, height, width)
    # first octant; its upper half is turned by pi/4:  atan(s/l) = pi/4 + atan((s-l)/(s+l))
    upper = v.compare("ogt", small, v.mul(large, v.real(_TAN_EIGHTH_PI)))
    numerator = v.select(upper, v.sub(small, large), small)
    denominator = v.select(upper, v.add(small, large), large)
    # on the diagonal (0/0 and inf/inf included) the angle is pi/4, but 0 at the origin
    diagonal = v.compare("oeq", small, large)
    turned = v.either(v.both(diagonal, v.compare("ogt", large, zero)), upper)
    t = v.select(diagonal, zero, v.div(numerator, denominator))
    z = v.mul(t, t)
    base_high = v.select(turned, v.real(_PI / 4), zero)
    base_low = v.select(turned, v.real(_PI_LOW / 4), zero)
    angle = v.add(base_high, v.add(t, v.fma(v.mul(z, t), v.polynomial(z, _ATAN), base_low)))
    angle = v.select(steep, v.sub(v.real(_PI / 2), v.sub(angle, v.real(_PI_LOW / 2))), angle)
    negative = v.compare_whole("slt", v.bits(x), v.whole(0))
    angle = v.select(negative, v.sub(v.real(_PI), v.sub(angle, v.real(_PI_LOW))), angle)
    angle = v.call("copysign", angle, y)
    return v.select(v.compare("uno", x, y), v.real(math.nan), angle)


def _asin(v: Vector, x: str) -> str:
    return _arc(v, x, _leg(v, x))


def _acos(v: Vector, x: str) -> str:
    return _arc(v, _leg(v, x), x)


def _leg(v: Vector, x: str) -> str:
    """sqrt(1 - x^2), without cancellation near 1."""
    one = v.real(1.0)
    return v.call("sqrt", v.mul(v.sub(one, x), v.add(one, x)))


def _atan(v: Vector, x: str) -> str:
    return _arc(v, x, v.real(1.0))


# ---- exponentials -------------------------------------------------------------------------------------


def _reduced(v: Vector, x: str) -> tuple[str, str]:
    """``x = n ln 2 + r``: the bits whose low part is n, and r."""
    shifted = v.fma(x, v.real(_LOG2_E), v.real(_TO_WHOLE))
    n = v.sub(shifted, v.real(_TO_WHOLE))
    r = v.fma(n, v.real(-_LN2_HIGH), x)
    r = v.fma(n, v.real(-_LN2_LOW), r)
    return v.bits(shifted), r


def _clamp(v: Vector, x: str, low: float, high: float) -> str:
    """nan stays nan."""
    x = v.select(v.compare("olt", x, v.real(low)), v.real(low), x)
    return v.select(v.compare("ogt", x, v.real(high)), v.real(high), x)


def _power_of_two(v: Vector, n: str) -> str:
    """2**n for -1022 <= n <= 1023; only the low 11 bits of n + 1023 count."""
    return v.from_bits(v.integer("shl", v.integer("add", n, v.whole(1023)), v.whole(52)))


def _scaled(v: Vector, value: str, bits: str) -> str:
    """``value * 2**n``, n in the low bits: in two steps, since 2**n itself may leave the range."""
    n = v.integer("sub", bits, v.whole(_bits_of(_TO_WHOLE)))
    half = v.integer("ashr", n, v.whole(1))
    return v.mul(v.mul(value, _power_of_two(v, half)), _power_of_two(v, v.integer("sub", n, half)))


def _exp(v: Vector, x: str, low: str = "") -> str:
    """e**(x + low); ``low``, if given, is tiny beside x."""
    bits, r = _reduced(v, _clamp(v, x, -746.0, 710.0))
    square = v.mul(r, r)
    tail = v.fma(square, v.polynomial(r, _EXP), r)
    if low:
        tail = v.fma(v.add(v.real(1.0), tail), low, tail)
    return _scaled(v, v.add(v.real(1.0), tail), bits)


def _quarter_expm1(v: Vector, size: str) -> str:
    """(e**size - 1) / 4 for size >= 0, accurate near zero; finite as long as four times it nearly is."""
    bits, r = _reduced(v, v.select(v.compare("ogt", size, v.real(710.6)), v.real(710.6), size))
    em1 = v.fma(v.mul(r, r), v.polynomial(r, _EXP), r)
    n = v.integer("sub", bits, v.whole(_bits_of(_TO_WHOLE)))
    scale = _power_of_two(v, v.integer("sub", n, v.whole(2)))
    return v.fma(scale, em1, v.sub(scale, v.real(0.25)))


def _sinh(v: Vector, x: str) -> str:
    q = _quarter_expm1(v, v.call("fabs", x))
    half = v.add(q, v.div(q, v.fma(q, v.real(4.0), v.real(1.0))))
    return v.call("copysign", v.add(half, half), x)


def _cosh(v: Vector, x: str) -> str:
    q = v.add(_quarter_expm1(v, v.call("fabs", x)), v.real(0.25))  # e**|x| / 4
    return v.add(v.add(q, q), v.div(v.real(0.125), q))


def _tanh(v: Vector, x: str) -> str:
    # beyond 22 the result rounds to one
    size = v.call("fabs", x)
    size = v.select(v.compare("ogt", size, v.real(22.0)), v.real(22.0), size)
    q = _quarter_expm1(v, v.add(size, size))
    return v.call("copysign", v.div(q, v.add(q, v.real(0.5))), x)


# ---- logarithm and power ------------------------------------------------------------------------------


def _log_parts(v: Vector, x: str) -> tuple[str, str, str]:
    """``x = 2**k (1 + f)`` with 1 + f in [sqrt(1/2), sqrt(2)): k (as double), f, and 2 + f."""
    tiny = v.compare("olt", x, v.real(2.0**-1022))
    x = v.select(tiny, v.mul(x, v.real(2.0**54)), x)
    # move the point where the exponent steps from 1 to sqrt(2)
    offset = _bits_of(1.0) - _bits_of(math.sqrt(0.5))
    bits = v.integer("add", v.bits(x), v.whole(offset))
    biased = v.integer("lshr", bits, v.whole(52))
    as_double = v.from_bits(v.integer("or", biased, v.whole(_bits_of(2.0**52))))
    shift = v.select(tiny, v.real(-(2.0**52) - 1023.0 - 54.0), v.real(-(2.0**52) - 1023.0))
    k = v.add(as_double, shift)
    fraction = v.integer("and", bits, v.whole(2**52 - 1))
    m = v.from_bits(v.integer("add", fraction, v.whole(_bits_of(math.sqrt(0.5)))))
    f = v.sub(m, v.real(1.0))
    return k, f, v.add(f, v.real(2.0))


def _log_poles(v: Vector, x: str, result: str) -> str:
    """Zero, negative, infinite and nan arguments."""
    result = v.select(v.compare("olt", x, v.real(math.inf)), result, x)  # inf and nan map to themselves
    result = v.select(v.compare("olt", x, v.real(0.0)), v.real(math.nan), result)
    return v.select(v.compare("oeq", x, v.real(0.0)), v.real(-math.inf), result)


def _log(v: Vector, x: str) -> str:
    k, f, divisor = _log_parts(v, x)
    s = v.div(f, divisor)
    z = v.mul(s, s)
    half_square = v.mul(v.mul(f, v.real(0.5)), f)
    # log(1+f) = f - f^2/2 + s (f^2/2 + s^2 P(s^2)): the rounding of s hardly matters in this form
    tail = v.mul(s, v.fma(z, v.polynomial(z, _LOG), half_square))
    tail = v.fma(k, v.real(_LN2_LOW), tail)
    result = v.fma(k, v.real(_LN2_HIGH), v.sub(f, v.sub(half_square, tail)))
    return _log_poles(v, x, result)


def _log_pair(v: Vector, x: str) -> tuple[str, str]:
    """log x, 0 < x < inf, as an unevaluated sum with an error near 2**-60."""
    k, f, divisor = _log_parts(v, x)
    divisor_low = v.sub(f, v.sub(divisor, v.real(2.0)))
    s = v.div(f, divisor)
    rest = v.exact_fma(v.neg(s), divisor, f)
    rest = v.sub(rest, v.mul(s, divisor_low))
    s_low = v.div(rest, divisor)
    z = v.mul(s, s)
    cubic = v.mul(v.mul(z, s), v.polynomial(z, _LOG))
    main = v.add(s, s)
    low = v.add(v.add(s_low, s_low), cubic)
    high_part = v.mul(k, v.real(_LN2_HIGH))  # exact
    low = v.fma(k, v.real(_LN2_LOW), low)
    # two sums without error: the larger operand first (zero when k = 0, and then the sum is exact anyway)
    total = v.add(high_part, main)
    virtual = v.sub(total, high_part)
    error = v.add(v.sub(high_part, v.sub(total, virtual)), v.sub(main, virtual))
    low = v.add(low, error)
    high = v.add(total, low)
    return high, v.sub(low, v.sub(high, total))


def _pow(v: Vector, x: str, y: str) -> str:
    """C's pow: whole exponents of negative bases included, other exponents of them are nan."""
    zero, one, inf = v.real(0.0), v.real(1.0), v.real(math.inf)
    size = v.call("fabs", x)
    high, low = _log_pair(v, size)
    high = _log_poles(v, size, high)
    product = v.mul(y, high)
    error = v.fma(y, low, v.exact_fma(y, high, v.neg(product)))
    moderate = v.compare("olt", v.call("fabs", product), v.real(1e4))
    result = _exp(v, product, v.select(moderate, error, zero))
    # parity of y
    half = v.mul(y, v.real(0.5))
    is_whole = v.compare("oeq", v.call("rint", y), y)
    not_even = v.compare("une", v.call("rint", half), half)
    odd = v.both(is_whole, not_even)
    sign = v.sign_bit(x)
    result = v.select(odd, v.flip_sign(result, sign), result)
    invalid = v.both(v.compare("olt", x, zero), v.compare("ogt", x, v.real(-math.inf)))
    invalid = v.both(invalid, v.compare("une", v.call("rint", y), y))
    result = v.select(invalid, v.real(math.nan), result)
    result = v.select(v.compare("uno", x, y), v.real(math.nan), result)
    # 1**y and x**0 are one for everything, nan included; so is (-1)**inf
    unit = v.either(v.compare("oeq", y, zero), v.compare("oeq", x, one))
    endless = v.both(v.compare("oeq", x, v.real(-1.0)), v.compare("oeq", v.call("fabs", y), inf))
    return v.select(v.either(unit, endless), one, result)


UNARY: Final[dict[str, Callable[[Vector, str], str]]] = {
    "asin": _asin,
    "acos": _acos,
    "atan": _atan,
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": _tanh,
    "exp": _exp,
    "log": _log,
}
BINARY: Final[dict[str, Callable[[Vector, str, str], str]]] = {"atan2": _arc, "pow": _pow}
