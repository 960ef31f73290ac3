"""Perturbed replays: the unperturbed one is the tracked replay, a seed repeats, errors grow with what is perturbed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stc
from stc import specs
from stc.cli.main import run
from stc.errors import UsageError
from stc.validate import limits
from stc.validate.replay import replay
from stc.validate.robustness import KINDS, robustness
from stc.validate.setup import Setup
from stc.validate.tracking import proportional
from stc.validate.verdict import open_setup


@pytest.fixture(scope="module")
def particle() -> Setup:
    return open_setup(stc.load("particle_waypoints").solve(n=20))


def test_without_perturbation_it_is_the_tracked_replay(particle: Setup) -> None:
    (found,) = robustness(particle, kinds=["none"]).envelopes
    alone = replay(particle, feedback=proportional(particle))
    errors = [alone.positions[:, tie.position] - tie.line.value.before for tie in particle.ties]
    tracked = np.sqrt(np.mean(np.sum(np.square(errors), axis=0)))
    # The control of the middle of each time step is held here: an error of second order in the time step.
    assert found.base[0] == pytest.approx(tracked, abs=2e-6)
    assert found.base.shape == (1,) and not found.lost.any()


def test_a_seed_repeats_and_another_differs(particle: Setup) -> None:
    first, again, other = (robustness(particle, 3, seed, ["masses"]).envelopes[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.base, again.base)
    assert not np.array_equal(first.base, other.base)


def test_an_envelope_does_not_depend_on_which_others_are_asked_for(particle: Setup) -> None:
    alone = robustness(particle, 2, 5, ["start"]).envelopes[0]
    among = robustness(particle, 2, 5, ["masses", "start"]).envelopes[1]
    np.testing.assert_array_equal(alone.base, among.base)


def test_a_wrong_mass_falls_as_newton_says(particle: Setup) -> None:
    """A particle under PD feedback: deviation e obeys m' e'' + d e' + k e = (m - m') (x'' + g), here the static one."""
    samples = 4
    found = robustness(particle, samples, 3, ["masses"]).envelopes[0]
    mass, gravity, rate = 1.0, 9.8, limits.PD_RATE
    rng = np.random.default_rng([3, list(KINDS).index("masses")])
    factors = 1.0 + 0.02 * rng.uniform(-1.0, 1.0, (samples, particle.compiled.nbody))[:, -1]
    static = np.abs(factors - 1.0) * gravity / rate**2 / mass
    assert np.all(found.base > 0.3 * static) and np.all(found.base < 3.0 * static)
    assert list(np.argsort(found.base)) == list(np.argsort(static))


def test_what_cannot_be_perturbed_is_refused(particle: Setup) -> None:
    with pytest.raises(UsageError, match="at least one sample"):
        robustness(particle, 0)
    with pytest.raises(UsageError, match="unknown kind of perturbation 'wind'"):
        robustness(particle, kinds=["wind"])


def test_the_command_reports_the_envelope(
    particle: Setup, tmp_path: object, capsys: pytest.CaptureFixture[str]
) -> None:
    path = f"{tmp_path}/particle.npz"
    particle.solution.save(path)
    assert run(["validate", path, "--robustness", "--samples", "1", "--seed", "7", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out.splitlines()[-1])["robustness"]
    assert [kind["kind"] for kind in facts["kinds"]] == list(KINDS)
    assert facts["seed"] == 7 and facts["base_unit"] == "m"
    for kind in facts["kinds"]:
        assert 0.0 <= kind["base"]["median"] <= kind["base"]["worst"] < 0.01
        assert kind["lost"] == 0.0
    assert run(["validate", path, "--robustness", "--samples", "1"]) == 0
    assert "perturbed replays with feedback, seed 0" in capsys.readouterr().out
    assert run(["validate", path, "--robustness", "--order"]) == 2
    assert "--robustness cannot be combined with" in capsys.readouterr().err


@pytest.mark.nightly
def test_a_motion_that_nothing_holds_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pole that stands upright for eight seconds: the cart's motor holds the cart, and nothing holds the pole."""
    monkeypatch.chdir(tmp_path)
    path = specs.locate("cart_pole_swing_up")
    assert path is not None
    text = (
        path.read_text()
        .replace("[0]: x; a; x'; a';", "[0]: x; a = pi; x'; a';")
        .replace("a = pi*t/T", "a = pi")
    )
    Path("balance.stc").write_text(text)
    words = ["validate", "balance.stc", "--set", "T=8", "--robustness", "--samples", "1"]
    told = "the motion is lost without any perturbation: each motor controls its own joint"
    assert run([*words, "--json"]) == 1
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (record["status"], record["message"].startswith(told)) == ("failed", True)
