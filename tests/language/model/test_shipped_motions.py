"""The motions of models that ship: their pages, and MuJoCo's word on what they come to."""

from __future__ import annotations

import functools
from collections.abc import Iterable

import mujoco
import numpy as np
import pytest
from _pytest.mark import ParameterSet

import stc
from stc import models
from stc.bundled import find_spec
from stc.solution import Solution
from stc.validate import validate

from .bodies import put

#: Each with what it should reach at the last frame: a body and its place.
MOTIONS = {
    "arm_swing": ("hand", None),
    "falling_cat": ("chest", None),
    "high_bar": ("torso", (1.5, 0.0, 0.864)),
    "humanoid_jump": ("pelvis", (0.3, 0.0, None)),
    "humanoid_step": ("pelvis", None),
    "lamp_turn": ("base", (0.0, 0.0, 0.0)),
    "quadruped_backflip": ("trunk", (-0.2, 0.0, None)),
    "quadruped_box_jump": ("trunk", (0.65, 0.0, None)),
    "quadruped_hop": ("trunk", (0.5, 0.0, None)),
    "quadruped_trot": ("trunk", None),
}

#: Those that are solved within seconds.
QUICK = ("arm_swing",)


def page(name: str) -> str:
    return find_spec(name).read_text(encoding="utf-8")


@functools.cache
def solved(name: str) -> Solution:
    """The motion, solved once for all tests here."""
    return stc.load(name).solve()


@pytest.mark.parametrize("name", MOTIONS)
def test_a_page_is_short_and_says_in_its_first_line_what_happens(name: str) -> None:
    lines = page(name).splitlines()
    assert len(lines) < 60
    assert lines[0].startswith("# ")
    assert lines[0].endswith(".")


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("name", MOTIONS)
def test_a_page_is_understood(name: str) -> None:
    problem = stc.load(name).problem()
    assert problem.relations
    assert problem.replay


def marked(names: Iterable[str]) -> list[ParameterSet]:
    return [pytest.param(n, marks=pytest.mark.slow if n in QUICK else pytest.mark.nightly) for n in names]


@pytest.mark.parametrize("name", marked(MOTIONS))
def test_a_motion_is_repeated_in_mujoco(name: str) -> None:
    report = validate(solved(name))
    failed = [metric for metric in report.metrics if metric.verdict == "fail"]
    assert report.passed, failed or report.findings
    assert report.tracked_by == "LQR"


@pytest.mark.parametrize("name", marked(MOTIONS))
def test_a_motion_is_found_and_obeys_the_equations_of_mujoco(name: str) -> None:
    solution = solved(name)
    assert solution.status == "optimal"
    error, d = against_mujoco(solution)
    assert error < 1e-7
    assert drift(solution) < 1e-8
    body, place = MOTIONS[name]
    for found, wanted in zip(d.body(body).xpos, place or (), strict=False):
        assert wanted is None or found == pytest.approx(wanted, abs=5e-3)


def against_mujoco(solution: Solution) -> tuple[float, mujoco.MjData]:
    """The largest error of the equations of motion at the nodes, a share of the largest force that MuJoCo finds.

    Constraints are off; forces of contacts act where MuJoCo has the places that the replay's lines name.  The data is
    that of the last frame.
    """
    file = next(line for line in solution.source.splitlines() if line.startswith("model:")).split('"')[1]
    m = mujoco.MjModel.from_xml_path(str(models.locate(file)))
    d = mujoco.MjData(m)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    known = solution.trajectories
    lines = [line for line in solution.replay if line.kind == "contact"]
    error, largest = 0.0, 0.0
    for side in ("before", "after", "mid"):
        for frame in range(solution.n + (side == "before")):

            def value(name: str, order: int = 0, side: str = side, frame: int = frame) -> float:
                return float(getattr(known[name, order], side)[frame])

            put(m, d, value)
            mujoco.mj_inverse(m, d)
            needed = d.qfrc_inverse.copy()
            d.ctrl[:] = [value(f"actuator.{m.actuator(a).name}") for a in range(m.nu)]
            mujoco.mj_fwdActuation(m, d)
            given = d.qfrc_actuator.copy()
            for line in lines:
                of, name, part = line.path
                force = np.zeros(3)
                force["xyz".index(part[1])] = float(getattr(line.value, side)[frame])
                nothing = np.zeros(3)
                place, body = place_of(m, d, of, name)
                pushes = (force, nothing) if part[0] == "f" else (nothing, force)
                mujoco.mj_applyFT(m, d, *pushes, place, body, given)
            error = max(error, float(np.abs(needed - given).max()))
            largest = max(largest, float(np.abs(needed).max()))
    put(m, d, lambda name, order=0: float(known[name, order].before[-1]))
    mujoco.mj_forward(m, d)
    return error / largest, d


def drift(solution: Solution) -> float:
    """How far what stands, and does not roll, moves within a phase of contact, in m."""
    file = next(line for line in solution.source.splitlines() if line.startswith("model:")).split('"')[1]
    m = mujoco.MjModel.from_xml_path(str(models.locate(file)))
    d = mujoco.MjData(m)
    farthest, began = 0.0, dict[str, np.ndarray]()
    lines = [line for line in solution.replay if line.kind == "contact" and line.path[2] == "fz"]
    for frame in range(solution.n + 1):
        put(m, d, lambda name, order=0, at=frame: float(solution.trajectories[name, order].before[at]))
        mujoco.mj_kinematics(m, d)
        for line in lines:
            of, name, _ = line.path
            if of == "geom" and m.geom(name).type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
                continue
            if max(abs(line.value.before[frame]), abs(line.value.after[frame])) < 1e-6:
                began.pop(name, None)
                continue
            place = place_of(m, d, of, name)[0].copy()
            farthest = max(farthest, float(np.linalg.norm(place - began.setdefault(name, place))))
    return farthest


def place_of(m: mujoco.MjModel, d: mujoco.MjData, of: str, name: str) -> tuple[np.ndarray, int]:
    """Where a contact touches, all of them on level ground: a site, the foot of a sphere, the middle of a sole."""
    if of == "site":
        return d.site(name).xpos, int(m.site(name).bodyid[0])
    geom = m.geom(name)
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
        down = np.array([0.0, 0.0, -geom.size[0]])
    else:
        down = d.geom(name).xmat.reshape(3, 3) @ [0.0, 0.0, -geom.size[2]]
    return d.geom(name).xpos + down, int(geom.bodyid[0])


@pytest.mark.slow
def test_the_ball_goes_around_the_post_and_not_through_it() -> None:
    solution = solved("arm_swing")
    m = mujoco.MjModel.from_xml_path(str(models.locate("arm7.xml")))
    d = mujoco.MjData(m)
    post = m.geom("post")
    room, sides = [], []
    for frame in range(solution.n + 1):
        for k in range(m.njnt):
            d.qpos[k] = solution[f"joint.{m.joint(k).name}"][frame]
        mujoco.mj_kinematics(m, d)
        ball = d.geom("ball").xpos
        room.append(float(np.hypot(*(ball - post.pos)[:2])) - post.size[0] - m.geom("ball").size[0])
        sides.append(float(ball[1]))
    assert min(room) > 0.005
    assert sides[0] > 0.2
    assert sides[-1] < -0.2
    assert max(abs(solution[f"joint.{m.joint(k).name}'"]).max() for k in range(m.njnt)) < 6.0 + 1e-6
