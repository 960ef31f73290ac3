"""Whole files: the problems with known answers, and the listings of the 2001 report."""

import math
import time
from itertools import pairwise
from pathlib import Path

import pytest
from reading import problem_of

from stc.errors import Source
from stc.language import elaborate, parse, read_problem
from stc.language.show import show_problem, show_syntax
from stc.problem import ParameterRef, VariableRef
from stc.symbolic.expr import evaluate, symbols

PROBLEMS = Path(__file__).parents[1] / "problems"
FILES = sorted(PROBLEMS.glob("*/*.stc"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_problem_with_a_known_answer_is_read(path: Path) -> None:
    tree = parse(Source(path.name, path.read_text(encoding="utf-8")))
    problem = elaborate(tree)
    assert problem.name == path.stem
    assert problem.variables or problem.parameters
    assert show_problem(problem)
    assert parse(Source("again", show_syntax(tree))).sections == tree.sections


def test_there_are_problems_to_read() -> None:
    assert len(FILES) > 60


def rosenbrock_chain(x: list[float]) -> float:
    return sum(100 * (b - a**2) ** 2 + (1 - a) ** 2 for a, b in pairwise(x))


def test_an_objective_has_the_value_of_its_formula() -> None:
    path = PROBLEMS / "nlp" / "x_rosenbrock_chain.stc"
    problem = read_problem(Source(path.name, path.read_text(encoding="utf-8")))
    (term,) = problem.objective
    x = [0.3 + 0.05 * k for k in range(20)]
    values = {ParameterRef(f"x{k + 1}"): value for k, value in enumerate(x)}
    assert evaluate(term.body, values) == pytest.approx(rosenbrock_chain(x), rel=1e-13)


def test_the_lamp_has_its_jumps_steps_and_momenta() -> None:
    path = PROBLEMS / "luxo" / "luxo_jump_free_impact.stc"
    source = Source(path.name, path.read_text(encoding="utf-8"))
    problem = read_problem(source)
    assert {jump.frame for jump in problem.jumps} == {20, 36}
    assert [str(piece.range) for piece in problem.definitions["h"]] == ["[0, 19]", "[20, 35]", "[36, 60]"]
    assert problem.structural == {"n", "k", "na", "nb"}
    assert not problem.warnings
    twice = read_problem(source, {"k": 2})
    assert (twice.n, {jump.frame for jump in twice.jumps}) == (120, {40, 72})


@pytest.mark.parametrize(
    ("name", "seconds"), [("luxo/luxo_jump_free_impact", 0.3), ("speed/p4_chain20", 1.5)]
)
def test_reading_takes_no_longer_than_ten_times_what_it_did(name: str, seconds: float) -> None:
    source = Source(name, (PROBLEMS / f"{name}.stc").read_text(encoding="utf-8"))
    start = time.process_time()
    read_problem(source)
    assert time.process_time() - start < seconds


REPORT = """
constants:
xi=0, yi=0, xf=10.0, yf=0, l=5.2, m0, m1, I0, I1, g=9.8;
# what the listings leave out
constants: n = 40, l1 = 1;
variables:
x, y, a0, a1;
variables: x0;
constraints:
[0, n/10]: # following constraints apply to frames [0, n/10]
x - xi;
y - yi;

[0, n]: # following constraints apply to all frames
m0*x0'' + m1*(-(l1*cos(a0 + a1)*(a0' + a1')^2) -
l1*sin(a0 + a1)*(a0'' + a1'') + x0'');
objective:
[0, n]:
# sum of the torques over frames 0 to n
(I0 * a0'')^2 + (I1 * a1'')^2;
"""


def test_the_listings_of_the_2001_report() -> None:
    problem = problem_of(REPORT, m0=1.0, m1=2.0, I0=0.5, I1=0.25)
    assert [str(relation.range) for relation in problem.relations] == ["[0, 4]", "[0, 4]", "[0, 40]"]
    assert all(relation.is_equality for relation in problem.relations)
    a0, w0, e0, a1, w1, e1, acceleration = 0.3, -0.7, 1.1, 0.2, 0.4, -0.9, 2.5
    values = dict(zip(["a0", "a0'", "a0''", "a1", "a1'", "a1''"], (a0, w0, e0, a1, w1, e1)))
    expected = 1.0 * acceleration + 2.0 * (
        -(math.cos(a0 + a1) * (w0 + w1) ** 2) - math.sin(a0 + a1) * (e0 + e1) + acceleration
    )
    numbers = {}
    for key in symbols(problem.relations[2].body):
        if isinstance(key, VariableRef):
            numbers[key] = acceleration if key.name == "x0" else values[key.name + "'" * key.order]
        else:
            numbers[key] = problem.constants[key.name]
    assert evaluate(problem.relations[2].body, numbers) == pytest.approx(expected, rel=1e-14)
    (term,) = problem.objective
    numbers = {k: values.get(f"{k.name}''", problem.constants.get(k.name, 0.0)) for k in symbols(term.body)}
    assert evaluate(term.body, numbers) == pytest.approx((0.5 * e0) ** 2 + (0.25 * e1) ** 2, rel=1e-14)


PARTICLE = """
# a particle passes three waypoints with the least acceleration
constants:
  n = 60, h = 1/30, g = 9.8, m = 1, xf = 2;

variables:
  x, y, fx, fy;

constraints:
  [0, n]:                      # these hold on frames 0 to n
    m*x'' - fx;                # an expression alone means "= 0"
    m*y'' = fy - m*g;
  [0]:    x; y; x'; y';        # starts at the origin, at rest
  [n/2]:  x = 1; y = 0.5;
  [n]:    x - xf; y; x'; y';
  [0, n]: fx^2 + fy^2 <= 400;

objective:
  [0, n]: integral(x''^2 + y''^2);
"""


def test_the_particle() -> None:
    problem = problem_of(PARTICLE)
    assert len(problem.relations) == 13
    assert not problem.warnings
    assert problem.structural == {"n"}
    (term,) = problem.objective
    assert term.integral and term.text == "integral(x''^2 + y''^2)"
