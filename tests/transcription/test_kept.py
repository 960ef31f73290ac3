"""Functions that derivatives share with the values: computed once, and never those of other variables."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import stc
from stc.codegen import threads
from stc.solver.evaluator import Part, Scaling
from stc.symbolic.expr import FUNCTIONS
from stc.transcription import evaluation
from stc.transcription.bind import BoundProgram

TEXT = """
    constants: n = 20, k = 0.5;
    variables: x, y, u;
    definitions: h = 0.1;
    guess: x = 0.3 + 0.05*t; y = 0.2 - 0.1*t; u = 1 + 0.1*t;
    constraints: [0, n]:
        x'' = u*sin(x) + exp(y); y' = tanh(x + y) - sqrt(1 + u^2)*sin(k) + atan2(y, u);
        sin(i/9)*x + x^2 <= 9;
    objective: [0, n]: integral(u^2 + cos(y) + log(2 + u)^2);
"""
BACKENDS = "llvm", "interpreter"


def bound(backend="auto", text: str = TEXT) -> BoundProgram:
    _, transcription = stc.load(text).transcription()
    transcription.compile(backend=backend)
    return transcription.bind()


def functions(tape) -> set[str]:
    return {op for op, _, _ in tape.ops[tape.n_uniform_ops :]} & set(FUNCTIONS)


def test_derivatives_evaluate_no_function_that_the_values_have() -> None:
    groups = bound("interpreter").program.groups
    assert sum(group.programs.kept for group in groups) > 8
    for group in groups:
        assert not functions(group.programs.derivatives_tape)
        outputs = len(group.rows) + (group.objective is not None) + group.programs.kept
        assert len(group.programs.values_tape.outputs) == outputs
    everything = set().union(*(functions(group.programs.values_tape) for group in groups))
    assert everything == {"sin", "cos", "exp", "tanh", "sqrt", "atan2", "log"}


def test_functions_that_only_derivatives_have_stay_there() -> None:
    """An arcsine's derivative has a square root of its own, a logarithm's no function."""
    text = """
        constants: n = 0; variables: a, b; guess: a = 0.5; b = 2;
        objective: [0]: asin(a) + log(b) + b^2.7 + a*b;
    """
    (group,) = bound("interpreter", text).program.groups
    assert group.programs.kept == 0
    assert functions(group.programs.derivatives_tape) == {"sqrt"}


@pytest.fixture(params=[False, True], ids=["one thread", "two threads"])
def shared(request, monkeypatch) -> Iterator[bool]:
    if request.param:
        monkeypatch.setattr(evaluation, "SHARED", 0)
        monkeypatch.setattr(evaluation, "OPERATIONS", 300)
        monkeypatch.setattr(evaluation, "NUMBERS", 16)
    before = threads._limit
    threads.limit(2 if request.param else 1)
    yield request.param
    threads.limit(before)


@pytest.mark.parametrize("backend", BACKENDS)
def test_derivatives_are_those_of_their_own_variables(backend, shared) -> None:
    rng = np.random.default_rng(3)
    nlp, y = bound(backend), rng.uniform(-1, 1, bound(backend).m)
    points = nlp.x0 + rng.uniform(-0.1, 0.1, (4, nlp.n))
    # each in a program that has evaluated nothing yet, and so no values either
    fresh = [[part.copy() for part in bound(backend).derivatives(x, y, 0.7)] for x in points]
    one, other = nlp.evaluator(Scaling.none(nlp.n, nlp.m)), nlp.as_stated()
    rows = nlp.m

    def values(x, evaluator) -> None:
        evaluator.x[:] = x
        evaluator.values_call()

    def same(k: int, evaluator) -> None:
        evaluator.x[:], evaluator.y[:], evaluator.weight[0] = points[k], y, 0.7
        evaluator.derivatives_call()
        for mine, expected in zip((evaluator.gradient, evaluator.jac, evaluator.hess), fresh[k], strict=True):
            assert (mine == expected).all()

    values(points[0], one)
    same(0, one)
    same(1, one)  # values are those of another point
    same(1, other)  # of this one, by another evaluator
    values(points[2], other)
    same(1, one)
    part = nlp.part_evaluator(Scaling.none(nlp.n, rows), everything(nlp))
    values(points[3], part)
    same(2, one)
    values(points[3], part)
    same(3, other)
    nearly = points[3].copy()
    nearly[-1] = np.nextafter(nearly[-1], 9.0)
    values(nearly, one)
    same(3, one)
    values(np.full(nlp.n, np.nan), one)
    same(0, other)


def everything(nlp: BoundProgram) -> Part:
    """A part that is the whole."""
    return Part.of(nlp, nlp.x0, np.ones(nlp.n, bool), np.ones(nlp.m, bool))


@pytest.mark.parametrize("backend", BACKENDS)
def test_values_are_evaluated_again_for_other_variables_only(backend, shared) -> None:
    nlp = bound(backend)
    one = [1.0] * nlp.m
    nlp.values(nlp.x0)
    nlp.derivatives(nlp.x0, one, 1.0)
    nlp.values_buffer[:] = np.nan  # would be mended by evaluating the values
    nlp.derivatives(nlp.x0, one, 1.0)
    assert np.isnan(nlp.values_buffer).all()
    nlp.derivatives(nlp.x0 + 1e-9, one, 1.0)
    assert not np.isnan(nlp.values_buffer).any()
