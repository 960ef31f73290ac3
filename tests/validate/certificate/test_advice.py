"""What a failed motion is told to do next, and that it helps."""

from __future__ import annotations

import json
import re

import pytest
from planted_faults import text_of

import stc
from stc.certification import certify
from stc.validate import Metric
from stc.validate.certificate.advice import next_steps
from stc.validate.certificate.page import page


def failed(name: str) -> Metric:
    return Metric(name, "joint a", 2.0, "share", 1.0)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("name", "n"), [("arm_reach", 16), ("arm_reach", 8), ("cart_pole_swing_up", 20), ("segment_flip", 10)]
)
def test_following_the_advice_makes_a_coarse_motion_pass(name: str, n: int) -> None:
    model = stc.load(name)
    coarse = certify(model.solve(n=n))
    assert not coarse.passed
    (step,) = coarse.next_steps
    found = re.search(r"--set n=(\d+)", step)
    assert found is not None
    better = certify(model.solve(n=int(found[1])))
    assert better.passed
    assert better.next_steps == []


@pytest.mark.nightly
def test_a_very_coarse_motion_improves_with_each_advice_until_it_passes() -> None:
    model, n, before = stc.load("falling_cat"), 8, float("inf")
    for _ in range(3):
        certificate = certify(model.solve(n=n))
        if certificate.passed:
            return
        failures = [m for m in certificate.metrics if m.verdict == "fail"]
        worst = max(m.value / m.limit for m in failures if m.limit)
        assert worst < 0.1 * before
        found = re.search(r"--set n=(\d+)", certificate.next_steps[0])
        assert found is not None
        n, before = int(found[1]), worst
    pytest.fail(f"n = {n} would be the next")


@pytest.mark.parametrize(
    ("frames", "advised"),
    [
        ("n = 16, half = n/2, T = 0.5, h = T/n", "--set n=32,"),
        ("k = 4, n = 4*k, half = 2*k, T = 0.5, h = T/n", "--set k=8,"),  # n=32 alone would leave half behind
        ("n = 16, half = n/2, h = 0.03125", "--set n=32 --set h=0.015625,"),
    ],
)
def test_more_frames_are_those_of_the_same_motion(frames: str, advised: str) -> None:
    text = text_of("arm_reach").replace("n = 60, T = 0.5, h = T/n", frames)
    text = text.replace("(0.1 - start1)*t/T", "(0.1 - start1)*i/n").replace(
        "  [0]: a1", "  [half]: a1 <= 2; [0]: a1"
    )
    assert frames in text
    (step,) = certify(stc.load(text).solve()).next_steps
    assert f"take more frames: {advised}" in step


def test_a_spec_with_plain_frame_numbers_gets_the_search_alone() -> None:
    text = text_of("arm_reach").replace("n = 60", "n = 16").replace("[n]:", "[16]:")
    (step,) = certify(stc.load(text).solve()).next_steps
    assert step.startswith("take more frames: `solve_until_passed(model)`, which adds them")
    assert "--set" not in step  # which would make another motion


def test_a_spec_that_cannot_take_more_frames_as_it_is_gets_no_number() -> None:
    text = text_of("arm_reach").replace("n = 60", "n = 16").replace("[n]:", "[n - 4]: a2 <= 2.8;  [n]:")
    (step,) = certify(stc.load(text).solve()).next_steps
    assert step.startswith("take more frames: the spec has to be changed for that, since <text>:")
    assert "it does not keep its share of the motion (write frame numbers as shares of n" in step
    assert "--until-passed" not in step  # which would be refused


def test_it_is_in_the_terminal_the_page_and_the_record() -> None:
    certificate = certify(stc.load("arm_reach").solve(n=16))
    (step,) = certificate.next_steps
    assert f"next: {step}" in " ".join(str(certificate).split())
    assert "Next: take more frames: --set n=32" in page(certificate, pictures=False)
    assert json.loads(json.dumps(certificate.to_dict()))["next_steps"] == [step]


def test_wrong_equations_are_to_be_mended_and_not_refined() -> None:
    right = text_of("arm_reach_by_hand")
    wrong = right.replace("(I2 + m2*d2^2)*a2''", "(2*I2 + m2*d2^2)*a2''")
    assert wrong != right
    certificate = certify(stc.load(wrong).solve(n=16))
    (step,) = certificate.next_steps
    assert step.startswith("make the spec's equations and the model agree")


@pytest.mark.parametrize(
    ("names", "compared", "beginnings"),
    [
        (["inequality between frames"], False, ["take more frames"]),
        (["open-loop drift, largest", "energy balance"], False, ["take more frames"]),
        (["open-loop drift, largest", "inverse-dynamics residual"], False, ["check the forces"]),
        (["inverse-dynamics residual"], True, ["the equations are right"]),
        (["KKT residual", "constraint violation"], False, ["solve with a smaller --tolerance"]),
        (["unexplained impulse"], False, ["name the contact"]),
        (
            ["friction used, solved forces in the model's cone", "tracked drift"],
            False,
            ["use less friction"],
        ),
        (["open-loop error on the ground, RMS"], False, ["take more frames"]),
        (["energy balance", "external drift, largest"], False, ["take more frames"]),
        (["something new"], False, []),
    ],
)
def test_there_is_one_step_for_each_kind(names: list[str], compared: bool, beginnings: list[str]) -> None:
    steps = next_steps([failed(name) for name in names], compared)
    assert len(steps) == len(beginnings)
    assert all(step.startswith(beginning) for step, beginning in zip(steps, beginnings, strict=True))


def test_what_passed_needs_no_advice() -> None:
    assert next_steps([Metric("energy balance", "motion", 0.5, "share", 1.0)], True, "--set n=2") == []
