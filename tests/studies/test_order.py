"""The observed order of convergence, and the specs that cannot be refined as they are written."""

from __future__ import annotations

import math

import pytest

from stc.errors import UsageError
from stc.pipeline import Model, load
from stc.studies.order import observe_order
from stc.validate import limits

# A particle from rest to rest; what its objective weighs makes the motion no polynomial.
TEXT = """\
constants: n = 8, T = 1, h = T/n, g = 9.8, m = 1;
variables: x, y, fx, fy;
constraints:
  [0, n]: m*x'' = fx; m*y'' = fy - m*g;
  [0]: x; y; x'; y';
  {more}
  [n]: x = 1; y = 0.5; x'; y';
objective: {objective};
method: hermite-simpson;
replay:
  model = "particle.xml";
  joint x = x; joint z = y;
  actuator fx = fx; actuator fz = fy;
"""


def spec(more: str = "", objective: str = "integral(fx^2 + fy^2 + 40*x^2*y^2)", **changes: str) -> Model:
    text = TEXT.format(more=more, objective=objective)
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    return load(text)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("name", "method", "least"),
    [
        ("arm_reach", "hermite-simpson", 3.9),
        ("arm_reach", "trapezoidal", 1.9),
        ("arm_reach", "central", 1.8),
        ("luxo_poses", "hermite-simpson", 3.9),
        ("luxo_poses", "trapezoidal", 1.9),
        ("luxo_poses", "central", 1.8),
    ],
)
def test_bundled_motions_converge_at_their_methods_order(name: str, method: str, least: float) -> None:
    report = observe_order(load(name), method)
    assert report.passed
    assert report.metrics[0].value >= least
    assert report.metrics[0].value < least + 0.5
    assert [level.n for level in report.levels] == [60, 120, 240]
    assert report.metrics[0].limit == limits.ORDER[method]


def test_a_particle_converges_and_its_duration_is_kept() -> None:
    report = observe_order(spec(), "trapezoidal")
    assert report.metrics[0].value == pytest.approx(2.0, abs=0.15)
    assert {metric.subject for metric in report.metrics} == {"n = 16 to 32", "joint x", "joint z"}
    found = report.to_dict()
    assert found["passed"] is True
    assert [level["n"] for level in found["levels"]] == [8, 16, 32]
    assert found["metrics"][0]["at_least"] is True


def test_a_step_that_is_a_number_is_refined_with_n() -> None:
    given = observe_order(spec(), "trapezoidal")
    fixed = observe_order(spec(step=("T = 1, h = T/n", "h = 0.125")), "trapezoidal")
    assert fixed.metrics[0].value == pytest.approx(given.metrics[0].value, rel=1e-6)


def test_a_constant_may_decide_all_frame_numbers() -> None:
    model = spec("[m8]: y >= 0.1;", number=("n = 8, T = 1", "k = 2, m8 = 2*k, n = 4*k, T = 1"))
    report = observe_order(model, "trapezoidal")
    assert [level.n for level in report.levels] == [8, 16, 32]


def test_a_motion_that_is_exact_shows_no_order() -> None:
    """The cubic spline: Hermite-Simpson and the replay hold it to rounding."""
    report = observe_order(spec(objective="integral(x''^2 + y''^2)"))
    assert report.passed
    assert report.metrics[0].value == math.inf
    assert "rounding hides its order" in report.notes[0]


def test_wrong_equations_do_not_converge() -> None:
    wrong = spec(mass=("m*x'' = fx", "1.05*m*x'' = fx"))
    report = observe_order(wrong, "hermite-simpson")
    assert not report.passed
    assert report.metrics[0].value < 0.1


def test_frames_beside_a_share_of_the_motion_may_be_named() -> None:
    model = spec("[1, n - 1]: fx <= 100; [4]: y >= 0.1; [n/2 + 1, n]: fx >= -100;")
    assert len(observe_order(model, "trapezoidal").levels) == 3


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            "[n]: x[n/2 - 2] = 0.2;",
            r"<text>:6:\d+: frame 2 of 8 would be frame 6 of 16: it does not keep its share",
        ),
        ("[n - 3]: y <= 3;", "frame 5 of 8 would be frame 13 of 16"),
    ],
)
def test_frames_counted_from_others_are_refused(more: str, message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        observe_order(spec(more))
    assert "write frame numbers as shares of n" in str(caught.value)


def test_a_plain_sum_is_refused() -> None:
    with pytest.raises(UsageError, match="a plain sum over frames grows with n") as caught:
        observe_order(spec(objective="fx^2 + fy^2"))
    assert "write `integral(" in str(caught.value)
    # A single frame's term is no sum.
    assert observe_order(spec(objective="integral(fx^2 + fy^2); [n/2]: (x - 0.2)^2"), "trapezoidal").levels


def test_a_duration_that_changes_is_refused() -> None:
    model = spec(step=("T = 1, h = T/n", "T = 1"), own=("variables:", "definitions: h = T/8; variables:"))
    with pytest.raises(UsageError, match="takes another time with 2 times as many frames"):
        observe_order(model)


def test_a_solve_that_fails_is_named() -> None:
    with pytest.raises(UsageError, match="with n = 8 the solve ended infeasible"):
        observe_order(spec("[n/2]: y >= 2; y <= 1;"))


def test_a_spec_without_a_model_is_refused() -> None:
    with pytest.raises(UsageError, match="names no model"):
        observe_order(
            load("constants: n = 4; variables: x; constraints: [0]: x; objective: integral(x''^2);")
        )
