"""The equations of motion of models that ship, and of others', against MuJoCo's inverse dynamics."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from mechanism_states import Compared, actuation, inverse, relative_error

from stc import models
from stc.mechanism.refusals import refusals


def folder(package: str, below: str) -> Path | None:
    """A folder of an installed package, None where that is not installed."""
    found = importlib.util.find_spec(package)
    return None if found is None or found.origin is None else Path(found.origin).parent / below


GYMNASIUM = folder("gymnasium", "envs/mujoco/assets")
CONTROL = folder("dm_control", "suite")
OF_GYMNASIUM = (
    "hopper", "walker2d", "walker2d_v5", "half_cheetah", "ant", "humanoid", "humanoidstandup", "pusher", "pusher_v5",
    "reacher", "inverted_pendulum", "inverted_double_pendulum", "point", "swimmer",
)  # fmt: skip
OF_CONTROL = (
    "cartpole", "acrobot", "pendulum", "cheetah", "walker", "hopper", "humanoid", "humanoid_CMU", "quadruped", "dog",
    "ball_in_cup", "finger", "fish", "manipulator", "point_mass", "reacher", "stacker", "swimmer",
)  # fmt: skip


pytestmark = pytest.mark.filterwarnings("ignore:.*settotalmass")  # what a model says about itself


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes what it warns of into a file of the working directory."""
    monkeypatch.chdir(tmp_path)


def check(path: Path) -> None:
    both = Compared(path)
    assert not refusals(both.mechanism)
    dyn, nv = both.dynamics, both.model.nv
    found = both.values([*dyn.inverse(), *dyn.passive_forces(), *dyn.actuation()])
    assert relative_error(found[:nv], both.in_mujoco(inverse)) < 1e-9
    assert np.abs(found[nv : 2 * nv] - both.in_mujoco(lambda m, d: d.qfrc_passive)).max() < 1e-9
    acting = both.in_mujoco(actuation)
    assert np.abs(found[2 * nv :] - acting).max() < 1e-9 * max(1.0, np.abs(acting).max())


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", models.names())
def test_shipped_models(name: str) -> None:
    """Inverse dynamics, passive forces and actuation, to 1e-9 of the largest force at 1000 random states."""
    path = models.locate(name)
    assert path is not None
    check(path)


@pytest.mark.daily_every(2)
@pytest.mark.skipif(GYMNASIUM is None, reason="gymnasium is not installed: pip install '.[dev]'")
@pytest.mark.parametrize("name", OF_GYMNASIUM)
def test_models_of_gymnasium(name: str) -> None:
    """Their equations equal `mj_inverse`, like those of the models that ship."""
    assert GYMNASIUM is not None
    check(GYMNASIUM / f"{name}.xml")


@pytest.mark.daily_every(3)
@pytest.mark.slow
@pytest.mark.skipif(CONTROL is None, reason="dm_control is not installed (it has no wheels for this Python)")
@pytest.mark.parametrize("name", OF_CONTROL)
def test_models_of_dm_control(name: str) -> None:
    """Their equations equal `mj_inverse`, like those of the models that ship."""
    assert CONTROL is not None
    check(CONTROL / f"{name}.xml")
