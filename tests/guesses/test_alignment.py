"""Frames of two motions whose phases have other numbers of steps."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.guesses.alignment import Alignment
from stc.phases import named_cuts


def test_frames_keep_their_place_in_their_phase():
    found = Alignment.of([30, 50, 30, 29, 80], [60, 130, 60, 59, 150])
    assert found.old.tolist() == [0, 30, 50, 80] and found.new.tolist() == [0, 60, 130, 150]
    assert found.to_new([15, 30, 40, 80]) == pytest.approx([30, 60, 95, 150])
    frames = np.linspace(0, 150, 301)
    assert found.to_new(found.to_old(frames)) == pytest.approx(frames)
    assert not found.is_identity and Alignment.even(7, 7).is_identity


def test_the_frame_that_is_named_more_often_is_the_knot():
    assert Alignment.of([39, 40, 40, 120], [119, 120, 120, 360]).old.tolist() == [0, 40, 120]


def test_what_cannot_be_paired_keeps_its_share():
    assert Alignment.of([30, 80], [30, 50, 160]).to_new(40) == 80
    crossed = Alignment.of([30, 30, 50, 80], [60, 60, 40, 160])
    assert crossed.old.tolist() == [0, 30, 80]


def test_the_jump_keeps_its_phases():
    model = stc.load("luxo_jump")
    counts = {"na": 120, "nb": 280, "n": 424}
    found = Alignment.of(named_cuts(model.problem()), named_cuts(model.problem(None, **counts)))
    assert found.to_new([40, 72, 120]).tolist() == [120, 280, 424]


def test_a_warm_start_follows_the_phases():
    text = """
    constants: n = 40, a = 30;
    variables: x, u;
    definitions: [0, a - 1]: h = 1/a; [a, n]: h = 3/(n - a);
    method: hermite-simpson;
    guess: x = i/n;
    constraints:
      [0, n]: x'' = u - x^3;
      [0]: x; x';
      [a]: x = 0.5;
      [n]: x = 1; x';
    objective: [0, n]: integral(u^2);
    """
    coarse = stc.load(text).solve()
    for counts in ({"n": 160}, {"n": 40, "a": 10}):
        other = coarse.resolve(**counts)
        assert other.status == "optimal" and other.iterations <= 4
        assert other.objective == pytest.approx(coarse.objective, rel=1e-3)


def test_a_motion_of_one_frame_is_a_guess_for_a_longer_one():
    text = "constants: n = 0, h = 1; variables: x; constraints: x = 3;"
    longer = stc.load(text).solve().resolve(n=4)
    assert longer["x"] == pytest.approx(np.full(5, 3))


def test_a_file_is_aligned_by_its_own_numbers(tmp_path):
    stc.load("particle_waypoints").solve(n=12).save(tmp_path / "a.npz")
    finer = stc.load("particle_waypoints", n=24).solve(warm_start=tmp_path / "a.npz")
    assert finer.status == "optimal" and finer.iterations <= 2
