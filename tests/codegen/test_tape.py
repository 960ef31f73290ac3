from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
import tape_reference as reference
from hypothesis import given, settings
from numpy.typing import NDArray
from symbolic.random_expressions import NAMES, expressions, points, simplified
from tape_reference import count_ops

from stc.codegen.tape import Tape, build_tape
from stc.symbolic.differentiate import gradient, hessian, jacobian
from stc.symbolic.expr import ARITY, Expr, call, evaluate_all, num, raw, reachable, sum_of, sym

X, Y, C = sym("x"), sym("y"), sym("c")


def run(e: Expr, **values: float) -> float:
    tape = build_tape([e], [], list(values))
    return float(reference.run(tape, [], np.array([[v] for v in values.values()]))[0, 0])


def check_form(tape: Tape) -> None:
    """Operands come before results, flags are right, nothing is computed twice or in vain."""
    uniform = [True] * tape.n_uniform + [False] * tape.n_varying + [True] * len(tape.constants)
    read = set(tape.outputs)
    for number, (op, a, b) in enumerate(tape.ops):
        assert (b >= 0) == (ARITY[op] == 2)
        assert 0 <= a < tape.first_op + number
        assert b < tape.first_op + number
        uniform.append(uniform[a] and (b < 0 or uniform[b]))
        read |= {a, b}
    assert tape.uniform_ops == uniform[tape.first_op :]
    assert tape.uniform_ops == sorted(tape.uniform_ops, reverse=True)
    assert read >= set(range(tape.first_literal, tape.n_slots))
    assert len(set(tape.ops)) == len(tape.ops)
    assert len(set(tape.constants)) == len(tape.constants)
    assert all(0 <= slot < tape.n_slots for slot in tape.outputs)


@settings(max_examples=200)
@given(expressions())
def test_a_tape_means_its_expressions(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    outputs = [e, *gradient(e, NAMES)]
    at = points()
    uniform, varying = NAMES[:1], NAMES[1:]
    at["a"] = np.full_like(at["a"], at["a"][0])
    tape = build_tape(outputs, uniform, varying)
    check_form(tape)
    actual = reference.run(tape, [at["a"][0]], np.array([at[name] for name in varying]))
    nodes = reachable(outputs)
    every = [np.broadcast_to(v, (16,)) for v in evaluate_all([*nodes, *outputs], at)]
    # Reciprocals and products for powers round differently: compare where no part is tiny, huge or undefined.
    sizes = np.abs(np.array(every[: len(nodes)]))
    tame = np.all((sizes < 1e6) & ((sizes > 1e-6) | (sizes == 0.0)), axis=0)
    expected = np.array(every[len(nodes) :])
    np.testing.assert_allclose(actual[:, tame], expected[:, tame], rtol=1e-7, atol=1e-7)


def test_layout_of_slots_and_flags() -> None:
    tape = build_tape([C * 2.0 + X * Y, X * Y, Y, num(5.0), C], ["c", "unused"], ["x", "y"])
    check_form(tape)
    assert (tape.n_uniform, tape.n_varying, tape.constants) == (2, 2, [2.0, 5.0])
    assert (tape.first_literal, tape.first_op, tape.n_slots, tape.n_uniform_ops) == (4, 6, 9, 1)
    assert sorted(count_ops(tape).items()) == [("add", 1), ("mul", 2)]
    assert count_ops(tape, uniform=True) == {"mul": 1}
    assert count_ops(tape, uniform=False) == {"add": 1, "mul": 1}
    assert tape.outputs[2:] == [3, 5, 0]
    values = reference.run(tape, [10.0, np.nan], [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(values, [[23.0, 28.0], [3.0, 8.0], [3.0, 4.0], [5.0, 5.0], [10.0, 10.0]])


@pytest.mark.parametrize("exponent", [*range(-9, 10), 16, 31, 64, -64])
def test_whole_powers_need_no_power_function(exponent: int) -> None:
    for e in (raw("pow", X, num(exponent)), X**exponent):
        tape = build_tape([e], [], ["x"])
        assert set(count_ops(tape)) <= {"mul", "div"}
        assert sum(count_ops(tape).values()) <= 2 * max(1, abs(exponent)).bit_length()
        for x in (-1.3, -0.4, 0.7, 2.0):
            assert run(e, x=x) == pytest.approx(x**exponent, rel=2e-14)
    assert run(raw("pow", X, num(exponent)), x=0.0) == np.power(
        0.0, float(exponent), where=exponent >= 0, out=np.full((), np.inf)
    )


@pytest.mark.parametrize("exponent", [-3.5, -1.5, -0.5, 0.5, 1.5, 2.5, 7.5])
def test_half_powers_use_the_square_root(exponent: float) -> None:
    e = raw("pow", X, num(exponent))
    assert set(count_ops(build_tape([e], [], ["x"]))) <= {"mul", "div", "sqrt"}
    for x in (0.3, 1.0, 7.0):
        assert run(e, x=x) == pytest.approx(x**exponent, rel=1e-14)
    assert run(e, x=0.0) == (0.0 if exponent > 0 else np.inf)
    assert np.isnan(run(e, x=-1.0))


def test_whole_expressions_may_be_inputs() -> None:
    sine = call("sin", X * X + C)
    outputs = [sine * Y, Y / sine, X * X + C, call("sin", C + X * X), sine]
    tape = build_tape(outputs, ["c"], ["x", "y", sine])
    assert count_ops(tape) == {"add": 1, "div": 1, "mul": 2}
    results = reference.run(tape, [3.0], [[2.0], [5.0], [0.25]])
    assert results.ravel().tolist() == [1.25, 20.0, 7.0, 0.25, 0.25]


def test_what_is_below_an_input_alone_is_left_out() -> None:
    below = call("exp", sym("unknown"))
    tape = build_tape([below * X], [], ["x", below])
    assert count_ops(tape) == {"mul": 1}


@pytest.mark.parametrize("exponent", [-0.71, 0.25, 65.0, 1e10])
def test_other_powers_stay(exponent: float) -> None:
    e = raw("pow", X, num(exponent))
    assert count_ops(build_tape([e], [], ["x"])) == {"pow": 1}
    assert run(e, x=1.0 + 1e-9) == pytest.approx((1.0 + 1e-9) ** exponent, rel=1e-12)


def test_divisions_by_uniform_values_are_hoisted() -> None:
    tape = build_tape([X / C, Y / C, C / X], ["c"], ["x", "y"])
    assert count_ops(tape, uniform=True) == {"div": 1}
    assert count_ops(tape, uniform=False) == {"div": 1, "mul": 2}


def test_uniform_factors_of_a_product_are_multiplied_once() -> None:
    e = raw("mul", num(0.125), raw("mul", C, raw("mul", sym("d"), X)))
    tape = build_tape([e], ["c", "d"], ["x"])
    assert count_ops(tape, uniform=True) == {"mul": 2}
    assert count_ops(tape, uniform=False) == {"mul": 1}
    assert reference.run(tape, [3.0, 5.0], [[2.0]]).item() == pytest.approx(3.75, rel=1e-15)
    # What is needed besides stays, and takes no more operations than it did.
    tape = build_tape([C * (sym("d") * X), sym("d") * X + Y], ["c", "d"], ["x", "y"])
    assert count_ops(tape, uniform=False) == {"add": 1, "mul": 2}


def test_a_divisor_that_serves_several_quotients_is_inverted_once() -> None:
    d = X + C
    assert count_ops(build_tape([X / d, Y / d, C / d], ["c"], ["x", "y"]))["div"] == 1
    assert count_ops(build_tape([X / d], ["c"], ["x", "y"])) == {"add": 1, "div": 1}
    # Derivatives of a quotient divide by the square of the divisor: its reciprocal is a square too.
    quotient = Y / d
    tape = build_tape([quotient, *gradient(quotient, ["x", "y"])], ["c"], ["x", "y"])
    assert count_ops(tape)["div"] == 1
    second = [quotient, *gradient(quotient, ["x", "y"]), *hessian(quotient, ["x", "y"]).values()]
    assert count_ops(build_tape(second, ["c"], ["x", "y"]))["div"] == 1


def test_a_reciprocal_is_undefined_where_the_quotient_is() -> None:
    tape = build_tape([X / Y, num(1.0) / Y, (X + 1.0) / Y], [], ["x", "y"])
    values = reference.run(tape, [], [[0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 0.0, 2.0]])
    np.testing.assert_array_equal(values[0], [np.nan, np.inf, -np.inf, 0.0])
    np.testing.assert_array_equal(values[1], [np.inf, np.inf, np.inf, 0.5])


def test_wrong_inputs_are_refused() -> None:
    with pytest.raises(ValueError, match="the symbol 'y' is not an input"):
        build_tape([X + Y], [], ["x"])
    with pytest.raises(ValueError, match="named twice"):
        build_tape([X], ["x"], ["x"])
    tape = build_tape([X * C], ["c"], ["x"])
    with pytest.raises(ValueError, match="inputs of shapes"):
        reference.run(tape, [], np.zeros((1, 3)))
    with pytest.raises(ValueError, match="inputs of shapes"):
        reference.run(tape, [1.0], np.zeros(3))


def test_runs_of_any_length() -> None:
    tape = build_tape([call("sin", X) * 2.0, num(1.0)], [], ["x"])
    for count in (0, 1, 4095, 4096, 4097, 10_000):
        x = np.linspace(-3.0, 3.0, count)
        values = reference.run(tape, [], x[None])
        assert values.shape == (2, count)
        np.testing.assert_array_equal(values[0], 2.0 * np.sin(x))
    assert reference.run(build_tape([], [], []), [], np.zeros((0, 3))).shape == (0, 3)


def test_listing() -> None:
    tape = build_tape([X / C + 3.0], ["c"], ["x"])
    assert tape.text(["c"], ["x"], ["row 0"]).splitlines() == [
        "tape: 1 uniform inputs, 1 varying inputs, 2 literals, 1 operations once per call, 2 per instance, "
        "1 outputs",
        "once per call:",
        "  %0 = div 1.0, c",
        "per instance:",
        "  %1 = mul x, %0",
        "  %2 = add 3.0, %1",
        "outputs:",
        "  row 0 = %2",
    ]
    assert "  out0 = %2" in tape.text().splitlines()


def _swinging_links(count: int) -> tuple[list[Expr], list[str]]:
    """Sums of nested products, sines and cosines, like a chain's equations of motion."""
    rows: list[Expr] = []
    push_x, push_y = num(0.0), sym("g")
    for k in range(count):
        q, w = sym(f"q{k}"), sym(f"w{k}")
        push_x = push_x + sym("l") * (call("cos", q) * w - call("sin", q) * w * w)
        push_y = push_y + sym("l") * (call("sin", q) * w + call("cos", q) * w * w) / sym("m")
        rows.append(call("cos", q) * push_x + call("sin", q) * push_y / (1.0 + push_x * push_x))
    return rows, [f"{letter}{k}" for k in range(count) for letter in "qw"]


def _derivatives_tape(count: int) -> tuple[Tape, list[Expr], list[str]]:
    rows, keys = _swinging_links(count)
    weights = [f"y{k}" for k in range(count)]
    lagrangian = sum_of([sym(y) * row for y, row in zip(weights, rows, strict=True)])
    outputs = [*rows, *jacobian(rows, keys).values(), *hessian(lagrangian, keys).values()]
    return build_tape(outputs, ["g", "l", "m"], [*keys, *weights]), outputs, [*keys, *weights]


def test_derivatives_of_a_chain() -> None:
    tape, outputs, inputs = _derivatives_tape(6)
    check_form(tape)
    random = np.random.default_rng(0)
    varying: NDArray[np.float64] = random.normal(size=(len(inputs), 9))
    values = dict(zip(inputs, varying, strict=True)) | {"g": 9.8, "l": 0.4, "m": 1.2}
    expected = np.array([np.broadcast_to(v, (9,)) for v in evaluate_all(outputs, values)])
    actual = reference.run(tape, [9.8, 0.4, 1.2], varying)
    np.testing.assert_allclose(actual, expected, rtol=1e-10, atol=1e-10)


def test_digest_is_the_same_in_every_process_and_history() -> None:
    here = _derivatives_tape(3)[0].digest()
    program = "from codegen.test_tape import _derivatives_tape as f; print(f(3)[0].digest())"
    for seed in ("1", "2"):
        there = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert there.stdout.strip() == here
    assert _derivatives_tape(4)[0].digest() != here


def test_digest_tells_programs_apart() -> None:
    tapes = [
        build_tape([X + Y], [], ["x", "y"]),
        build_tape([X + Y], ["x"], ["y"]),
        build_tape([X - Y], [], ["x", "y"]),
        build_tape([X + Y, X], [], ["x", "y"]),
        build_tape([X + 1.0], [], ["x", "y"]),
        build_tape([X + 2.0], [], ["x", "y"]),
        build_tape([X + np.nextafter(2.0, 3.0)], [], ["x", "y"]),
    ]
    assert len({tape.digest() for tape in tapes}) == len(tapes)
