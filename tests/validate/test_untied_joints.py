"""Motions in models with joints that the spec does not tie: the tied ones are judged as sharply as that allows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, solution_of
from closed_loop import PARALLELOGRAM

import stc
from stc.certification import certify
from stc.solution import ReplayChannel, Solution
from stc.trajectory import FloatArray
from stc.validate import Report, validate
from stc.validate.verdict import open_setup, run_replays

MASS, BOB, LENGTH, GRAVITY = 2.0, 0.5, 0.4, 9.81

#: A cart on a rail, and what hangs from it.
CART = f"""
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -{GRAVITY}"/>
  <worldbody>
    <body name="cart">
      <joint name="x" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{MASS}" diaginertia="1e-3 1e-3 1e-3"/>
      <body name="bob">
        <joint name="swing" axis="0 -1 0" {{joint}}/>
        <inertial pos="0 0 -{LENGTH}" mass="{{bob}}" diaginertia="1e-9 1e-9 1e-9"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="x"/></actuator>
</mujoco>
"""


def way(t: FloatArray) -> FloatArray:
    return 0.3 * np.sin(2 * t)


def rate(t: FloatArray) -> FloatArray:
    return 0.6 * np.cos(2 * t)


def acceleration(t: FloatArray) -> FloatArray:
    return -1.2 * np.sin(2 * t)


def swing(times: FloatArray) -> FloatArray:
    """(3, S) angle of the bob, its rate and acceleration: it hangs at rest when the cart sets off."""
    from scipy.integrate import solve_ivp

    def bend(t: float, angle: float) -> float:
        return float(-(GRAVITY * np.sin(angle) + acceleration(np.array(t)) * np.cos(angle)) / LENGTH)

    found = solve_ivp(
        lambda t, y: [y[1], bend(t, y[0])], (0, 1), [0, 0], t_eval=np.unique(times), rtol=1e-12, atol=1e-13
    )
    angle, speed = (np.interp(times, found.t, row) for row in found.y)
    bent = np.array([bend(t, q) for t, q in zip(times, angle, strict=True)])
    return np.array([angle, speed, bent])


def cart(
    folder: Path,
    bob: float = BOB,
    mass: float = MASS,
    joint: str = "",
    held: bool = False,
    method: str = "hermite-simpson",
) -> Solution:
    """The cart's motion with the push that it takes by Newton's law, ``mass`` being what it is thought to weigh."""
    (folder / "cart.xml").write_text(CART.format(bob=bob, joint=joint))

    def push(t: FloatArray) -> FloatArray:
        angle, speed, bent = np.zeros((3, len(t))) if held else swing(t)
        pull = bob * LENGTH * (bent * np.cos(angle) - speed**2 * np.sin(angle))
        return (mass + bob) * acceleration(t) + pull

    time = np.linspace(0, 1, 41)
    lines = [
        ReplayChannel("joint", ("x",), *(nodes(method, time, c) for c in (way, rate, acceleration))),
        ReplayChannel("actuator", ("push",), nodes(method, time, push)),
    ]
    trajectories = {("x", order): channel for order, channel in enumerate((lines[0].value, lines[0].rate))}
    return solution_of(method, time, trajectories, lines, "cart.xml", directory=str(folder))


def value(report: Report, name: str) -> float:
    return max(metric.value for metric in report.metrics if metric.name == name)


def test_an_untied_bob_swings_as_newton_says(tmp_path: Path) -> None:
    setup = open_setup(cart(tmp_path))
    run_replays(setup)
    untied = setup.untied
    assert untied is not None
    angles = [untied.at("before", k) for k in range(1, 41)]
    expected = swing(np.linspace(0, 1, 41))
    assert np.allclose([q[1] for q, _ in angles], expected[0, 1:], atol=2e-7)
    assert np.allclose([v[1] for _, v in angles], expected[1, 1:], atol=2e-6)


def test_a_cart_that_reckons_with_its_bob_passes(tmp_path: Path) -> None:
    report = validate(cart(tmp_path), tracked=False)
    assert report.passed
    assert not report.unjudged
    assert value(report, "inverse-dynamics residual") < 1e-5
    assert value(report, "energy balance") < 1e-4


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
def test_a_speck_does_not_hide_a_wrong_mass(tmp_path: Path, method: str) -> None:
    """It is the share of the largest force that it is without the speck."""
    report = validate(cart(tmp_path, bob=1e-9, mass=1.1 * MASS, method=method), tracked=False)
    assert value(report, "inverse-dynamics residual") == pytest.approx(0.1 / 1.1, rel=0.01)
    failed = {metric.name for metric in report.metrics if metric.verdict == "fail"}
    assert {"inverse-dynamics residual", "energy balance"} <= failed
    right = validate(cart(tmp_path, bob=1e-9, method=method), tracked=False)
    assert value(right, "inverse-dynamics residual") < 1e-8


def test_a_heavy_bob_that_friction_holds_is_judged_sharply(tmp_path: Path) -> None:
    stuck = 'frictionloss="50"'
    right = validate(cart(tmp_path, joint=stuck, held=True), tracked=False)
    (limit,) = {m.limit for m in right.metrics if m.name == "inverse-dynamics residual"}
    assert limit is not None
    assert limit <= 1e-6
    assert value(right, "inverse-dynamics residual") < 1e-12
    assert not validate(cart(tmp_path, joint=stuck, held=True, mass=1.001 * MASS), tracked=False).passed


def test_what_cannot_be_judged_is_told(tmp_path: Path) -> None:
    """A loop that the spec knows nothing of holds with forces that nothing tells."""
    text = f'<mujoco><option gravity="0 0 0"/>{PARALLELOGRAM}</mujoco>'
    (tmp_path / "loop.xml").write_text(text)
    spec = tmp_path / "loop.stc"
    # Rods turn about their ends, the bar goes in a circle: 2*(0.02 + 1*0.2^2) + 3*0.4^2.
    spec.write_text(
        "constants: n=40, T=1, h=T/n; variables: q, u; constraints: [0,n]: 0.6*q'' = u; [0]: q; q'; [n]: q=0.3; q';"
        'objective: [0,n]: integral(u^2); method: hermite-simpson; replay: model="loop.xml"; joint left=q; '
        "actuator torque=u;"
    )
    certificate = certify(stc.load(spec).solve())
    assert certificate.report.unjudged == ["inverse-dynamics residual", "energy balance"]
    (note,) = [note for note in certificate.notes if note.startswith("not judged")]
    assert "equalities" in note
    assert "bar" in note
    if certificate.passed:
        assert certificate.headline.endswith("not judged: inverse-dynamics residual, energy balance")
    assert certificate.to_dict()["unjudged"] == certificate.report.unjudged


def test_errors_grow_as_they_do_without_the_speck(tmp_path: Path) -> None:
    spec = tmp_path / "pole.stc"
    spec.write_text(
        "constants: n=100, T=2, h=T/n; variables: q, u; constraints: [0,n]: q'' = 9.81*sin(q) + u; [0]: q; q'; "
        "[n]: q=0.2; q'; objective: [0,n]: integral(u^2); method: hermite-simpson; "
        'replay: model="pole.xml"; joint p=q; actuator t=u;'
    )
    speck = (
        '<body pos="0 0 1"><joint name="speck" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1e-12" diaginertia="1e-13 1e-13 1e-13"/></body>'
    )
    found = []
    for more in ("", speck):
        (tmp_path / "pole.xml").write_text(
            '<mujoco><option gravity="0 0 -9.81"/><worldbody><body><joint name="p" axis="0 1 0"/>'
            f'<inertial pos="0 0 1" mass="1" diaginertia="1e-14 1e-14 1e-14"/>{more}</body></worldbody>'
            '<actuator><motor name="t" joint="p"/></actuator></mujoco>'
        )
        found.append(value(validate(stc.load(spec).solve()), "growth of small errors"))
    assert found[0] == pytest.approx(np.cosh(2 * np.sqrt(9.81)), rel=0.05)
    assert found[1] == pytest.approx(found[0], rel=1e-4)
