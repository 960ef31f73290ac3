"""Evaluators against the same numbers scaled in NumPy, and sums of outputs against sums written out."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import stc
from stc.codegen import threads
from stc.core.calls import Bound, chain
from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.solver.evaluator import Scaling, evaluator_of, python_evaluator
from stc.transcription import evaluation, transcribe
from stc.transcription.gather import FEW, RUN, Copying, Folding, total

PROBLEMS = Path(__file__).parent.parent / "problems" / "traj"
SPECS = {
    "brachistochrone": {"n": 7},
    "cart_pole": {"n": 9},
    "goddard_rocket": {"n": 20},  # final time: sums over all frames
    "hop_free_durations": {"n": 16, "a": 6, "b": 10},
    "min_time_double_integrator": {"n": 6},
    "pendulum_dae": {"n": 6},
}
# one variable twice in a statement's inputs at some nodes, long sums, an objective at single frames
MIRRORED = """
    constants: n = 12;
    variables: x, u;
    parameters: T;
    definitions: h = T/n;
    guess: T = 1; x = 1 + t; u = t;
    constraints: [0, n]: x'' = u*t; x[n - i]*x*T >= -9; x[6]*x^2*u <= 9; [0]: x = 1;
    objective: [0, n]: integral(u^2*x[6]*T); [1]: T^2;
"""


def bound_program(name: str, backend="auto"):
    if name == "mirrored":
        source, constants = Source("mirrored", MIRRORED), {}
    else:
        source, constants = Source(name, (PROBLEMS / f"{name}.stc").read_text()), SPECS[name]
    transcription = transcribe(elaborate(parse(source), constants))
    transcription.compile(backend=backend)
    return transcription.bind(check=False)


def random_scaling(nlp, rng) -> Scaling:
    return Scaling(
        np.exp2(rng.integers(-3, 4, nlp.n)),
        rng.uniform(0.1, 3.0, nlp.m),
        float(rng.uniform(0.1, 3.0)),
        rng.random(nlp.n) > 0.2,
        rng.random(nlp.m) > 0.2,
    )


@pytest.mark.parametrize("backend", ["auto", "interpreter"])
@pytest.mark.parametrize("name", [*SPECS, "mirrored"])
def test_evaluator_scales_values_and_derivatives(name, backend, monkeypatch):
    if backend == "interpreter":
        monkeypatch.setenv("STC_BACKEND", "python")
    nlp = bound_program(name, backend)
    rng = np.random.default_rng(3)
    for scaling in (Scaling.none(nlp.n, nlp.m), random_scaling(nlp, rng)):
        own = nlp.evaluator(scaling)
        assert own.derivatives_call.native and own.values_call.native
        for weight in (1.0, 0.4):
            x = nlp.x0 + 0.1 * rng.standard_normal(nlp.n)
            y = rng.standard_normal(nlp.m)
            own.x[:], own.y[:], own.weight[0] = x / scaling.variable, y, weight
            own.values_call()
            own.derivatives_call()
            f, r = nlp.values(x)
            parts = [np.array(p) for p in nlp.derivatives(x, y * scaling.row, weight * scaling.objective)]
            live = scaling.variable * scaling.live
            np.testing.assert_allclose(own.f[0], scaling.objective * f, rtol=1e-14)
            np.testing.assert_allclose(own.r, scaling.row * r, rtol=1e-14)
            np.testing.assert_allclose(own.gradient, scaling.objective * parts[0] * live, rtol=1e-13)
            rows = (scaling.row * scaling.bounded)[nlp.jac_rows]
            np.testing.assert_allclose(own.jac, parts[1] * rows * live[nlp.jac_cols], rtol=1e-13)
            columns = live[nlp.hess_rows] * live[nlp.hess_cols]
            np.testing.assert_allclose(own.hess, parts[2] * columns, rtol=1e-13)
            assert own.values_status[0] == own.derivatives_status[0] == 0.0


@pytest.mark.parametrize("name", [*SPECS, "mirrored"])
def test_pieces_and_threads_give_the_same_bits(name, monkeypatch):
    monkeypatch.setattr(threads, "_processors", lambda: 2)
    nlp = bound_program(name)
    rng = np.random.default_rng(6)
    scaling = random_scaling(nlp, rng)
    evaluators = [nlp.evaluator(scaling)]
    for limit, size in (("OPERATIONS", 50), ("NUMBERS", 10), ("OUTPUTS", 60), ("SHARED", 1)):
        monkeypatch.setattr(evaluation, limit, size)  # everything is large
    nlp._pieces.clear()  # pieces are cut anew
    nlp._wanted.clear()
    for count in (1, 2):
        threads.limit(count)
        evaluators.append(nlp.evaluator(scaling))
    assert evaluation._shared(nlp, values=True)
    threads.limit(None)
    for healthy in (True, False) * 5:
        x, y = nlp.x0 + 0.1 * rng.standard_normal(nlp.n), rng.standard_normal(nlp.m)
        x[0] = x[0] if healthy else np.nan
        for each in evaluators:
            each.x[:], each.y[:] = x, y
            each.values_call()
            each.derivatives_call()
        for field in ("f", "r", "values_status", "gradient", "jac", "hess", "derivatives_status"):
            for other in evaluators[1:]:
                np.testing.assert_array_equal(
                    getattr(evaluators[0], field), getattr(other, field), err_msg=field
                )
        assert np.isnan(evaluators[2].values_status[0]) != healthy


def test_any_problem_has_an_evaluator():
    nlp = bound_program("cart_pole")

    class Plain:
        """The same problem without evaluators of its own."""

        n, m = nlp.n, nlp.m
        jac_rows, jac_cols, hess_rows, hess_cols = nlp.jac_rows, nlp.jac_cols, nlp.hess_rows, nlp.hess_cols
        values, derivatives = nlp.values, nlp.derivatives

    rng = np.random.default_rng(4)
    scaling = random_scaling(nlp, rng)
    one, other = evaluator_of(nlp, scaling), evaluator_of(Plain(), scaling)
    assert one.values_call.native and not other.values_call.native
    x, y = nlp.x0 + 0.1 * rng.standard_normal(nlp.n), rng.standard_normal(nlp.m)
    for each in (one, other):
        each.x[:], each.y[:], each.weight[0] = x, y, 0.7
        chain([each.values_call, each.derivatives_call])()
    for name in ("f", "r", "values_status", "gradient", "jac", "hess", "derivatives_status"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-14, err_msg=name)


@pytest.mark.parametrize("make", [evaluator_of, python_evaluator])
def test_status_tells_of_numbers_that_are_none(make):
    text = "constants: n = 3; variables: x; guess: x = 1; constraints: [0, n]: log(x) >= 0; objective: [0, n]: x;"
    transcription = transcribe(elaborate(parse(Source("log", text)), {}))
    transcription.compile()
    nlp = transcription.bind()
    evaluator = make(nlp, Scaling.none(nlp.n, nlp.m))
    for value, healthy in ((-1.0, False), (1.0, True), (0.0, False), (2.0, True)):
        evaluator.x[:] = 1.0
        evaluator.x[1] = value
        evaluator.y[:] = 1.0
        evaluator.values_call()
        evaluator.derivatives_call()
        assert (evaluator.values_status[0] == 0.0) == healthy
        assert np.isnan(evaluator.values_status[0]) != healthy
        # 1/x and -1/x^2 have values left of zero
        assert (evaluator.derivatives_status[0] == 0.0) == (value != 0.0)


def test_calls_are_counted():
    nlp = bound_program("cart_pole")
    evaluator = nlp.evaluator(Scaling.none(nlp.n, nlp.m))
    nlp.values(nlp.x0)
    for _ in range(3):
        evaluator.values_call()
    evaluator.derivatives_call()
    assert (nlp.evaluations, nlp.derivative_evaluations) == (4, 1)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 3 * FEW), min_size=1, max_size=12), st.integers(0, 2**31))
def test_outputs_add_up_to_entries(counts, seed):
    rng = np.random.default_rng(seed)
    start = np.concatenate([[0], np.cumsum(counts)])
    size = int(start[-1]) + 5
    source = rng.permutation(size)[: start[-1]]
    doubled = rng.permutation(source)[: rng.integers(0, len(source) + 1)]
    buffer = np.ldexp(rng.integers(-1000, 1000, size).astype(float), -5)  # sums are exact
    factor = np.ones(size)
    factor[doubled] = 2.0
    expected = [float((buffer * factor)[source[a:b]].sum()) for a, b in pairwise(start)]
    out, scale = np.zeros(len(counts)), np.exp2(rng.integers(-2, 3, len(counts)))
    first = source[start[:-1]].astype(np.int32)
    calls: list[Bound] = Folding.of(start, source, doubled).bind(buffer)
    chain([*calls, *Copying.of(first).bind(buffer, scale, out, np.zeros(1))])()
    assert out.tolist() == (scale * expected).tolist()


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(1, 3 * RUN), max_size=8), st.booleans(), st.integers(0, 2**31))
def test_numbers_go_to_their_places_in_runs_or_one_by_one(lengths, alike, seed):
    rng = np.random.default_rng(seed)
    size = int(sum(lengths)) + 10 * len(lengths) + 1

    def places():
        """Runs in any order, apart from each other."""
        begins = np.cumsum([0, *(length + rng.integers(0, 10) for length in lengths[:-1])])
        return np.concatenate([np.arange(b, b + k) for b, k in zip(begins, lengths)] or [[]]).astype(np.int32)

    source, at = places(), places()
    scale = np.ones(len(at)) if alike else rng.uniform(0.5, 2.0, len(at))
    buffer, out, status = rng.standard_normal(size), np.full(size, 7.0), np.zeros(1)
    expected = out.copy()
    expected[at] = scale * buffer[source]
    for call in Copying.of(source, at).bind(buffer, scale, out, status):
        call()
    np.testing.assert_array_equal(out, expected)
    assert status[0] == 0.0
    if len(source):
        buffer[source[rng.integers(len(source))]] = np.inf
        for call in Copying.of(source, at).bind(buffer, scale, out, status):
            call()
        assert np.isnan(status[0])


def test_long_sums_are_accurate():
    rng = np.random.default_rng(5)
    buffer = rng.uniform(0.0, 1.0, 100_000)
    out, status = np.zeros(1), np.zeros(1)
    total(buffer, np.arange(buffer.size, dtype=np.int32), np.ones(1), out, status)()
    exact = math.fsum(buffer)
    assert abs(out[0] - exact) <= 4e-14 * exact
    assert status[0] == 0.0


@pytest.mark.parametrize("name", ["mirrored", *SPECS])
def test_fixed_curvature_is_the_same_everywhere(name: str) -> None:
    """Where it is promised for a variable, its second derivatives depend on neither variables nor multipliers."""
    program = bound_program(name)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(4):
        x = np.abs(program.x0) + rng.uniform(0.5, 1.5, program.n)
        found.append(program.derivatives(x, rng.standard_normal(program.m), 1.0)[2].copy())
    fixed = program.fixed_curvature
    promised = fixed[program.hess_rows] | fixed[program.hess_cols]
    for other in found[1:]:
        np.testing.assert_allclose(other[promised], found[0][promised], rtol=1e-12, atol=1e-12)
    changes = np.abs(np.array(found) - found[0]).max(axis=0) > 1e-9
    assert not fixed[program.hess_rows[changes]].any()


SUMS = """
    constants: n = 4, c = 2;
    variables: x;
    parameters: T;
    guess: T = 1; x = 1 + t;
    constraints: [0, n]: 3*x + x[n - i]*T + x[n - i]/c >= 0;
    objective: [0, n]: 5*x + x[n - i] + x^2;
"""


def program_of(text: str, backend: str = "auto"):
    transcription = transcribe(elaborate(parse(Source("sums", text)), {}))
    transcription.compile(backend=backend)
    return transcription.bind(check=False)


@pytest.mark.parametrize("backend", ["auto", "interpreter"])
def test_constants_and_what_varies_add_up(backend) -> None:
    """In the middle, the mirrored unknown is the node's own: 3 + 1/c, a constant, and T are one entry."""
    nlp = program_of(SUMS, backend)
    scaling = Scaling(
        np.full(nlp.n, 2.0), np.full(nlp.m, 0.5), 3.0, np.ones(nlp.n, bool), np.ones(nlp.m, bool)
    )
    evaluator = nlp.evaluator(scaling)
    parameter = int(np.flatnonzero(np.bincount(nlp.jac_cols, minlength=nlp.n) == nlp.m)[0])
    x_at = np.delete(np.arange(nlp.n), parameter)
    for again in range(3):
        x = nlp.x0 + again
        evaluator.x[:] = x / 2.0
        evaluator.derivatives_call()
        jac, expected = np.zeros((nlp.m, nlp.n)), np.zeros((nlp.m, nlp.n))
        jac[nlp.jac_rows, nlp.jac_cols] = evaluator.jac
        for i in range(5):
            expected[i, x_at[i]] += 3.0
            expected[i, x_at[4 - i]] += x[parameter] + 0.5
            expected[i, parameter] += x[x_at[4 - i]]
        np.testing.assert_allclose(jac, expected, rtol=1e-14)
        gradient = np.zeros(nlp.n)
        gradient[x_at] = 6.0 + 2.0 * x[x_at]
        np.testing.assert_allclose(evaluator.gradient, 6.0 * gradient, rtol=1e-14)
        assert evaluator.derivatives_status[0] == 0.0


def test_constants_that_are_none_are_told_of_each_time() -> None:
    nlp = program_of(SUMS.replace("c = 2", "c = 0"))
    evaluator = nlp.evaluator(Scaling.none(nlp.n, nlp.m))
    for _ in range(2):
        evaluator.x[:] = nlp.x0
        evaluator.derivatives_call()
        assert np.isnan(evaluator.derivatives_status[0])


@pytest.mark.parametrize("name", ["mirrored", *SPECS])
def test_constants_are_what_never_changes(name: str) -> None:
    """No kernel computes an entry of the Jacobian again that is the same everywhere."""
    nlp = bound_program(name)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(4):
        x = np.abs(nlp.x0) + rng.uniform(0.5, 1.5, nlp.n)
        found.append(nlp.derivatives(x, rng.standard_normal(nlp.m), rng.random())[1].copy())
    never = np.abs(np.array(found) - found[0]).max(axis=0) == 0.0
    constant = nlp.program.jacobian.first >= nlp.program.varying_size
    assert constant.any() == (name != "mirrored")  # all steps of which are a parameter's
    np.testing.assert_array_equal(never, constant)


def test_torques_have_a_fixed_curvature() -> None:
    """The equations of a chain are affine in them, and their squares are the objective."""
    spec = PROBLEMS.parent / "speed" / "p3_chain5.stc"
    problem, transcription = stc.load(spec).transcription(n=6)
    program = transcription.bind(problem.constants)
    torques = np.concatenate(
        [before for name, order, before, _, _ in transcription.layout.slots() if name.startswith("tau")]
    )
    np.testing.assert_array_equal(np.sort(torques), np.flatnonzero(program.fixed_curvature))
