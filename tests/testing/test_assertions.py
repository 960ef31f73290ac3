"""Assertions for users' own specs: what passes, and how failures read."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from stc.errors import UsageError
from stc.solution import Solution
from stc.specs import locate
from stc.testing import assert_equations, assert_physical, assert_solves, keep_certificates


def text_of(name: str) -> str:
    path = locate(name)
    assert path is not None
    return path.read_text()


def test_a_true_spec_passes_all_three(solve_spec: Callable[..., Solution]) -> None:
    solution = solve_spec("arm_reach")
    assert solve_spec("arm_reach") is solution
    assert solve_spec("arm_reach", n=30) is not solution
    certificate = assert_physical(solution)
    assert certificate.passed
    assert certificate.headline.split()[1:5] == ["measurements", "within", "their", "limits;"]
    assert assert_equations("arm_reach", states=50).passed


@pytest.mark.daily_every(3)
@pytest.mark.parametrize(
    ("old", "new", "joint", "term"),
    [
        ("- m2*g*z2", "- 0.9*m2*g*z2", "joint shoulder", "gravity"),
        ("a2: u2;", "a2: -u2;", "joint elbow", "force of actuator elbow"),
        ("I2/2*(a1' + a2')^2", "I2*(a1' + a2')^2", "joint elbow", "mass matrix entry"),
    ],
)
def test_a_wrong_spec_names_joint_and_term_first(old: str, new: str, joint: str, term: str) -> None:
    text = text_of("arm_reach")
    assert old in text
    wrong = text.replace(old, new)
    with pytest.raises(AssertionError) as equations:
        assert_equations(wrong, states=50)
    with pytest.raises(AssertionError) as motion:
        assert_physical(assert_solves(wrong))
    for failure in (equations, motion):
        first = str(failure.value).splitlines()[0]
        assert term in first
        assert first.startswith("joint ")
        assert joint in str(failure.value)
    assert "inverse-dynamics residual" in str(motion.value)
    assert "limit" in str(motion.value)


def test_another_status_is_a_failure_that_says_what_the_solver_says() -> None:
    weak = text_of("particle_waypoints").replace("[0, n]:", "[0, n]: fx <= 0; fx >= 1;", 1)
    with pytest.raises(AssertionError, match="the solve ended infeasible, not optimal"):
        assert_solves(weak)
    assert assert_solves(weak, status="infeasible").status == "infeasible"


def test_mistakes_in_a_spec_are_failures_with_their_place() -> None:
    with pytest.raises(AssertionError, match="`fxx` is not declared"):
        assert_solves(text_of("particle_waypoints").replace("= fx;", "= fxx;", 1))


def test_limits_can_be_set_by_name(solve_spec: Callable[..., Solution]) -> None:
    solution = solve_spec("arm_reach")
    with pytest.raises(AssertionError, match="open-loop drift"):
        assert_physical(solution, limits={"open-loop drift": 1e-15})
    coarse = solve_spec("arm_reach", n=4)
    with pytest.raises(AssertionError):
        assert_physical(coarse)
    names = {m.name for m in assert_physical(solution).report.metrics}
    assert assert_physical(coarse, limits=dict.fromkeys(names - {"inverse-dynamics residual"}))
    with pytest.raises(UsageError, match="did you mean `open-loop drift, "):
        assert_physical(solution, limits={"openloop drift": 1.0})
    with pytest.raises(UsageError, match="the limit of `open-loop drift` is not a number"):
        assert_physical(solution, limits={"open-loop drift": float("nan")})


def test_certificates_are_kept(
    tmp_path: Path, solve_spec: Callable[..., Solution], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")  # without the film
    keep_certificates(tmp_path / "pages")
    try:
        assert_physical(solve_spec("particle_waypoints"))
    finally:
        keep_certificates(None)
    (page,) = (tmp_path / "pages").iterdir()
    assert page.name == "test_certificates_are_kept-particle_waypoints.html"


def test_tests_at_the_same_time_keep_a_page_each(tmp_path: Path) -> None:
    """As those of several processes do."""
    script = tmp_path / "page.py"
    script.write_text(
        "import os, sys, types, stc.testing as t\n"
        "page = types.SimpleNamespace(solution=types.SimpleNamespace(name='push'),\n"
        "                             write=lambda path: path.write_text(sys.argv[1]))\n"
        "t.keep_certificates(os.path.join(os.path.dirname(__file__), 'pages'))\n"
        "for _ in range(50): t._keep(page)\n"
    )
    both = [subprocess.Popen([sys.executable, str(script), who]) for who in "ab"]
    assert [process.wait() for process in both] == [0, 0]
    pages = [page.read_text() for page in (tmp_path / "pages").iterdir()]
    assert sorted(pages) == ["a"] * 50 + ["b"] * 50


def test_the_plugin_imports_next_to_nothing() -> None:
    code = (
        "import sys, pytest, stc.pytest_plugin; "
        "print([n for n in ('numpy', 'mujoco', 'scipy', 'llvmlite', 'rich', 'stc.errors', 'stc.testing') "
        "if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
