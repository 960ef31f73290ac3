"""More frames are advised where they help, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes

import stc
from stc.certification import certify
from stc.solution import ReplayChannel
from stc.trajectory import Channel
from stc.validate import Metric
from stc.validate.certificate.advice import next_steps
from stc.validate.certificate.causes import swing_steps, swinging_forces
from stc.validate.verdict import open_setup

ROD = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="rod">
      <joint name="p" axis="0 -1 0" {joint}/>
      <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/>
    </body>
  </worldbody>
  <tendon>{tendon}</tendon>
  <actuator><motor name="t" joint="p"/></actuator>
</mujoco>
"""

SPEC = """
constants: n=60, T=0.6, h=T/n; variables: q, u;
constraints: [0,n]: {equation} = u; [0]: q; q'={rate}; [n]: q=1; q'={rate};
objective: [0,n]: integral(u^2);
guess: q=t/T;
method: hermite-simpson;
replay: model="rod.xml"; joint p=q; actuator t=u;
"""
RIGHT = "0.27*q'' + 0.5*9.81*sin(q)"


#: A spring that is slack on one side: the spec's is not, which is the same where the motion goes.
SLACK = '<fixed stiffness="3" springlength="0 5"><joint joint="p" coef="-1"/></fixed>'
TAUT = RIGHT + " + 3*q"


def rod(folder: Path, joint: str, equation: str, rate: float = 0, tendon: str = "") -> stc.Solution:
    (folder / "rod.xml").write_text(ROD.format(joint=joint, tendon=tendon))
    (folder / "rod.stc").write_text(SPEC.format(equation=equation, rate=rate))
    return stc.load(folder / "rod.stc").solve()


def judged(name: str, good: bool) -> Metric:
    return Metric(name, "body b", 0.5 if good else 2.0, "share", 1.0)


@pytest.mark.parametrize(
    "name",
    [
        "contact force, MuJoCo's against solved, median",
        "open-loop error on the ground, RMS",
        "tracked error on the ground, RMS",
        "feedback share",
    ],
)
def test_frames_are_not_to_blame_where_the_solved_contact_forces_give_the_motion(name: str) -> None:
    fine = [judged(name, False), judged("external drift, largest", True)]
    (step,) = next_steps(fine, False, "--set n=200")
    assert step.startswith("with the solved contact forces the motion is right")
    assert "--set" not in step
    coarse = [judged(name, False), judged("external drift, largest", False)]
    assert any(
        step.startswith("take more frames: --set n=200") for step in next_steps(coarse, False, "--set n=200")
    )
    assert any("; or stiffer;" in step for step in next_steps(coarse, False, "--set n=200", soft="stiffer"))


@pytest.mark.parametrize(("energy", "told"), [(-25.0, True), (0.0, False)])
def test_a_landing_that_the_replay_does_not_follow_should_be_gentler(energy: float, told: bool) -> None:
    impact = Metric("energy at velocity jumps", "motion", energy, "J")
    steps = next_steps([judged("tracked error on the ground, RMS", False), impact], True)
    assert any("`landing = 20`" in step for step in steps) == told
    assert not next_steps([judged("tracked error on the ground, RMS", True), impact], True)


def test_a_limit_of_the_model_is_named(tmp_path: Path) -> None:
    """The swing to 1 rad runs into a stop at 0.8 rad."""
    certificate = certify(rod(tmp_path, 'limited="true" range="-1 0.8"', RIGHT))
    assert not certificate.passed
    line = "joint p goes to 1 rad, its limit in the model is 0.8 rad"
    assert certificate.headline.endswith(line)
    (step,) = certificate.next_steps
    assert step.startswith(line)
    assert certify(rod(tmp_path, 'limited="true" range="-1 1.1"', RIGHT)).passed


def test_equations_that_hold_are_not_blamed(tmp_path: Path) -> None:
    certificate = certify(rod(tmp_path, 'limited="true" range="-1 0.8"', TAUT, 1, SLACK))
    assert not certificate.passed
    assert not certificate.findings
    assert certificate.headline.startswith("joint p: ")


def test_equations_are_compared_where_the_motion_goes(tmp_path: Path) -> None:
    """The damping is wrong; the spring is not, where it is taut."""
    certificate = certify(rod(tmp_path, 'damping="0.3"', TAUT + " + 0.27*q'", 1, SLACK))
    assert certificate.headline.startswith("joint p: damping by p': spec 0.27, model 0.3")
    assert len(certificate.findings) == 1


def test_wrong_dry_friction_is_called_that(tmp_path: Path) -> None:
    certificate = certify(rod(tmp_path, 'frictionloss="0.3"', RIGHT + " + 0.27", rate=1))
    assert certificate.headline.startswith("joint p: dry friction: spec 0.27, model 0.3")


@pytest.mark.parametrize(("size", "told"), [(0.1, True), (0.0, False), (0.01, False)])
def test_forces_that_swing_from_node_to_node_are_named(tmp_path: Path, size: float, told: bool) -> None:
    solution = rod(tmp_path, "", RIGHT)
    smooth = nodes("hermite-simpson", solution.time, lambda t: 1 + 0.5 * np.sin(6 * t))
    assert smooth.mid is not None
    force = Channel(smooth.before + size, smooth.after + size, smooth.mid - size)
    solution.replay.append(ReplayChannel("contact", ("body", "rod", "fz"), force))
    lines = swinging_forces(open_setup(solution))
    assert bool(lines) == told
    assert all(
        line.startswith("the force of contact body.rod.fz alternates from node to node in frames 0 to 6")
        for line in lines
    )
    # One line is enough, however many forces swing.
    solution.replay.append(ReplayChannel("contact", ("body", "rod", "fx"), force))
    steps = swing_steps(open_setup(solution))
    assert [" (and 1 more), which no contact" in step for step in steps] == [True] * told


def test_an_abrupt_end_is_advised_where_a_contact_pulls_between_frames() -> None:
    def advice(subject: str) -> str:
        return " ".join(
            next_steps([Metric("inequality between frames", subject, 0.2, "share", 0.02)], compared=True)
        )

    assert "write `sudden`" in advice("hop.stc:7:3: toe pushes (force) at t = 0.2 s")
    assert "sudden" not in advice("hop.stc:3:8: range of actuator.knee at t = 0.2 s")
