"""A sweep's motions as a data set, read by Minari itself and played by MuJoCo."""

from __future__ import annotations

import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import stc
from stc import models
from stc.errors import UsageError
from stc.sweeps.dataset import Dataset, dataset
from stc.validate.setup import prepare

pytest.importorskip("pyarrow", reason="pyarrow is not installed")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swept")
    lamp = models.locate("luxo")
    assert lamp is not None
    # On the lamp's own floor, five times as stiff, the same motions are replayed in a tenth of a millisecond.
    text = lamp.read_text().replace('timestep="0.0001"', 'timestep="0.0005"')
    (folder / "luxo.xml").write_text(text.replace('"meshes"', f'"{lamp.parent}/meshes"'))
    (folder / "luxo_jump.stc").write_text(stc.load("luxo_jump").text)
    stc.sweep(folder / "luxo_jump.stc", {"D": [0.3, 0.4]}, folder / "jumps", workers=1)
    return folder / "jumps"


@pytest.fixture(scope="module")
def made(swept: Path) -> Dataset:
    return dataset(swept, swept.parent / "learn", time_step=0.001)


def test_minari_reads_it(swept: Path, made: Dataset) -> None:
    minari = pytest.importorskip("minari", reason="Minari is not installed")
    found = minari.MinariDataset(made.folder / "data")
    assert found.total_episodes == len(made.episodes) == 2
    assert found.total_steps == made.steps == 2 * 1150
    assert found.observation_space.shape == (12,)
    assert found.action_space.shape == (3,)
    facts = list(found.storage.get_episode_metadata([0, 1]))
    assert [one["constants"] for one in facts] == [{"D": 0.3}, {"D": 0.4}]
    assert all(one["verdict"] == "passed" and 0 < one["margin"] <= 1 for one in facts)
    for index, episode in enumerate(found):
        solution = stc.read(swept / "points" / f"{index}.npz")
        assert len(episode) == 1150
        assert found.observation_space.contains(episode.observations[0])
        assert found.action_space.contains(episode.actions[0])
        assert episode.rewards.sum() == episode.rewards[-1] == 1.0
        assert episode.terminations[-1]
        assert not episode.terminations[:-1].any()
        assert not episode.truncations.any()
        time = episode.infos["time"]
        at = solution.at(time)
        # MuJoCo's order: x, z, pitch, hip, elbow, neck.
        for column, name in enumerate(("x", "z", "th", "a1", "a2", "a3")):
            np.testing.assert_allclose(episode.observations[:, column], at[name], atol=1e-9)
        # It stands, flies and stands: take-off at 0.4 s, touchdown at 0.8 s.
        pressed = episode.infos["contact"][:, 1]
        assert pressed[time < 0.39].all()
        assert not pressed[(time > 0.41) & (time < 0.79)].any()
        assert pressed[time > 0.81].all()


def test_the_program_of_the_page_reads_it(
    made: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("minari", reason="Minari is not installed")
    page = (Path(__file__).parents[2] / "docs" / "export.md").read_text().partition("## Data sets")[2]
    (program,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "jumps_dataset").symlink_to(made.folder)
    monkeypatch.chdir(tmp_path)
    exec(program, {})
    assert capsys.readouterr().out.splitlines()[1] == "{'D': 0.4} passed (1151, 12) (1150, 3)"


def test_its_actions_lead_from_state_to_state(swept: Path, made: Dataset) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = parquet.read_table(made.folder / "data" / "0" / "part-0.parquet").to_pylist()
    model = prepare(stc.read(swept / "points" / "0.npz")).model()
    data = mujoco.MjData(model)
    steps = round(0.001 / model.opt.timestep)
    # In flight nothing depends on how the ground gives way: each action, held, leads to the next state.
    for k in range(450, 750, 50):
        before, after = np.array(rows[k]["observations"]), np.array(rows[k + 1]["observations"])
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.ctrl[:] = before[:6], before[6:], rows[k]["actions"]
        for _ in range(steps):
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(data.qpos, after[:6], atol=1e-5)
        np.testing.assert_allclose(data.qvel, after[6:], atol=1e-2 * np.abs(after[6:]).max())


def test_what_is_not_verified_is_left_out(swept: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    (copy / "points").mkdir(parents=True)
    for file in (swept / "sweep.json", *(swept / "points").iterdir()):
        (copy / file.relative_to(swept)).write_bytes(file.read_bytes())
    facts = json.loads((copy / "points" / "1.json").read_text())
    (copy / "points" / "1.json").write_text(json.dumps({**facts, "verdict": "failed"}))
    found = dataset(copy, tmp_path / "learn", time_step=0.01)
    assert found.episodes == [0]
    assert found.left == {1: "its replay failed"}
    assert dataset(copy, tmp_path / "all", time_step=0.01, unverified=True).episodes == [0, 1]
    with pytest.raises(UsageError, match="is not empty"):
        dataset(copy, tmp_path / "learn")
    with pytest.raises(UsageError, match="is no folder of a sweep"):
        dataset(tmp_path, tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_without_the_library_one_message_says_what_to_do(
    swept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stc.sweeps.dataset.find_spec", lambda name: None)
    with pytest.raises(UsageError, match="need the library pyarrow"):
        dataset(swept, tmp_path / "learn")
