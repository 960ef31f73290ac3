"""Forces from outside: ``apply`` acts always, ``contact`` only where the model's own contacts do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import Curve, scaled, smooth_particle, waypoint_spline
from pendulums import GRAVITY, LENGTH, MASS, held, pendulum, weight

from stc.solution import ReplayChannel, Solution
from stc.validate import ModelError, Report, validate
from stc.validate.setup import prepare

TIME = np.linspace(0, 2, 41)


def values(report: Report, name: str) -> list[float]:
    return [metric.value for metric in report.metrics if metric.name == name]


def pushed(*lines: str) -> Solution:
    """The particle on the waypoint spline, its two forces handed over by other lines than its motors'."""
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", TIME, x, y, m=2.0)
    forces = [line.value for line in solution.replay if line.kind == "actuator"]
    others = [line for line in solution.replay if line.kind != "actuator"]
    split = [line.split(" ", 1) for line in lines]
    solution.replay = others + [
        ReplayChannel(kind, tuple(path.split(".")), force) for (kind, path), force in zip(split, forces)
    ]
    return solution


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    "lines",
    [
        ("apply body.particle.fx", "apply body.particle.fz"),
        ("apply joint.x", "apply joint.z"),
        ("apply site.trail.fx", "apply joint.z"),
    ],
)
def test_a_particle_flies_on_applied_forces(lines: tuple[str, str]) -> None:
    report = validate(pushed(*lines))
    assert max(values(report, "open-loop drift, largest")) < 1e-12
    assert max(values(report, "inverse-dynamics residual")) < 1e-14
    assert values(report, "energy balance")[0] < 1e-12
    assert report.passed


def test_several_lines_on_one_place_add_up() -> None:
    solution = pushed("apply body.particle.fx", "apply body.particle.fz")
    x, z = solution.replay[-2], solution.replay[-1]
    solution.replay = [
        *solution.replay[:-2],
        ReplayChannel("apply", ("body", "particle", "fx"), scaled(x.value, 0.25)),
        ReplayChannel("apply", ("site", "trail", "fx"), scaled(x.value, 0.5)),
        ReplayChannel("apply", ("joint", "x"), scaled(x.value, 0.25)),
        z,
    ]
    assert max(values(validate(solution), "open-loop drift, largest")) < 1e-12


@pytest.mark.parametrize(
    ("line", "force"),
    [
        # At rest at 0.6 rad the bob's weight is balanced by ...
        ("apply body.rod.my", -weight(0.6)),  # a torque about the world's y axis: the hinge turns about -y
        ("apply joint.pivot", weight(0.6)),
        ("apply site.tip.fx", weight(0.6) / (2 * LENGTH * np.cos(0.6))),  # a force on a lever
        ("apply site.tip.fz", MASS * GRAVITY / 2),
    ],
)
def test_a_wrench_acts_where_it_is_applied(tmp_path: Path, line: str, force: float) -> None:
    curve: Curve = lambda t: 0 * t + force
    report = validate(pendulum(tmp_path, np.linspace(0, 0.5, 11), held(0.6), None, {line: curve}))
    assert values(report, "inverse-dynamics residual")[0] < 1e-12
    assert values(report, "open-loop drift, largest")[0] < 1e-10


def test_a_force_on_a_frames_origin_has_no_lever(tmp_path: Path) -> None:
    setup = prepare(
        pendulum(tmp_path, np.linspace(0, 1, 5), held(0.3), None, {"apply body.rod.fx": np.ones_like})
    )
    import mujoco

    data = mujoco.MjData(setup.compiled)
    setup.applied.apply(setup.compiled, data, np.ones(1))
    assert data.qfrc_applied[0] == pytest.approx(0.0, abs=1e-15)


def test_a_contact_force_is_left_to_the_models_contacts() -> None:
    """A particle at rest on a ground that the model does not have: the physics holds, the replay falls."""
    zero = np.zeros_like
    still = smooth_particle("hermite-simpson", np.linspace(0, 0.5, 11), [zero] * 3, [zero] * 3, m=2.0)
    weights = next(line.value for line in still.replay if line.name == "fz")
    still.replay = [line for line in still.replay if line.kind != "actuator"]
    still.replay.append(ReplayChannel("contact", ("body", "particle", "fz"), weights))
    report = validate(still)
    assert max(values(report, "inverse-dynamics residual")) < 1e-14
    assert max(values(report, "external drift, largest")) < 1e-12
    fallen = values(report, "open-loop drift, largest")[1]
    assert fallen == pytest.approx(0.5 * 9.8 * 0.25, rel=1e-6)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("tendon.ball.fx", "a force acts on a joint, a body, a site or a geom, not on tendon"),
        ("body", "the name of the body is missing"),
        ("body.particle", r"end the path in one of \.fx"),
        ("body.particle.f", r"end the path in one of \.fx"),
        ("body.partcle.fx", r"the model has no body partcle; did you mean particle\?"),
        ("joint.x.fx", "a slide or hinge joint has no parts: write joint x"),
    ],
)
def test_lines_that_do_not_fit_are_explained(path: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        validate(pushed(f"apply {path}", "apply joint.z"))
