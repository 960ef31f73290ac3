"""The transcription against the language's rules written out slowly, and its derivatives against differences."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from transcription.slow_reference import SlowMotion

from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.transcription import transcribe
from stc.transcription.statements import LINK

SHARED = Path(__file__).parent.parent / "problems"
SMALL = {
    "beam_load": {"n": 12},
    "brachistochrone": {"n": 6},
    "bryson_denham": {"n": 6},
    "cart_pole": {"n": 6},
    "catenoid": {"n": 9},
    "goddard_rocket": {"n": 8},
    "hop_free_durations": {"n": 16, "a": 6, "b": 10},
    "jump_bang_bang": {"n": 6},
    "jump_throw_bounce": {"n": 6, "a": 4},
    "min_jerk": {"n": 6},
    "min_time_double_integrator": {"n": 6},
    "particle_jet": {"n": 8},
    "pendulum_dae": {"n": 6},
    "pendulum_swing_up": {"n": 8},
    "periodic_shuttle": {"n": 6},
    "van_der_pol": {"n": 6},
}

TRICKY = {
    "two phases, central, uneven steps": """
        constants: n = 8, a = 3;
        variables: x, f;
        parameters: T;
        definitions: [0, a - 1]: h = T/a; [a, n]: h = 0.2;
        guess: T = 1;
        constraints: [0, n]: x'' + t*x' = f + i; [1, n - 1]: x''' - x[i+1]*x[i-1] <= 3*t;
          [0]: x'; x'[n] = x[n/2];
        objective: [0, n]: integral(T*x''^2 + f^2); [2, 5]: x'''' ^2; [0, n]: h*x[n - i];
    """,
    "steps that grow with i": """
        constants: n = 6;
        variables: x, u;
        parameters: T;
        definitions: h = T*(1 + i/n)/n;
        guess: T = 1;
        method: trapezoidal;
        constraints: [0, n]: x'' = u*t - x + h; [0]: x = 1; x[2]*x[4] = x'[n];
        objective: [0, n]: integral(u^2*t); [1]: T^2; [1, 4]: x[i+1]*x[2*i - 2];
    """,
    "numeric uneven steps, central": """
        constants: n = 7;
        variables: x;
        definitions: h = 0.1*(1 + i/n); v = x'*x; e = (x*v)';
        constraints: [0, n]: e <= 3; x'' >= -x^2*t;
        objective: [0, n]: integral(v^2); [0, n]: x''^2;
    """,
    "jumps, trapezoidal": """
        constants: n = 9, a = 3, b = 6;
        variables: x, u, w;
        parameters: T1, T2;
        definitions:
          [0, a]: h = T1/a; k = 2*x; [a + 1, n]: h = T2/(n - a);
          [0, a]: p = x^2*u; [a, b]: p = x*w*t; [b, n]: p = sin(x)*t;
        guess: T1 = 1; T2 = 0.7;
        method: trapezoidal;
        jumps: [a]: u; [b]: x', w; [n]: x'; [0]: u;
        constraints:
          [0, n]: x'' = u + p; u*w <= 2;
          [a, b]: u^2 + x'^2 <= 4;
          [b]: after(x') = -0.5*before(x') + before(p)*after(p'); u*x;
          [n]: after(x')^2 = before(x')*x; [2, 7]: x[i+1]*u[i-1] >= x'[a];
        objective: [0, n]: integral(p*u); [0, n]: p^2; [b]: x'^2*w; [0, a]: u^4; [a, n]: u*x';
    """,
    "jumps, hermite-simpson": """
        constants: n = 8, a = 2, b = 5;
        variables: x, u, w;
        parameters: T1, T2;
        definitions:
          [0, a - 1]: h = T1/a; [a, n]: h = T2/(n - a);
          [0, b - 1]: p = x^2*u; [b, n]: p = sin(x)*t + t*T1;
        guess: T1 = 1; T2 = 0.7;
        method: hermite-simpson;
        jumps: [a]: u; [b]: x', w; [n]: x'; [0]: u;
        constraints:
          [0, n]: x'' = u + p; u*w <= 2;
          [a, b]: u^2 + x'^2 <= 4;
          [b]: after(x') = -0.5*before(x') + before(p)*after(p'); u*x;
          [n]: after(x')^2 = before(x')*x; [2, 7]: x[i+1]*u[i-1] >= x'[a];
          T1 + T2 <= 3;
        objective: [0, n]: integral(p*u) - 2*integral(w^2)/3; [0, n]: p^2; [b]: x'^2*w; [0, a]: u^4; [a, n]: u*x';
          [1, 6]: x[i+1]^2;
    """,
    "definitions that end at jumps, hermite-simpson": """
        constants: n = 8, a = 2, b = 5;
        variables: x, u, w;
        definitions:
          h = 0.3; p = x^2*u; q = w;
          [b, n - 1]: h = 0.2;
          [0, a]: p = sin(x)*t;
          [a, b]: q = x*u;
          [b, n]: r = x*t; [0, b]: r = u^2;
        method: hermite-simpson;
        jumps: [a]: u; [b]: x', w;
        constraints:
          [0, n]: x'' = u + p; q*w <= 2 + r + h;
        objective: [0, n]: integral(p*u + r^2); [0, n]: p^2 + q; [1, 6]: q*r;
    """,
    "definitions of which some are relative, hermite-simpson": """
        constants: n = 8, a = 3, b = 5;
        variables: x, u;
        definitions:
          h = 0.2; f = x*u; g = u^2;
          [0, a]: f = x[i+1] - u;
          [b, n - 2]: g = x[i+2]*u[i-1];
        method: hermite-simpson;
        jumps: [a]: u;
        constraints: [0, n]: x' = u; f*g <= 3;
        objective: [0, n]: f^2; [1, 6]: g; [2, 7]: integral(f*g); [0, n]: integral(g^2);
    """,
}


def cases():
    for name, overrides in SMALL.items():
        yield pytest.param((SHARED / "traj" / f"{name}.stc").read_text(), overrides, id=name)
    yield pytest.param(
        (SHARED / "luxo" / "luxo_jump_free_impact.stc").read_text(),
        {"n": 12, "na": 4, "nb": 8},
        id="luxo_jump",
    )
    for name, text in TRICKY.items():
        yield pytest.param(text, {}, id=name)


def bound_at_random(text, overrides, method=None):
    problem = elaborate(parse(Source("case", text)), overrides, method)
    transcription = transcribe(problem)
    transcription.compile(backend="interpreter")
    bound = transcription.bind()
    rng = np.random.default_rng(11)
    free = bound.x0 + 0.1 * rng.standard_normal(bound.n)
    for at in transcription.layout.parameters.values():
        free[at] = bound.x0[at] * 1.1 + 0.01
    low, high = bound.x_lower, bound.x_upper
    x = np.where(low == high, low, np.clip(free, low + 1e-3 * (high - low > 1), high))
    return problem, transcription, bound, np.where(np.isfinite(x), x, free)


@pytest.mark.parametrize(("text", "overrides"), list(cases()))
def test_rows_and_objective_mean_what_the_language_says(text, overrides):
    problem, transcription, bound, x = bound_at_random(text, overrides)
    slow = SlowMotion(problem, transcription.layout, x)
    objective, rows = bound.values(x)
    assert objective == pytest.approx(slow.objective(), rel=1e-9, abs=1e-9)

    program = transcription.program
    found = {}
    for row in range(bound.m):
        group = program.groups[program.row_group[row]]
        statement = group.rows[program.row_number[row]]
        instance = program.row_instance[row]
        number = int(statement.relation[instance])
        if number == LINK:
            continue
        nodes = group.nodes
        side = ("", "before", "after")[nodes.side[instance]]
        at = (Fraction(int(nodes.position[instance]), 2), side)
        found[number, at] = (rows[row], bound.row_lower[row], bound.row_upper[row])
    bounded = {b.relation for b in transcription.statements.bounds}
    for number, relation in enumerate(problem.relations):
        nodes = slow.nodes(relation.range.first, relation.range.last, relation.body)
        expected = slow.defined(relation.body, nodes)
        low = {node: slow.value(relation.lower, node) for node in expected} if relation.lower else {}
        high = {node: slow.value(relation.upper, node) for node in expected} if relation.upper else {}
        mine = {at: v for (k, at), v in found.items() if k == number}
        if number in bounded and not mine:
            for (
                node,
                value,
            ) in expected.items():  # bounds hold at x by construction, to the slack it was given
                assert value >= low.get(node, -np.inf) - 1e-9
                assert value <= high.get(node, np.inf) + 1e-9
            continue
        for node, value in expected.items():
            row = mine.get(node)
            if row is None:  # the same row as its twin on the other side, or as an earlier equal relation
                same_place = [v for (_, at), v in found.items() if at[0] == node[0]]
                twins = [v[0] - v[1] + low.get(node, 0.0) for v in same_place] + [v[0] for v in mine.values()]
                assert any(abs(t - value) < 1e-9 * max(1.0, abs(value)) for t in twins)
                continue
            shift = 0.0
            if node in low:
                shift = row[1] - low[node] if np.isfinite(row[1]) else row[2] - high.get(node, low[node])
            elif node in high:
                shift = row[2] - high[node]
            assert row[0] - value == pytest.approx(shift, rel=1e-8, abs=1e-8 * max(1.0, abs(value)))
        assert set(mine) <= set(expected)


@pytest.mark.parametrize(("text", "overrides"), list(cases()))
def test_derivatives_against_differences(text, overrides):
    _, _, bound, x = bound_at_random(text, overrides)
    rng = np.random.default_rng(5)
    multipliers = rng.standard_normal(bound.m)
    factor = 0.7
    shape = (bound.m, bound.n)

    def first(at):
        gradient, jacobian, hessian = bound.derivatives(at, multipliers, factor)
        dense = np.zeros(shape)
        dense[bound.jac_rows, bound.jac_cols] = jacobian
        lower = np.zeros((bound.n, bound.n))
        lower[bound.hess_rows, bound.hess_cols] = hessian
        return gradient.copy(), dense, lower + np.tril(lower, -1).T

    def slope(quantity, direction, e=1e-5):
        """The directional derivative by a fourth-order difference."""
        points = [quantity(x + k * e * direction) for k in (-2, -1, 1, 2)]
        return (points[0] - 8 * points[1] + 8 * points[2] - points[3]) / (12 * e)

    def everything(at):
        f, r = bound.values(at)
        return np.concatenate([[f], r])

    def lagrangian_gradient(at):
        g, j, _ = first(at)
        return factor * g + j.T @ multipliers

    gradient, jacobian, hessian = first(x)
    for _ in range(6):
        direction = rng.standard_normal(bound.n)
        size = np.abs(direction)
        expected = np.concatenate([[gradient @ direction], jacobian @ direction])
        scale = 1 + np.concatenate([[np.abs(gradient) @ size], np.abs(jacobian) @ size])
        assert np.all(np.abs(slope(everything, direction) - expected) < 1e-6 * scale)
        scale = 1 + np.abs(hessian) @ size + np.abs(jacobian).T @ np.abs(multipliers)
        assert np.all(np.abs(slope(lagrangian_gradient, direction) - hessian @ direction) < 1e-6 * scale)
