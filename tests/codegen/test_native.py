"""Compiled functions against the very same functions in plain Python."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stc.codegen import engine
from stc.codegen.native import (
    NativeError,
    ceil,
    copysign,
    exp,
    f64,
    f64s,
    fabs,
    floor,
    i32s,
    i64,
    i64s,
    isfinite,
    isnan,
    log,
    native,
    native_source,
    sqrt,
)
from stc.codegen.native_units import unit_ir

SCALE = 2.5
WIDTH = 4


@native
def arithmetic(a: f64, b: f64, n: i64) -> f64:
    """Every operator on scalars."""
    c = -a + b * SCALE - a / b
    c += n
    c *= 1.5
    c -= 2
    c /= 3
    return c + a**2 - b**3 + a**-2 + (+b) ** 0 + 2**WIDTH


@native
def integers(a: i64, b: i64) -> i64:
    total = a // b + 10 * (a % b)
    total += a // 8 + 100 * (a % 8)
    total = total - (a & 7) + (b | 2) - (a ^ b) + a**3
    total -= -a
    return abs(total) + min(a, b, 3) + max(a, b)


@native
def functions(x: f64, y: f64) -> f64:
    r = sqrt(fabs(x)) + floor(x) - ceil(y) + copysign(2.0, x) + abs(y) + exp(-abs(x)) + log(abs(y) + 1)
    r += min(x, y) * 3 + max(x, y, 0.5) + float(int(x)) + int(y)
    if isnan(x) or not isfinite(y):
        r = -1.0
    return r


@native
def comparisons(a: f64, b: f64, n: i64) -> i64:
    code = 0
    if a < b:
        code += 1
    if a <= b:
        code += 2
    if a > b and n > 3:
        code += 4
    if a >= b or n == 2:
        code += 8
    if a == b:
        code += 16
    if not (a < b or a > b):
        code += 32
    if 0 <= n < 5 < a:
        code += 64
    if n:
        code += 128
    flag = a < n
    if flag and True:
        code += 256
    code += 512 if b > 0 else 1024
    code += (a > 0) + (b > 0)
    return code


@native
def choose(a: f64, n: i64) -> f64:
    return a if n > 2 else n if n > 1 else -a if a > 0 and (n == 0 or a < 1) else 7


@native
def loops(n: i64, x: f64s) -> f64:
    total = 0.0
    for i in range(n):
        for j in range(i, n, 2):
            if j == 3:
                continue
            if x[j] > 0.9:
                break
            total += x[i] * x[j]
        else:
            total += 100.0
    for k in range(n - 1, -1, -1):
        total = total * 0.5 + x[k]
    step = 3
    for k in range(1, n, step):
        total += x[k] * k
        k = 0
    i = 0
    while i < n:
        i += 1
        if i % 2 == 0:
            continue
        if i > 6:
            break
        total += i
    else:
        total -= 50.0
    return total + i


@native
def last_value(n: i64) -> i64:
    k = -1
    for k in range(n):  # noqa: B007
        pass
    return k


@native
def search(n: i64, x: f64s, bound: f64) -> i64:
    k = 0
    while True:
        if k >= n:
            return -1
        if x[k] > bound:
            return k
        k += 1


@native
def swap_and_chain(a: f64, b: f64) -> f64:
    a, b = b, a
    c = d = a - b
    e: f64 = 1
    return a * 2 + b + c * d + e


@native
def scatter(n: i64, index: i32s, wide: i64s, x: f64s, y: f64s) -> None:
    for k in range(n):
        y[index[k]] += x[k]
        wide[k] = index[k] * 3000000000
        index[k] = index[k] + 1


@native(inline=True)
def dot(n: i64, x: f64s, y: f64s) -> f64:
    s = 0.0
    for k in range(n):
        s += x[k] * y[k]
    return s


@native
def windows(n: i64, x: f64s, out: f64s) -> i64:
    """Views: as arguments, as locals, of views."""
    tail = x[2:]
    for k in range(n - 4):
        head = tail[k:]
        out[k] = dot(2, head, x[k:]) + head[1]
    if n > 3:
        return count_down(n)
    return 0


@native
def count_down(n: i64) -> i64:
    if n <= 0:
        return 0
    return 1 + count_down(n - 1)


@native
def nothing(n: i64, x: f64s) -> None:
    if n == 0:
        return
    x[0] = 1


@native(fast=True)
def fast_sum(n: i64, x: f64s) -> f64:
    s = 0.0
    for k in range(n):
        s += x[k] * x[k]
    return s


floats = st.floats(-50.0, 50.0)


def same(function: Any, *args: Any) -> None:
    """Compiled and plain results are identical, effects on arrays included."""
    first = [a.copy() if isinstance(a, np.ndarray) else a for a in args]
    second = [a.copy() if isinstance(a, np.ndarray) else a for a in args]
    third = [a.copy() if isinstance(a, np.ndarray) else a for a in args]
    expected = function.python(*first)
    for result, arrays in ((function(*second), second), (function.bind(*third)(), third)):
        assert result == expected or (result != result and expected != expected)
        assert type(result) is type(expected) or expected in (0, 1, 7, 2)
        for a, b in zip(first, arrays, strict=True):
            np.testing.assert_array_equal(a, b)


@settings(max_examples=60)
@given(floats, floats, st.integers(-20, 20))
def test_scalar_arithmetic(a: float, b: float, n: int) -> None:
    same(arithmetic, a, b, n)
    same(functions, a, b)
    same(comparisons, a, b, n)
    same(choose, a, n)
    same(swap_and_chain, a, b)


@settings(max_examples=60)
@given(st.integers(-1000, 1000), st.integers(-30, 30).filter(bool))
def test_integer_arithmetic_rounds_as_python(a: int, b: int) -> None:
    same(integers, a, b)
    assert integers.python(a, b) == integers.function(a, b)


@pytest.mark.parametrize("a", [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("b", [0.0, -0.0, 2.0, math.inf, math.nan])
def test_special_values(a: float, b: float) -> None:
    same(arithmetic, a, b, 3)
    same(comparisons, a, b, 3)


@settings(max_examples=30)
@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=20))
def test_loops_and_arrays(values: list[float]) -> None:
    x = np.array(values)
    n = len(x)
    same(loops, n, x)
    same(loops, 0, x)
    same(search, n, x, 0.5)
    same(last_value, n)
    same(last_value, 0)
    same(windows, n, x, np.zeros(n))
    same(nothing, 0, x)
    same(nothing, 1, x)
    order = np.random.default_rng(n).permutation(n).astype(np.int32)
    same(scatter, n, order, np.zeros(n, dtype=np.int64), x, x * 2)
    assert fast_sum(n, x) == pytest.approx(float(x @ x), rel=1e-14)


@native(small=True)
def small_sum(n: i64, x: f64s) -> f64:
    s = 0.0
    for k in range(n):
        s += x[k] * x[k]
    return s


def test_small_code_does_the_same() -> None:
    x = np.linspace(-1.0, 2.0, 17)
    small_sum.prepare()
    same(small_sum, 17, x)


def copied_and_cleared(n: i64, x: f64s, y: f64s, z: f64s) -> None:
    for k in range(n):
        y[k] = x[k]
    for k in range(n):
        z[k] = 0.0


called, in_place = native(copied_and_cleared), native(short=True)(copied_and_cleared)


@pytest.mark.parametrize("n", [0, 3, 17])
def test_short_loops_copy_and_clear(n: int) -> None:
    x = np.random.default_rng(n).standard_normal(n + 2)
    y, z = np.ones(n + 2), np.ones(n + 2)
    in_place(n, x, y, z)
    assert y.tolist() == [*x[:n], 1.0, 1.0]
    assert z.tolist() == [0.0] * n + [1.0, 1.0]


@pytest.mark.skipif(not engine.llvm_wanted(), reason="about the machine code")
def test_short_loops_call_nobody() -> None:
    code, other = (
        engine.compile_ir(unit_ir([function], 1), level=1, optimise=True) for function in (called, in_place)
    )
    for name in (b"memcpy", b"memset"):
        assert name in code
        assert name not in other


@native(fast=True)
def fast_extremes(n: i64, x: f64s, out: f64s) -> None:
    out[0], out[1] = x[0], x[0]
    for k in range(n):
        out[0] = max(out[0], x[k])
        out[1] = min(out[1], x[k])


@pytest.mark.skipif(not engine.llvm_wanted(), reason="plain Python keeps its own meaning")
@pytest.mark.parametrize("place", [0, 7, 18])
def test_fast_extremes_give_nan_where_an_argument_is_nan(place: int) -> None:
    x, out = np.random.default_rng(place).standard_normal(19), np.zeros(2)
    fast_extremes(x.size, x, out)
    assert out.tolist() == [x.max(), x.min()]
    x[place] = np.nan
    fast_extremes(x.size, x, out)
    assert np.isnan(out).all()


def test_nan_stays_visible_in_fast_functions() -> None:
    x = np.ones(9)
    x[4] = math.nan
    assert math.isnan(fast_sum(9, x))


def test_bound_scalars_can_be_changed() -> None:
    x = np.arange(6.0)
    bound = search.bind(6, x, 2.5)
    assert bound() == 3
    bound.set("bound", 4.5)
    assert bound() == 5
    bound.floats[bound.position("bound")] = 0.5
    assert bound() == 1
    bound.set("n", 1)
    assert bound() == -1
    with pytest.raises(NativeError, match="bind again"):
        bound.set("x", 1.0)


def test_bound_call_keeps_its_arrays_alive() -> None:
    bound = dot.bind(1000, np.ones(1000), np.full(1000, 2.0))
    junk = [np.zeros(1000) for _ in range(50)]
    assert bound() == 2000.0
    assert len(junk) == 50


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros(4, dtype=np.float32),
        np.zeros(8)[::2],
        np.zeros((2, 2)),
        [0.0, 1.0],
    ],
)
def test_wrong_arrays_are_refused(bad: Any) -> None:
    with pytest.raises(NativeError, match=r"dot\(\): y"):
        dot(1, np.zeros(4), bad)
    with pytest.raises(NativeError, match=r"dot\(\): y"):
        dot.bind(1, np.zeros(4), bad)


def test_read_only_and_empty_arrays() -> None:
    x = np.ones(3)
    x.flags.writeable = False
    assert dot(3, x, x) == 3.0
    assert dot(0, np.zeros(0), np.zeros(0)) == 0.0


def test_wrong_number_of_arguments() -> None:
    with pytest.raises(TypeError):
        dot(1, np.zeros(1))  # type: ignore[call-arg]
    with pytest.raises(NativeError, match="takes 3 arguments"):
        dot.bind(1)


def refused(body: str, signature: str = "n: i64, a: f64, x: f64s", result: str = "f64") -> str:
    """Message for a function that cannot be compiled."""
    text = "from stc.codegen.native import *\nimport math\nimport numpy as np\n@native\n"
    text += f"def wrong({signature}) -> {result}:\n" + "".join(f"    {line}\n" for line in body.splitlines())
    names = native_source(text, f"refused {abs(hash(body))}")
    with pytest.raises(NativeError) as caught:
        names["wrong"](1, 1.0, np.zeros(3))
    return str(caught.value)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return b", "b is not defined"),
        ("if n > 0:\n    return q\nq = 1.0\nreturn q", "q is read before"),
        ("return math.sin(a)", r"math.sin\(\) cannot be called"),
        ("k = 0\nk = a\nreturn a", "start it with a float"),
        ("n = 0\nx[a] = 1.0\nreturn a", "index is f64"),
        ("return x", "returned value is f64s"),
        ("return x[-1]", "negative indices"),
        ("return x[::2]", "step"),
        ("return a ** n", "exponent must be a constant"),
        ("return a % 2", "operator Mod"),
        ("for v in x:\n    pass\nreturn a", "range"),
        ("if a > 0:\n    return a", "without returning"),
        ("return None", "must be returned"),
        ("with a:\n    pass\nreturn a", "With statements"),
        ("return [a]", "List expressions"),
        ("a = n and 3\nreturn a", "conditions"),
        ("x[1:] = a\nreturn a", "single elements"),
        ("y += a\nreturn y", "before anything is assigned"),
        ("return np.pi if 'a' else a", "not a number"),
        ("return sqrt(a, a)", "takes 1 argument"),
        ("return a.real", "not defined"),
        ("a + 1\nreturn a", "without effect"),
        ("return a is n", "comparison Is"),
        ("for k in range(0, 3, 0):\n    pass\nreturn a", "step of range"),
        ("return x + a", "number is needed"),
    ],
)
def test_messages_name_the_line(body: str, message: str) -> None:
    if engine.requested_backend() == "python":
        pytest.fail("these tests compile: unset STC_BACKEND")
    text = refused(body)
    assert text.startswith("<refused ")
    assert text.split(">:")[1][0].isdigit()
    import re

    assert re.search(message, text), text


def test_signatures_are_checked_at_definition() -> None:
    with pytest.raises(NativeError, match="parameter b needs a type"):

        @native
        def untyped(a: f64, b) -> f64:  # type: ignore[no-untyped-def]
            return a

    with pytest.raises(NativeError, match="result must be"):

        @native
        def no_result(a: f64):  # type: ignore[no-untyped-def]
            return a

    with pytest.raises(NativeError, match="defaults"):

        @native
        def defaults(a: f64 = 1.0) -> f64:
            return a

    with pytest.raises(NativeError, match="plain parameters"):

        @native
        def variadic(*a: f64) -> f64:
            return 0.0


def test_local_functions_and_closures() -> None:
    size = 3

    @native
    def inner(a: f64) -> f64:
        return a * size

    @native
    def outer(a: f64) -> f64:
        return inner(a) + WIDTH

    assert outer(2.0) == 10.0
    assert outer.python(2.0) == 10.0


def test_functions_of_other_modules_are_compiled_along() -> None:
    names = native_source(
        "from stc.codegen.native import *\n@native\ndef twice(a: f64) -> f64:\n    return 2.0 * a\n", "other"
    )
    twice = names["twice"]

    @native
    def four_times(a: f64) -> f64:
        return twice(twice(a))

    assert four_times(1.5) == 6.0


def test_object_is_found_again_and_source_changes_are_noticed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("STC_CACHE_DIR", str(tmp_path))
    compiled: list[str] = []
    original = engine.compile_ir

    def counting(ir: str, **options: Any) -> bytes:
        compiled.append(ir)
        return original(ir, **options)

    monkeypatch.setattr(engine, "compile_ir", counting)
    text = (
        "from stc.codegen.native import *\nK = {}\n@native\ndef f(a: f64) -> f64:\n    return a * K + 1.0\n"
    )
    assert native_source(text.format("2.0"), "cached")["f"](3.0) == 7.0
    assert native_source(text.format("2.0"), "cached")["f"](3.0) == 7.0
    assert len(compiled) == 1
    assert native_source(text.format("4.0"), "cached")["f"](3.0) == 13.0
    assert len(compiled) == 2


def test_concurrent_first_calls() -> None:
    names = native_source(
        "from stc.codegen.native import *\n@native\ndef f(a: f64) -> f64:\n    return a + 1.0\n", "threads"
    )
    results: list[float] = []
    threads = [threading.Thread(target=lambda: results.append(names["f"](1.0))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [2.0] * 4


def test_python_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STC_BACKEND", "python")
    text = (
        "from stc.codegen.native import *\n@native\ndef f(n: i64, a: f64, x: f64s, k: i32s) -> f64:\n"
        "    for j in range(n):\n        x[j] = a / x[j] + k[j] * 2147483647\n    return x[0]\n"
    )
    f: Callable[..., float] = native_source(text, "plain")["f"]
    x = np.array([0.0, 2.0])
    k = np.array([0, 2], dtype=np.int32)
    assert f(2, 1.0, x, k) == math.inf
    assert x[1] == 0.5 + 2 * 2147483647
    bound = f.bind(1, 3.0, x, k)  # type: ignore[attr-defined]
    assert bound() == 0.0
    bound.set("a", math.inf)
    assert bound() == math.inf
    with pytest.raises(NativeError):
        f(2, 1.0, np.zeros(4)[::2], k)


def test_backend_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STC_BACKEND", "cuda")
    with pytest.raises(ValueError, match="cuda"):
        engine.llvm_wanted()
    monkeypatch.setenv("STC_BACKEND", "numpy")
    assert not engine.llvm_wanted()
