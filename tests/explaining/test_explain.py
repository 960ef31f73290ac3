"""From recorded motions back to the specs that made them: ends, contacts, weights."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

import stc
from stc import models
from stc.errors import UsageError
from stc.explaining import Explanation, explain
from stc.explaining.recording import read_recording
from stc.mechanism.read import read_model
from stc.solution import Solution

#: A cart that swings its pendulum up, with weights that are known: 1 and W.
CART = """
constants: n = 60, T = 2, h = T/n, W = 0.02;
model: "cart_pole.xml";
constraints:
  [0]: keyframe.reference; rest;
  [n]: joint.cart = 0.8; joint.pole = pi; rest;
guess: joint.cart = 0.8*t/T; joint.pole = pi*t/T;
objective: [0, n]: integral(effort); integral(W*joint.*''^2);
"""

#: The lamp hops, with weights that are known.
HOP = """
constants: n = 108, T = 0.9, h = T/n;
model: "luxo.xml";
contact:
  sole = foot(geom.foot), landing = 100;
  [0, 7*n/18]: sole;
  [11*n/18, n]: sole;
poses: begin = keyframe.reference grounded, joint.hip = -0.734, joint.elbow = 1.5, joint.neck = 1;
constraints: [0]: begin; rest; [n]: begin + (0.15, 0, 0); rest;
objective: [0, n]: integral(effort); integral(3e-3*joint.*''^2);
"""


def recorded(solution: Solution, names: list[str], path: Path, rate: float, noise: float) -> Path:
    """A table of some coordinates at a rate, with noise."""
    times = np.append(np.arange(0.0, solution.duration - 0.5 / rate, 1.0 / rate), solution.duration)
    at, random = solution.at(times), np.random.default_rng(7)
    columns = [times, *(at[name] + noise * random.standard_normal(len(times)) for name in names)]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time", *names])
        writer.writerows(zip(*columns, strict=True))
    return path


def distance(explanation: Explanation, solution: Solution, names: list[str]) -> float:
    """RMS between the solution of the proposed spec and the motion as it was made, without noise."""
    times = np.linspace(0.0, solution.duration, 300)
    one, other = explanation.solution.at(times), solution.at(times)
    return float(np.sqrt(np.mean([(one[name] - other[name]) ** 2 for name in names])))


@pytest.fixture(scope="module")
def swing() -> Solution:
    return stc.load(CART).solve()


@pytest.mark.nightly
@pytest.mark.slow
def test_a_swing_up_is_explained_by_its_effort_alone(tmp_path: Path) -> None:
    made = stc.load("cart_pole_swing_up").solve()
    table = tmp_path / "swing.csv"
    times = np.append(np.arange(0.0, 1.995, 0.012), 2.0)
    at, random = made.at(times), np.random.default_rng(1)
    rows = [times, *(at[name] + 1e-3 * random.standard_normal(len(times)) for name in ("x", "a"))]
    table.write_text(
        "time [s],joint.cart [m],joint.pole [deg]\n"
        + "\n".join(f"{t},{x},{np.degrees(a)}" for t, x, a in zip(*rows, strict=True))
    )
    found = explain(table, models.locate("cart_pole.xml"), folder=tmp_path)
    assert found.good
    assert list(found.shares) == ["effort"]
    assert "keyframe.reference; rest;" in found.text
    assert "joint.pole = pi;" in found.text
    ends = re.search(r"D = (\S+);", found.text)
    assert ends is not None
    assert float(ends[1]) == pytest.approx(1.0, abs=3e-3)
    assert 5e-4 < found.noise < 2e-3
    solved = found.solution.at(times)
    assert np.sqrt(np.mean((solved["joint.pole"] - at["a"]) ** 2)) < 5e-3
    # It can be edited: the distance is one number.
    file = found.save(tmp_path / "swing.stc")[0]
    edited = stc.load(file).solve(D=0.5)
    assert edited.status == "optimal"
    assert edited["joint.cart"][-1] == pytest.approx(0.5, abs=1e-8)


@pytest.mark.daily_every(2)
@pytest.mark.slow
@pytest.mark.parametrize(("noise", "precision"), [(0.0, 0.02), (5e-4, 0.1)])
def test_known_weights_are_found(swing: Solution, noise: float, precision: float, tmp_path: Path) -> None:
    names = ["joint.cart", "joint.pole"]
    table = recorded(swing, names, tmp_path / "a.csv", 83.0, noise)
    found = explain(table, models.locate("cart_pole.xml"), folder=tmp_path)
    assert found.good
    assert found.explained > 0.9999
    assert {"effort", "acceleration"} <= set(found.shares)
    weight = re.search(r"integral\((\S+)\*joint\.\*''\^2\)", found.text)
    assert weight is not None
    assert float(weight[1]) == pytest.approx(0.02, rel=precision)
    assert distance(found, swing, names) < 1e-3 + 2.0 * noise
    # The share of the accelerations, by quadrature, is within its range.
    squares = sum(swing[f"{name}''"] ** 2 for name in names)
    share = 0.02 * np.trapezoid(squares, swing.time) / swing.objective
    low, high = found.ranges["acceleration"]
    assert low - 0.01 < share < high + 0.01


@pytest.mark.slow
def test_a_search_without_time_says_so_and_follows_the_recording(swing: Solution, tmp_path: Path) -> None:
    names = ["joint.cart", "joint.pole"]
    table = recorded(swing, names, tmp_path / "a.csv", 83.0, 0.0)
    found = explain(table, models.locate("cart_pole.xml"), folder=tmp_path, time_limit=1e-6)
    assert not found.good
    assert "time limit of 1e-06 s" in found.notes[-1]
    assert distance(found, swing, names) < 1e-3


@pytest.mark.nightly
@pytest.mark.slow
def test_stationarity_alone_finds_the_weights_of_a_motion_without_noise(
    swing: Solution, tmp_path: Path
) -> None:
    found = explain(
        recorded(swing, ["joint.cart", "joint.pole"], tmp_path / "a.csv", 500.0, 0.0),
        models.locate("cart_pole.xml"),
        folder=tmp_path,
    )
    assert found.stationarity < 0.05


@pytest.mark.nightly
@pytest.mark.parametrize(("rate", "noise"), [(1000.0, 0.0), (137.0, 1e-3)])
def test_a_hop_has_its_contacts_back(rate: float, noise: float, tmp_path: Path) -> None:
    made = stc.load(HOP).solve()
    names = [f"joint.{name}" for name in ("x", "z", "pitch", "hip", "elbow", "neck")]
    found = explain(
        recorded(made, names, tmp_path / "hop.csv", rate, noise), models.locate("luxo.xml"), folder=tmp_path
    )
    (stances,) = found.stances.values()
    n = round(found.solution.n)
    assert np.abs(np.array(stances) / n - np.array([[0, 7 / 18], [11 / 18, 1]])).max() <= 2 / 90
    assert "foot(geom.foot)" in found.text
    assert "begin; rest;" in found.text
    assert "begin + (D, 0, 0); rest;" in found.text
    assert found.explained > 0.99
    assert {"effort", "acceleration"} & set(found.shares)
    assert found.base < 0.01


@pytest.mark.slow
def test_a_motion_that_no_term_explains_is_said_to_be_none(tmp_path: Path) -> None:
    times = np.linspace(0.0, 1.5, 151)
    with (tmp_path / "wild.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time", "hip", "elbow", "neck"])
        for t in times:
            bump = np.sin(np.pi * t / 1.5) ** 2
            writer.writerow(
                [
                    t,
                    -0.5 + 0.3 * bump * np.sin(19 * t),
                    1.4 + 0.4 * bump * np.sin(14 * t + 1),
                    0.9 + 0.5 * bump * np.cos(23 * t),
                ]
            )
    found = explain(tmp_path / "wild.csv", models.locate("luxo_fixed.xml"), folder=tmp_path)
    assert not found.good
    assert found.shares == {}
    assert found.explained < 0.9
    assert "no weights of effort, power" in found.notes[0]
    # What is proposed follows the recording instead, and says so.
    assert "No weights of the terms that were tried explain this motion" in found.text
    files = found.save(tmp_path / "wild.stc")
    again = stc.load(files[0]).solve()
    assert again.status == "optimal"
    with np.errstate(all="ignore"):
        gap = again.at(times)["joint.neck"] - (
            0.9 + 0.5 * np.sin(np.pi * times / 1.5) ** 2 * np.cos(23 * times)
        )
    assert np.sqrt(np.mean(gap**2)) < 0.02


#: A pendulum whose joint has a name that stands in quotes, and no floor below it.
ROD = """<mujoco><worldbody><body name="rod"><joint name="left/hip" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="1"/></body></worldbody>
  <actuator><motor name="m" joint="left/hip"/></actuator></mujoco>"""


@pytest.mark.slow
def test_names_in_quotes_and_speeds_at_an_end(tmp_path: Path) -> None:
    (tmp_path / "rod.xml").write_text(ROD)
    (tmp_path / "rod.stc").write_text(
        """constants: n = 40, T = 1, h = T/n;  model: "rod.xml";
        constraints: [0]: joint."left/hip" = 0; rest; [n]: joint."left/hip" = 2; joint."left/hip"' = 1.5;
        objective: [0, n]: integral(effort);"""
    )
    made = stc.load(tmp_path / "rod.stc").solve()
    times = np.linspace(0.0, 1.0, 200)
    angle = made.at(times)['joint."left/hip"']
    np.savez(tmp_path / "rod.npz", time=times, qpos=angle[:, None])
    found = explain(tmp_path / "rod.npz", tmp_path / "rod.xml", folder=tmp_path)
    assert found.stances == {}
    assert list(found.shares) == ["effort"]
    assert "[0]: keyframe.reference; rest;" in found.text
    speed = re.search(r"""\[n\]: joint\."left/hip"' = (\S+);""", found.text)
    assert speed is not None
    assert float(speed[1]) == pytest.approx(1.5, abs=1e-2)
    np.testing.assert_allclose(found.solution.at(times)['joint."left/hip"'], angle, atol=1e-3)


def test_recordings_in_several_forms_are_the_same(tmp_path: Path) -> None:
    mechanism = read_model(models.locate("cart_pole.xml"))
    t = np.linspace(0.0, 1.0, 40)
    q = np.stack([0.3 * t**2, np.sin(3 * t)], axis=1)
    np.savez(tmp_path / "a.npz", time=t + 5.0, qpos=q)
    rows = "\n".join(f"{a};{b};{np.degrees(c)}" for a, (b, c) in zip(t, q, strict=True))
    (tmp_path / "b.csv").write_text("# made by hand\ntime;cart;pole [deg]\n" + rows)
    found = [read_recording(tmp_path / name, mechanism) for name in ("a.npz", "b.csv")]
    for one in found:
        np.testing.assert_allclose(one.positions, q, atol=1e-12)
        np.testing.assert_allclose(one.time, t, atol=1e-12)
        np.testing.assert_allclose(one.velocities(t)[:, 1], 3 * np.cos(3 * t), atol=1e-3)
    assert found[0].names == ["joint.cart", "joint.pole"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cart,pole\n0,0\n", "has no column `time`"),
        ("time,cart\n0,0\n", "has no column for `joint.pole`"),
        ("time,cart,pole\n0,0,0\n1,0,0\n", "has 2 rows with all coordinates"),
        ("time,cart,pole\n" + "0,0,0\n" * 9, "do not increase"),
        ("", "is empty"),
    ],
)
def test_mistakes_in_a_table_are_told(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(UsageError, match=message):
        read_recording(tmp_path / "a.csv", read_model(models.locate("cart_pole.xml")))


def test_the_rate_of_turning_of_a_free_body_is_that_of_mujoco(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    file = tmp_path / "box.xml"
    file.write_text(
        '<mujoco><worldbody><body name="box"><freejoint name="root"/><geom type="box" size=".1 .2 .3"/></body>'
        "</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_path(str(file))
    data, rows, speeds = mujoco.MjData(model), [], []
    model.opt.timestep = 1e-3
    data.qvel[:] = [0.1, 0.2, 3.0, 2.0, 0.4, -1.0]
    for _ in range(300):
        rows.append(np.append(data.time, data.qpos))
        speeds.append(data.qvel.copy())
        mujoco.mj_step(model, data)
    table = np.array(rows)
    np.savez(tmp_path / "a.npz", time=table[:, 0], qpos=table[:, 1:])
    found = read_recording(tmp_path / "a.npz", read_model(file))
    np.testing.assert_allclose(found.velocities(table[:, 0])[10:-10], np.array(speeds)[10:-10], atol=1e-2)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 and no more", bytes(range(256)) * 40])
@pytest.mark.parametrize("name", ["walk.npz", "walk.csv"])
def test_a_file_that_holds_no_motion_is_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UsageError, match=name):
        read_recording(tmp_path / name, read_model(models.locate("cart_pole.xml")))
