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
    assert found is not None
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
