"""Programs with complementary pairs: published optima, other starts, and what the method is made of."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.solver import Options, Start, Status
from stc.solver.evaluator import Scaling
from stc.solver.pairs import Pairs, pairs_of
from stc.solver.penalised import Penalised
from stc.solver.presolve import presolved
from stc.solver.sqp import minimize
from stc.transcription.bind import BoundProgram

PROBLEMS = Path(__file__).parents[1] / "problems" / "complementarity"
PUBLISHED = json.loads((PROBLEMS / "published.json").read_text())
ASYMPTOTIC = {"dempe"}
"""The least objective is approached where an unknown grows without limit; another minimum is 31.25."""
BRANCHES = {"bilin": (-16.0, -13.0, -5.6), "bilevel3": (-8.6364,), "ex911": (-6.0,)}
"""Other local optima, with other choices of sides."""


def _program(path: Path) -> BoundProgram:
    model = stc.load(str(path))
    problem, transcription = model.transcription()
    return transcription.bind(problem.constants)


@pytest.mark.parametrize("name", sorted(set(PUBLISHED) - ASYMPTOTIC))
def test_published_optima(name: str) -> None:
    solution = stc.load(str(PROBLEMS / "static" / f"{name}.stc")).solve()
    assert solution.status == "optimal"
    optima = PUBLISHED[name], *BRANCHES.get(name, ())
    assert any(solution.objective == pytest.approx(optimum, rel=1e-5, abs=1e-4) for optimum in optima)
    found = solution.complementarity()
    assert found is not None and found.residual <= 1e-6 and found.b_stationary is not False


@pytest.mark.parametrize("name", ["outrata32", "bard3", "block", "ball", "twowalls"])
def test_other_starts(name: str) -> None:
    """A good deal off the guess, pairs are complementary at a solution just the same."""
    program = _program(next(PROBLEMS.glob(f"*/{name}.stc")))
    for seed in range(1, 4):
        x0 = program.x0 + np.random.default_rng(seed).uniform(-0.3, 0.3, program.n)
        result = minimize(program, Options(), start=Start(np.clip(x0, program.x_lower, program.x_upper)))
        assert result.status is Status.OPTIMAL
        assert program.pairs.residual(program, result.x) <= 1e-6


def test_a_block_sticks_and_slips() -> None:
    """Coulomb's law, from the numbers alone: no sliding below the limit, friction against the way at it."""
    solution = stc.load(str(PROBLEMS / "motions" / "block.stc")).solve()
    assert solution.status == "optimal"
    constants = solution.constants
    most = constants["mu"] * constants["m"] * constants["g"]
    v, friction = solution["v"][1:], (solution["fp"] - solution["fm"])[1:]
    assert np.abs(friction).max() <= most + 1e-6
    slides = np.abs(v) > 1e-5
    assert slides.any() and friction[slides] == pytest.approx(-most * np.sign(v[slides]), abs=1e-5)


def test_a_ball_stops_where_it_lands() -> None:
    """Implicit steps have a closed form until the floor is reached; then the ball rests on it."""
    solution = stc.load(str(PROBLEMS / "motions" / "ball.stc")).solve()
    assert solution.status == "optimal"
    h, g, k = solution.constants["h"], solution.constants["g"], np.arange(solution.n + 1)
    flight = 1.0 - g * h**2 * k * (k + 1) / 2
    assert solution["y"] == pytest.approx(np.maximum(flight, 0.0), abs=1e-6)
    landing = int(np.flatnonzero(flight < 0.0)[0])
    # One step brings it to the floor, the next takes the speed that this needed; then it rests with its weight.
    assert solution["p"][landing + 2 :] == pytest.approx(solution.constants["m"] * g * h, abs=1e-6)


def test_a_penalised_program_is_the_objective_plus_its_products() -> None:
    """Values against the program with rows, first derivatives against finite differences, in any scale."""
    program = _program(PROBLEMS / "motions" / "hopper.stc")
    pairs = program.pairs
    penalised = Penalised(program, pairs, 7.0)
    rng = np.random.default_rng(1)
    x = program.x0 + rng.uniform(0.1, 0.3, program.n)
    f, rows = program.values(x)
    rows = rows.copy()
    kept = np.setdiff1d(np.arange(program.m), pairs.product)
    own_f, own_rows = penalised.values(x)
    own_rows = own_rows.copy()
    assert own_f == pytest.approx(f + 7.0 * rows[pairs.product].sum(), rel=1e-12)
    assert own_rows == pytest.approx(rows[kept], rel=1e-12)

    y = rng.normal(size=penalised.m)

    def slope(at: np.ndarray) -> np.ndarray:
        gradient, jac, _ = penalised.derivatives(at, y, 1.0)
        total = gradient.copy()
        np.add.at(total, penalised.jac_cols, jac * y[penalised.jac_rows])
        return total

    def lagrangian(at: np.ndarray) -> float:
        value, r = penalised.values(at)
        return value + float(r @ y)

    d, step = rng.normal(size=program.n), 1e-5
    difference = (lagrangian(x + step * d) - lagrangian(x - step * d)) / (2 * step)
    assert slope(x) @ d == pytest.approx(difference, rel=1e-6)
    bend = (slope(x + step * d) - slope(x - step * d)) / (2 * step)
    _, _, hess = penalised.derivatives(x, y, 1.0)
    product = np.zeros(program.n)
    np.add.at(product, penalised.hess_rows, hess * d[penalised.hess_cols])
    off = penalised.hess_rows != penalised.hess_cols
    np.add.at(product, penalised.hess_cols[off], (hess * d[penalised.hess_rows])[off])
    assert product == pytest.approx(bend, rel=1e-5, abs=1e-4)

    variable = rng.uniform(0.5, 2.0, program.n)
    scaling = Scaling(
        variable, np.full(penalised.m, 3.0), 0.5, np.ones(program.n, bool), np.ones(penalised.m, bool)
    )
    scaled = penalised.evaluator(scaling)
    scaled.x[:] = x / variable
    scaled.values_call()
    assert scaled.f[0] == pytest.approx(0.5 * own_f, rel=1e-12)
    assert scaled.r == pytest.approx(3.0 * own_rows, rel=1e-12)


SPEC = """
constants: n = 3, k = {k};
variables: x, y;
constraints: [1, 2]: {rows};
objective: (x - 1)^2 + (y - 2)^2;
"""


@pytest.mark.parametrize(
    ("rows", "sides"),
    [
        ("0 <= x complements y >= 0", lambda x, y: (x, y)),
        ("2 <= x complements k >= y", lambda x, y: (x - 2, 5 - y)),
        ("x + y <= 9 complements 0 <= 3*y - x", lambda x, y: (9 - x - y, 3 * y - x)),
        ("-x <= 0 complements x*y >= 1", lambda x, y: (x, x * y - 1)),
        ("0 <= x complements y[i+1] >= 0", lambda x, y: (x, np.roll(y, -1))),
    ],
)
def test_sides_are_what_the_text_says(rows: str, sides) -> None:  # type: ignore[no-untyped-def]
    model = stc.load(SPEC.format(rows=rows, k=5))
    problem, transcription = model.transcription()
    program = transcription.bind(problem.constants)
    pairs = pairs_of(program)
    assert pairs is not None and len(pairs) == 2
    x = np.random.default_rng(2).uniform(1.0, 2.0, program.n)
    own = {
        name: np.array([x[p] for p in range(program.n) if transcription.layout.describe(p)[:2] == (name, 0)])
        for name in ("x", "y")
    }
    expected = np.array(sides(own["x"], own["y"]))[:, 1:3].T
    assert pairs.spare(program, x, program.values(x)[1].copy()) == pytest.approx(expected)


def test_a_side_that_another_statement_narrows_makes_no_pair() -> None:
    """``x`` cannot be nothing, so that ``y`` has to be: the product is a row like others."""
    model = stc.load(SPEC.format(rows="0 <= x complements y >= 0; x >= 0.5", k=0))
    solution = model.solve()
    assert solution.status == "optimal"
    assert solution["y"][1:3] == pytest.approx(0.0, abs=1e-5)
    problem, transcription = model.transcription()
    assert pairs_of(transcription.bind(problem.constants)) is None


def test_presolve_keeps_pairs_in_place() -> None:
    """A linear equation determines ``z``: places move, and products stay products of the same sides."""
    spec = """
    constants: n = 2;
    variables: w, z, x, y;
    constraints: [0, n]: w = 1.5; w + z = 3; 0 <= x complements y + z - 1 >= 0; 0 <= z complements x + y - 0.5 >= 0;
    objective: (x - 2)^2 + y^2;
    """
    problem, transcription = stc.load(spec).transcription()
    program = transcription.bind(problem.constants)
    less = presolved(program)
    assert less is not None and len(program.pairs) == 6 and len(less.pairs) == 3
    x = np.random.default_rng(3).uniform(1.0, 2.0, less.n)
    rows = less.values(x)[1].copy()
    spare = less.pairs.spare(less, x, rows)
    assert rows[less.pairs.product] == pytest.approx(spare.prod(axis=1))


def test_statements_that_cannot_be_met_are_infeasible_whatever_the_products() -> None:
    spec = "constants: n = 0; variables: x, y; constraints: 0 <= x complements y >= 0; x + y <= -1;"
    assert stc.load(spec).solve().status == "infeasible"


def test_pairs_that_cannot_be_complementary_are_no_solution() -> None:
    """Each side is held at 1 by a row that leaves nothing else."""
    spec = """
    constants: n = 0; variables: x, y;
    constraints: 0 <= x complements y >= 0; x*(2 - y) = 1; y*(2 - x) = 1;
    guess: x = 1.2; y = 0.9;
    """
    solution = stc.load(spec).solve()
    assert solution.status in ("failed", "infeasible")
    assert solution.complementarity() is None


def test_a_solution_is_a_start() -> None:
    """The weight is the products' multiplier: solving on takes a few steps."""
    model = stc.load(str(PROBLEMS / "motions" / "block.stc"))
    first = model.solve()
    again = model.solve(warm_start=first)
    assert again.status == "optimal"
    assert again.objective == pytest.approx(first.objective, rel=1e-8)
    assert again.iterations < first.iterations / 2


def test_no_pairs() -> None:
    none = Pairs.none()
    assert len(none) == 0
    assert none.among(np.arange(3), np.arange(2)).product.size == 0
