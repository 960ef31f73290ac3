"""Inverse dynamics against a damped pendulum whose torque is known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, smooth_particle, solution_of, waypoint_spline
from closed_loop import PARALLELOGRAM

from stc.solution import ReplayChannel, Solution
from stc.trajectory import FloatArray
from stc.validate import Report, validate

MASS, LENGTH, DAMPING, GRAVITY = 1.3, 0.7, 0.2, 9.8

PENDULUM = f"""
<mujoco>
  <option gravity="0 0 -{GRAVITY}"/>
  <worldbody>
    <geom type="plane" size="2 2 0.1" pos="0 0 -0.6"/>
    <body name="rod">
      <inertial pos="0 0 -{LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="pivot" type="hinge" axis="0 -1 0"/>
      <geom type="sphere" size="0.1" pos="0 0 -{LENGTH}"/>
    </body>
    {{more}}
  </worldbody>
  <actuator><motor name="torque" joint="pivot"/></actuator>
</mujoco>
"""


def angle(t: FloatArray) -> FloatArray:
    """A swing from -0.5 rad, moving."""
    return np.sin(2 * t) - 0.5


def rate(t: FloatArray) -> FloatArray:
    return 2 * np.cos(2 * t)


def acceleration(t: FloatArray) -> FloatArray:
    return -4 * np.sin(2 * t)


def torque(t: FloatArray, mass: float = MASS, damping: float = DAMPING) -> FloatArray:
    """Newton's law for a point mass on a rod."""
    inertia = mass * LENGTH**2 + 1e-9
    weight = mass * GRAVITY * LENGTH * np.sin(angle(t))
    return inertia * acceleration(t) + damping * rate(t) + weight


def swing(
    folder: Path, n: int, method: str = "hermite-simpson", more: str = "", mass: float = MASS
) -> Solution:
    """The pendulum's solution; ``mass`` is what the torque was computed with."""
    (folder / "pendulum.xml").write_text(PENDULUM.format(more=more))
    time = np.linspace(0, 1.2, n + 1)
    q = [nodes(method, time, c) for c in (angle, rate, acceleration)]
    u = nodes(method, time, lambda t: torque(t, mass))
    lines = [
        ReplayChannel("joint", ("pivot",), *q),
        ReplayChannel("actuator", ("torque",), u),
        ReplayChannel("set", ("joint", "pivot", "damping"), nodes(method, time, lambda t: 0 * t + DAMPING)),
        ReplayChannel("compare", ("body", "rod", "x"), nodes(method, time, lambda t: 0 * t)),
    ]
    trajectories = {("q", k): c for k, c in enumerate(q)}
    return solution_of(method, time, trajectories, lines, "pendulum.xml", directory=str(folder))


def values(report: Report, name: str) -> list[float]:
    return [metric.value for metric in report.metrics if metric.name.startswith(name)]


@pytest.mark.parametrize(("overstepped", "right"), [(2e-9, True), (1e-5, False)])
def test_a_stiff_servo_may_overstep_its_range_as_little_as_a_solver_does(
    overstepped: float, right: bool, tmp_path: Path
) -> None:
    """MuJoCo clamps its control, so that its force is wrong by the stiffness times that."""
    stiff, method, n = 1e5, "hermite-simpson", 20
    solution = swing(tmp_path, n)
    control = nodes(method, solution.time, lambda t: angle(t) + torque(t) / stiff)
    line = next(k for k, each in enumerate(solution.replay) if each.kind == "actuator")
    solution.replay[line] = ReplayChannel("actuator", ("torque",), control)
    fine = np.linspace(0, 1.2, 2 * n + 1)
    most = np.abs(angle(fine) + torque(fine) / stiff).max() / (1.0 + overstepped)
    servo = f'<position name="torque" joint="pivot" kp="{stiff}" ctrlrange="{-most} {most}"/>'
    motor = '<motor name="torque" joint="pivot"/>'
    (tmp_path / "pendulum.xml").write_text(PENDULUM.format(more="").replace(motor, servo))
    (residual,) = [m for m in validate(solution).metrics if m.name == "inverse-dynamics residual"]
    assert residual.limit is not None
    assert (residual.value <= residual.limit) == right


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_true_torques_leave_no_residual(tmp_path: Path, method: str) -> None:
    """The floor cuts through the swing: contacts take no part in the residual."""
    report = validate(swing(tmp_path, 24, method))
    assert values(report, "inverse-dynamics residual")[0] < 1e-14
    units = {metric.unit for metric in report.metrics if metric.subject == "joint pivot"}
    assert units == {"rad", "share"}


def test_a_wrong_mass_is_seen_in_its_right_size(tmp_path: Path) -> None:
    report = validate(swing(tmp_path, 24, mass=1.01 * MASS))
    (residual,) = values(report, "inverse-dynamics residual")
    t = np.linspace(0, 1.2, 49)
    wrong, right = torque(t, 1.01 * MASS), torque(t)
    weight = MASS * GRAVITY * LENGTH * np.sin(angle(t))
    largest = max(np.abs(force).max() for force in (wrong, right, weight))
    assert residual == pytest.approx(np.abs(wrong - right).max() / largest, rel=1e-9)
    assert not report.passed


def test_hermite_simpson_is_replayed_at_fourth_order(tmp_path: Path) -> None:
    """Exact values at the nodes: what drifts is the parabola of the torque between them."""
    model = PENDULUM.replace('<geom type="plane" size="2 2 0.1" pos="0 0 -0.6"/>', "")
    drifts = []
    for n in (6, 12, 24):
        solution = swing(tmp_path, n)
        (tmp_path / "pendulum.xml").write_text(model.format(more=""))
        drifts.append(values(validate(solution), "open-loop drift, largest")[0])
    assert np.all(-np.diff(np.log2(drifts)) > 3.8)
    assert drifts[-1] < 1e-6


def test_contacts_act_in_the_replay_but_not_in_the_residual(tmp_path: Path) -> None:
    """The floor that the spec does not know of stops the swing."""
    report = validate(swing(tmp_path, 24))
    assert values(report, "open-loop drift, largest")[0] > 0.1
    assert values(report, "inverse-dynamics residual")[0] < 1e-14


def test_dry_friction_is_coulombs(tmp_path: Path) -> None:
    """The swing turns between two nodes; at one node beside it the pendulum hardly moves and stops fast."""

    def motion(friction: float) -> Solution:
        solution = swing(tmp_path, 24)
        method, time = solution.method, solution.time
        rub = nodes(method, time, lambda t: torque(t) + friction * np.sign(rate(t)))
        solution.replay[1] = ReplayChannel("actuator", ("torque",), rub)
        solution.replay.append(
            ReplayChannel(
                "set", ("joint", "pivot", "frictionloss"), nodes(method, time, lambda t: 0 * t + 2.5)
            )
        )
        return solution

    assert values(validate(motion(2.5), tracked=False), "inverse-dynamics residual")[0] < 1e-14
    assert values(validate(motion(2.4), tracked=False), "inverse-dynamics residual")[0] > 1e-3
    assert values(validate(motion(-2.5), tracked=False), "inverse-dynamics residual")[0] > 0.1


#: A bar that hangs by two rods, a parallelogram: its loop is closed by an equality, held firmly.
LOOP = f"""
<mujoco>
  <option gravity="0 0 -9.8"/>
  <default><equality solref="0.005 1" solimp="0.999 0.9999 0.001"/></default>
{PARALLELOGRAM}</mujoco>
"""

#: A rod whose motor turns another one twice as fast the other way round: a gear, which is an equality as well.
GEAR = """
<mujoco>
  <option gravity="0 0 -9.8"/>
  <default><equality solref="0.005 1" solimp="0.999 0.9999 0.001"/></default>
  <worldbody>
    <body name="rod">
      <inertial pos="0 0 -0.2" mass="1" diaginertia="0.02 0.02 0.02"/>
      <joint name="left" axis="0 -1 0"/>
    </body>
    <body name="wheel" pos="1 0 0">
      <inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/>
      <joint name="wheel" axis="0 -1 0"/>
    </body>
  </worldbody>
  <equality><joint joint1="wheel" joint2="left" polycoef="0 -2"/></equality>
  <actuator><motor name="torque" joint="left"/></actuator>
</mujoco>
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("model", "ratios", "inertia", "moment"),
    [
        # The rods turn alike and the bar never does.
        (LOOP, {"left": 1, "bar": -1, "right": 1}, 2 * (0.02 + 0.2**2) + 3 * 0.4**2, 2 * 0.2 + 3 * 0.4),
        (GEAR, {"left": 1, "wheel": -2}, 0.02 + 0.2**2 + 2**2 * 0.05, 0.2),
    ],
)
def test_what_holds_a_loop_or_a_gear_is_no_residual(
    tmp_path: Path, model: str, ratios: dict[str, int], inertia: float, moment: float
) -> None:
    (tmp_path / "closed.xml").write_text(model)
    time = np.linspace(0, 1.2, 25)
    method = "hermite-simpson"

    def motion(mistake: float) -> Solution:
        force = nodes(
            method,
            time,
            lambda t: mistake * inertia * acceleration(t) + moment * 9.8 * np.sin(angle(t)),
        )
        joints = {
            name: [
                nodes(method, time, lambda t, c=c, ratio=ratio: ratio * c(t))
                for c in (angle, rate, acceleration)
            ]
            for name, ratio in ratios.items()
        }
        lines = [ReplayChannel("joint", (name,), *channels) for name, channels in joints.items()]
        lines.append(ReplayChannel("actuator", ("torque",), force))
        trajectories = {("q", k): c for k, c in enumerate(joints["left"])}
        return solution_of(method, time, trajectories, lines, "closed.xml", directory=str(tmp_path))

    right = validate(motion(1.0))
    assert right.passed
    assert max(values(right, "inverse-dynamics residual")) < 1e-14
    assert max(values(validate(motion(1.01), tracked=False), "inverse-dynamics residual")) > 1e-4


def test_a_joint_that_is_not_tied_is_noted(tmp_path: Path) -> None:
    other = '<body><joint name="spare" type="slide"/><geom size="0.01"/></body>'
    report = validate(swing(tmp_path, 12, more=other), tracked=False)
    assert max(values(report, "inverse-dynamics residual")) < 1e-14
    assert any("initial position" in note and "spare" in note for note in report.notes), report.notes


def test_clipped_frames_of_central_are_left_out() -> None:
    x, y = waypoint_spline()
    solution = smooth_particle("central", np.linspace(0, 2, 41), x, y)
    solution.replay[2].value.before[[0, -1]] = 77.0
    residuals = values(validate(solution, tracked=False), "inverse-dynamics residual")
    assert max(residuals) < 1e-14


def test_both_sides_of_a_jump_are_looked_at() -> None:
    """A force that is wrong on one side of one frame only, either side."""
    x, y = waypoint_spline()
    for side in ("before", "after"):
        solution = smooth_particle("trapezoidal", np.linspace(0, 2, 41), x, y)
        force = solution.replay[2].value
        object.__setattr__(force, side, getattr(force, side).copy())
        getattr(force, side)[20] += 0.5
        residuals = values(validate(solution, tracked=False), "inverse-dynamics residual")
        assert residuals[0] > 0.01
        assert residuals[1] < 1e-14


def test_rest_without_any_force_has_no_residual(tmp_path: Path) -> None:
    """A share of forces that are nothing but rounding errors says nothing; one of a visible motion's does."""
    (tmp_path / "spinner.xml").write_text(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="pivot" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size=".05"/></body></worldbody>
        <actuator><motor name="torque" joint="pivot"/></actuator></mujoco>"""
    )
    time = np.linspace(0.0, 1.0, 11)
    still = nodes("trapezoidal", time, lambda t: 0.0 * t)
    for off, passes in ((1e-17, True), (1e-5, False)):
        lines = [
            ReplayChannel("joint", ("pivot",), still, still, still),
            ReplayChannel(
                "actuator", ("torque",), nodes("trapezoidal", time, lambda t, off=off: 0.0 * t + off)
            ),
        ]
        q = {("q", order): still for order in range(3)}
        solution = solution_of("trapezoidal", time, q, lines, "spinner.xml", directory=str(tmp_path))
        shares = values(validate(solution, tracked=False), "inverse-dynamics residual")
        assert (max(shares) < 1e-9) == passes


@pytest.mark.parametrize(("torque", "rests"), [(1e-6, True), (4e-6, False)])
def test_where_nothing_pushes_each_joint_rests_by_its_own_inertia(
    tmp_path: Path, torque: float, rests: bool
) -> None:
    """A light wheel beside a heavy sledge, without weight; a torque that turns it by 5e-7 or 2e-6 rad in 1 s."""
    (tmp_path / "still.xml").write_text("""<mujoco><option gravity="0 0 0"/><worldbody>
      <body name="sledge"><joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="5"
        diaginertia="1 1 1"/></body>
      <body name="wheel"><joint name="q" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1e-5 1e-5 1e-5"/>
      </body></worldbody><actuator><motor name="turn" joint="q"/></actuator></mujoco>""")
    time = np.linspace(0.0, 1.0, 5)
    still = nodes("hermite-simpson", time, lambda t: 0.0 * t)
    lines = [
        ReplayChannel("joint", ("x",), still, still, still),
        ReplayChannel("joint", ("q",), still, still, still),
        ReplayChannel(
            "actuator", ("turn",), nodes("hermite-simpson", time, lambda t: 0.0 * t + 1e-5 * torque)
        ),
    ]
    found = {(name, k): still for name in ("x", "q") for k in range(3)}
    report = validate(
        solution_of("hermite-simpson", time, found, lines, "still.xml", directory=str(tmp_path))
    )
    residuals = [metric for metric in report.metrics if metric.name == "inverse-dynamics residual"]
    assert [metric.verdict for metric in residuals] == ["pass", "pass" if rests else "fail"]
