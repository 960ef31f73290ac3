"""What `compare` lines may name of a tumbling body: MuJoCo finds it where the spec says it is, and elsewhere not."""

from __future__ import annotations

from pathlib import Path

import pytest

from stc.validate import ModelError, Report, validate

from .bodies import load

TUMBLING = """<mujoco><worldbody><body name="box"><freejoint name="root"/>
  <geom name="shell" type="box" size=".1 .2 .3" mass="2"/><site name="tip" pos=".1 .2 .3" euler="10 20 30"/>
  <body name="arm" pos="0 0 .4"><joint name="hip" type="ball" damping=".05"/>
    <geom type="capsule" fromto="0 0 0 .1 0 .4" size=".03" mass="1"/></body></body></worldbody></mujoco>"""
SPEC = """constants: n = 60, T = 0.5, h = T/n;
constraints:
  [0]: keyframe.reference; joint.root.x' = 2; joint.root.y'; joint.root.z' = 3;
       joint.root.wx = 0.5; joint.root.wy = 3; joint.root.wz = 0.4; joint.hip.wx = 1; joint.hip.wy; joint.hip.wz = 2;
replay:
  compare {0} = {1};"""
PATHS = (
    *[f"joint.root.{part}" for part in ("x", "z", "qw", "qy", "wx", "wz")],
    *[f"joint.hip.{part}" for part in ("qw", "qx", "wy")],
    *[f"body.arm.{part}" for part in ("x", "vy", "wz", "xaxis.z", "zaxis.x")],
    *["site.tip.zaxis.y", "geom.shell.wx", "com.x", "com.vz", "com.arm.vx"],
)


def judged(folder: Path, path: str, expression: str) -> tuple[Report, float]:
    solution = load(folder, TUMBLING, SPEC.format(path, expression)).solve()
    report = validate(solution, folder / "robot.xml", tracked=False)
    drifts = [m.value for m in report.metrics if m.name == "open-loop drift, largest" and path in m.subject]
    assert len(drifts) == 1
    return report, drifts[0]


@pytest.mark.daily_every(4)
@pytest.mark.parametrize("path", PATHS)
def test_mujoco_has_it_where_the_spec_has_it(tmp_path: Path, path: str) -> None:
    assert judged(tmp_path, path, path)[1] < 5e-3


def test_another_value_is_told(tmp_path: Path) -> None:
    report, drift = judged(tmp_path, "joint.hip.wy", "joint.hip.wy + 0.1")
    assert drift == pytest.approx(0.1, abs=1e-3)
    assert not report.passed


def test_a_quaternion_has_two_signs(tmp_path: Path) -> None:
    assert judged(tmp_path, "joint.root.qw", "-joint.root.qw")[1] < 1e-4


def test_a_whole_joint_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"several coordinates: write its \.x, \.y, \.z, \.qw"):
        judged(tmp_path, "joint.root", "joint.root.x")
