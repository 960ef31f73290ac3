"""Published estimation problems come to the published estimates and standard errors, to the digits that are given."""

import pytest

from stc.errors import Source
from stc.pipeline import Model
from stc.studies.uncertainty import uncertainty

from .published import PROBLEMS, Estimate


@pytest.mark.parametrize("name", list(PROBLEMS))
def test_estimates_and_standard_errors_are_the_published_ones(name: str) -> None:
    published = PROBLEMS[name]
    model = Model(Source(f"{name}.stc", published.spec))
    solution = model.solve(tolerance=1e-12)
    assert solution.status == "optimal"
    found = uncertainty(model, solution)
    assert found.freedom == published.freedom
    assert_digits(found.deviation, published.deviation)
    for estimate in published.estimates:
        assert_digits(solution.parameters[estimate.name], estimate.value)
        assert_digits(found.errors[estimate.name], estimate.error)


def assert_digits(value: float, published: str) -> None:
    """Within one unit of the last digit; of eleven digits, within ten: that is where the grid's own error begins."""
    digits = sum(map(str.isdigit, published.split("E")[0].lstrip("-0.")))
    units = 10.0 if digits >= 10 else 1.0
    assert abs(value - float(published)) <= units * Estimate.unit(published)


def test_there_are_ten_and_six_have_differential_equations() -> None:
    assert len(PROBLEMS) >= 10
    assert sum(problem.differential for problem in PROBLEMS.values()) >= 6


PINENE = """
constants: n = 120, T = 36420, h = T/n;
variables: for k in 1..5: y{k};
parameters: for k in 1..5: p{k};
data: box = (time, y1, y2, y3, y4, y5):
  (1230, 88.35, 7.3, 2.3, 0.4, 1.75), (3060, 76.4, 15.6, 4.5, 0.7, 2.8), (4920, 65.1, 23.1, 5.3, 1.1, 5.8),
  (7800, 50.4, 32.9, 6.0, 1.5, 9.3), (10680, 37.5, 42.7, 6.0, 1.9, 12.0), (15030, 25.9, 49.1, 5.9, 2.2, 17.0),
  (22620, 14.0, 57.4, 5.1, 2.6, 21.0), (36420, 4.5, 63.1, 3.8, 2.9, 25.7);
constraints:
  [0, n]: y1' = -(p1 + p2)*y1; y2' = p1*y1; y3' = p2*y1 - (p3 + p4)*y3 + p5*y5; y4' = p3*y3; y5' = p4*y3 - p5*y5;
  [0]: y1 = 100; for k in 2..5: y{k} = 0;
  for k in 1..5: p{k} >= 0;
objective: [box]: sum(k in 1..5: (y{k} - box.y{k})^2);
guess: y1 = 100*exp(-t/1e4); y2 = 60*(1 - exp(-t/1e4)); y3 = 5; y4 = 2; y5 = 25*(1 - exp(-t/1e4));
  for k in 1..5: p{k} = 1e-5;
method: hermite-simpson;
"""


def test_the_isomerisation_of_alpha_pinene_has_the_published_rates() -> None:
    """Box, Hunter, MacGregor and Erjavec, Technometrics 15, 1973: rates per second times 1e5, least squares 19.87."""
    solution = Model(Source("pinene.stc", PINENE)).solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(19.87, abs=0.005)
    rates = [1e5 * solution.parameters[f"p{k}"] for k in range(1, 6)]
    for rate, published in zip(rates, ("5.93", "2.96", "2.05", "27.5", "4.00"), strict=True):
        assert abs(rate - float(published)) <= Estimate.unit(published)
