"""``stc validate --equations`` and ``--order``, ``stc plot`` and ``stc render``, from the outside."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from stc import models, specs

Stc = Callable[..., tuple[int, str, str]]


def text_of(name: str) -> str:
    path = specs.locate(name)
    assert path is not None
    return path.read_text()


def test_equations_are_compared_without_solving(stc_: Stc, tmp_path: Path) -> None:
    status, out, err = stc_("validate", "arm_reach", "--equations")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "arm_reach against arm.xml at 1000 random states"
    assert out.rstrip().endswith("passed")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_was_moved_keeps_its_model(stc_: Stc) -> None:
    """The model of a saved solution lies where its spec was, or beside its file."""
    model = models.locate("particle.xml")
    assert model is not None
    Path("old").mkdir()
    Path("old/mine.xml").write_bytes(model.read_bytes())
    Path("old/mine.stc").write_text(text_of("particle_waypoints").replace("particle.xml", "mine.xml"))
    assert stc_("solve", "old/mine.stc", "-o", "old/mine.npz")[0] == 0
    Path("old").rename("new")
    for option in ("--equations", "--order"):
        status, out, err = stc_("validate", "new/mine.npz", option)
        assert (status, err) == (0, "")
        assert out.rstrip().endswith("passed")


def test_the_first_line_of_a_failure_names_joint_and_term(stc_: Stc) -> None:
    right = text_of("arm_reach_by_hand")
    wrong = right.replace("(I2 + m2*d2^2)*a2''", "(2*I2 + m2*d2^2)*a2''")
    assert wrong != right
    Path("wrong.stc").write_text(wrong)
    status, out, _ = stc_("validate", "wrong.stc", "--equations")
    assert status == 1
    assert out.splitlines()[0].startswith(
        "joint elbow: mass matrix entry (elbow, elbow): spec 0.1177, model 0.0963"
    )
    assert out.rstrip().endswith("failed")
    status, out, _ = stc_("validate", "wrong.stc", "--equations", "--json")
    record = json.loads(out)
    assert status == 1
    assert record["order"] is None
    assert record["equations"]["passed"] is False
    assert record["equations"]["findings"][0].startswith("joint elbow: mass matrix entry (elbow, elbow)")


def test_the_equations_of_a_saved_motion_are_those_it_was_solved_with(stc_: Stc) -> None:
    assert stc_("solve", "arm_reach", "--set", "g=1.62", "-o", "moon.npz")[0] == 0
    status, out, _ = stc_("validate", "moon.npz", "--equations")
    assert status == 0
    assert out.startswith("arm_reach against arm.xml")


def test_the_order_is_observed(stc_: Stc) -> None:
    status, out, _ = stc_("validate", "arm_reach", "--order", "--set", "n=20")
    assert status == 0
    lines = out.splitlines()
    assert lines[0] == "arm_reach, hermite-simpson: convergence of the replay"
    assert [line.split()[0] for line in lines[2:5]] == ["20", "40", "80"]
    assert lines[5].startswith("order of convergence, n = 40 to 80: ")
    status, out, _ = stc_(
        "validate", "arm_reach", "--order", "--set", "n=20", "--json", "--method", "trapezoidal"
    )
    record = json.loads(out)["order"]
    assert record["method"] == "trapezoidal"
    assert record["metrics"][0]["value"] > 1.8


def test_an_order_that_takes_more_than_it_may_is_not_observed(stc_: Stc) -> None:
    status, out, err = stc_("validate", "arm_reach", "--order", "--max-iterations", "2", "--json")
    assert (status, json.loads(out)["status"]) == (1, "iteration_limit")
    assert "no order of convergence: with n = 60 the solve ended iteration_limit" in err


def test_a_spec_that_cannot_be_refined_is_refused(stc_: Stc) -> None:
    Path("sum.stc").write_text(
        text_of("particle_waypoints").replace("integral(x''^2 + y''^2)", "x''^2 + y''^2")
    )
    status, _, err = stc_("validate", "sum.stc", "--order")
    assert status == 2
    assert "a plain sum over frames grows with n" in err


def test_a_motion_is_plotted(stc_: Stc) -> None:
    told = (0, "out/motion.svg written\n", "note: made the folder out\n")
    assert stc_("plot", "particle_waypoints", "-o", "out/motion.svg") == told
    assert "joint x" in Path("out/motion.svg").read_text()
    assert not Path("particle_waypoints.npz").exists()
    status, _, err = stc_("plot", "particle_waypoints", "-o", "motion.gif")
    assert status == 2
    assert "-o motion.gif: this picture is saved as .png, .svg, .pdf" in err


@pytest.mark.needs("opengl")
def test_a_saved_motion_is_rendered(stc_: Stc) -> None:
    from PIL import Image

    assert stc_("solve", "particle_waypoints", "--set", "n=20", "-o", "motion.npz")[0] == 0
    status, out, _ = stc_(
        "render", "motion.npz", "-o", "strip.png", "--size", "80x60", "--tiles", "2", "--json"
    )
    assert status == 0
    assert json.loads(out)["picture"] == "strip.png"
    with Image.open("strip.png") as image:
        assert image.size == (2 * 82 - 2, 60)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "strip.bmp"], "this picture is saved as .png, .jpg, .jpeg, .webp, .gif, .mp4"),
        (["-o", "strip.png", "--size", "big"], "--size wants WIDTHxHEIGHT"),
        (["-o", "strip.png", "--size", "9000x9000"], "at most 8192 pixels"),
        (["-o", "strip.png", "--tiles", "0"], "--rate and --tiles must be at least 1"),
        (["-o", "strip.gif", "--speed", "-1"], "--speed must be positive"),
        (["-o", "strip.png", "--show", "dreamt"], "--show must be one of solved, replayed, tracked"),
        (["-o", "strip.png", "--camera", "moon"], "the model has no camera moon"),
    ],
)
def test_what_cannot_be_meant_is_refused(stc_: Stc, words: list[str], message: str) -> None:
    status, _, err = stc_("render", "particle_waypoints", "--set", "n=8", *words)
    assert status == 2
    assert message in err
