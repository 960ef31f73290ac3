"""How far a body turns is told, which its poses do not tell."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stc.cli.body_turns import turns
from stc.cli.main import run

from .bodies import load

BALL = """<mujoco><option gravity="0 0 0"/><worldbody><body name="ball"><freejoint name="root"/>
  <geom type="sphere" size=".1" mass="2"/></body></worldbody></mujoco>"""


def spun(folder: Path, x: float, y: float, z: float) -> list[tuple[float, tuple[float, float, float]]]:
    """The turns of a ball that begins at a rate and keeps it for a second."""
    spec = f"""constants: n = 40, T = 1, h = T/n;
    constraints: [0]: keyframe.reference; joint.root.x'; joint.root.y'; joint.root.z';
      joint.root.wx = {x}; joint.root.wy = {y}; joint.root.wz = {z};"""
    return [(turn.angle, turn.axis) for turn in turns(load(folder, BALL, spec).solve())]


def test_a_ball_turns_at_its_rate(tmp_path: Path) -> None:
    ((angle, axis),) = spun(tmp_path, 0.0, 0.0, 7.0)
    assert angle == pytest.approx(7.0, rel=1e-4)
    assert axis == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


def test_turns_have_a_sense_and_any_axis(tmp_path: Path) -> None:
    ((angle, axis),) = spun(tmp_path, 0.0, -12.0, -9.0)
    assert angle == pytest.approx(-15.0, rel=1e-3)
    assert axis == pytest.approx((0.0, 0.8, 0.6), abs=1e-6)


def test_less_than_half_a_turn_is_not_told(tmp_path: Path) -> None:
    assert spun(tmp_path, 0.0, 3.0, 0.0) == []


def test_solve_prints_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.xml").write_text(BALL, encoding="utf-8")
    (tmp_path / "motion.stc").write_text(
        f"""model: "robot.xml"; constants: n = 40, T = 1, h = T/n;
        constraints: [0]: keyframe.reference; joint.root.x'; joint.root.y'; joint.root.z';
          joint.root.wx; joint.root.wy = {2 * math.pi * 1.5}; joint.root.wz;""",
        encoding="utf-8",
    )
    assert run(["solve", str(tmp_path / "motion.stc"), "-o", str(tmp_path / "motion.npz")]) == 0
    assert "joint.root 1.5 about y" in capsys.readouterr().out
