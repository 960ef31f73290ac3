"""The profile of a solve: its parts add up, its counts are the solver's, and the answer does not change."""

from __future__ import annotations

import gc
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.cli.main import run
from stc.solver.kkt.reuse import forget
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
    assert "start, imports" not in parts  # who calls from Python knows better what a start is
    inside = [name for name in parts if name not in ("parse", "derive", "compile", "bind, collect")]
    assert sum(parts[name].seconds for name in inside) == pytest.approx(profile.seconds, rel=1e-9)
    assert profile.seconds <= solution.seconds["total"]
    for part in parts.values():
        assert part.seconds >= 0.0
        assert part.floor is None or part.floor >= 0.0
    assert parts["factorise"].floor <= parts["factorise"].seconds


def test_floors_are_those_of_each_program() -> None:
    """By way of fewer frames most calls are of small programs: the time of a large one is no floor for them."""
    profile = Profile()
    solution = stc.load("cart_pole_swing_up").solve(n=800, minimizer=profile.minimize)
    parts = {part.name: part for part in profile.parts(solution)}
    assert parts["analyse"].calls > 1
    for name in ("factorise", "solve", "solve for two"):
        assert 0.0 < parts[name].floor <= parts[name].seconds
    large = profile.factorize
    assert parts["factorise"].floor < large.calls * large.shortest


@pytest.mark.parametrize("name", ["cart_pole_swing_up", "luxo_jump", "segment_flip"])
def test_a_profile_changes_nothing(name: str) -> None:
    """Attempts are made and matrices of active sets told apart as without one."""
    forget()
    profile = Profile()
    watched = stc.load(name).solve(minimizer=profile.minimize)
    gc.collect()  # neither is to find the other's plans
    forget()
    plain = stc.load(name).solve()
    assert (watched.iterations, watched.factorizations) == (plain.iterations, plain.factorizations)
    assert profile.factorize.calls == watched.factorizations
    assert np.array_equal(watched.x, plain.x)


def test_start_loading_and_saving_are_told(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "stc",
        "solve",
        "particle_waypoints",
        "--set",
        "n=12",
        "--profile",
        "--json",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    record = json.loads(done.stdout)
    parts = {part["part"]: part for part in record["profile"]}
    assert list(parts)[:3] == ["start, imports", "load the solver's code", "parse"]
    assert list(parts)[-1] == "save"
    assert parts["start, imports"]["seconds"] > 0.0
    assert parts["save"]["calls"] == 1
    inside = sum(part["seconds"] for name, part in parts.items() if name not in ("save", *list(parts)[:2]))
    assert inside == pytest.approx(record["seconds"]["total"], rel=1e-6)


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
