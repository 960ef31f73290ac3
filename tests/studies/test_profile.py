"""The profile of a solve: its parts add up, its counts are the solver's, and the answer does not change."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.cli import run
from stc.studies.profile import Profile, Watch


def test_parts_add_up_and_count_what_the_solver_counts() -> None:
    profile = Profile()
    model = stc.load("particle_waypoints")
    solution = model.solve(n=12, minimizer=profile.minimize)
    plain = stc.load("particle_waypoints").solve(n=12)
    assert np.array_equal(solution.x, plain.x)
    parts = {part.name: part for part in profile.parts(solution)}
    assert parts["factorise"].calls == solution.factorizations > 0
    assert parts["values"].calls > 0
    assert parts["derivatives"].calls > 0
    inside = [name for name in parts if name not in ("parse", "derive", "compile")]
    assert sum(parts[name].seconds for name in inside) == pytest.approx(profile.seconds, rel=1e-9)
    assert profile.seconds <= solution.seconds["total"]
    for part in parts.values():
        assert part.seconds >= 0.0
        assert part.floor is None or part.floor >= 0.0
    assert parts["factorise"].floor <= parts["factorise"].seconds


def test_a_watch_counts_failures_too() -> None:
    watch = Watch()

    def fail() -> None:
        raise ValueError

    with pytest.raises(ValueError):
        watch.over(fail)()
    assert (watch.calls, watch.floor) == (1, watch.shortest)


def test_the_command_prints_it(
    capsys: pytest.CaptureFixture[str], tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(str(tmp_path))
    assert run(["solve", "particle_waypoints", "--set", "n=12", "--profile"]) == 0
    out = capsys.readouterr().out
    assert "where the time went" in out
    assert "factorise" in out


def test_other_optimizers_are_not_looked_into(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "particle_waypoints", "--profile", "--optimizer", "nlopt:slsqp"]) == 2
    assert "--profile" in capsys.readouterr().err
