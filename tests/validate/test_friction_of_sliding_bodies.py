"""What slides has Coulomb's friction, all of it, and floors press at every node: blocks, wheels and pucks by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.validate import Metric
from stc.validate.certificate import Certificate

#: A block of 2 kg on a stiff floor with a coefficient of 0.4: friction has 7.848 N.
BLOCK = """<mujoco><option gravity="0 0 -9.81" cone="{cone}"/><worldbody>
  <geom type="plane" size="9 9 0.1" friction="0.4"/>
  <body name="b" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/>{across}<joint name="z" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
    <geom type="box" size="0.1 0.1 0.1" friction="0.4" solref="0.004 1"/>
  </body></worldbody>
  <actuator><motor name="px" joint="x"/><motor name="pz" joint="z"/></actuator></mujoco>"""

HEAD = "constants: m = 2, g = 9.81, mu = 0.4, n = {n}, T = {T}, h = T/n; "
REPLAY = 'replay: model = "block.xml"; joint x = x; joint z = {z}; '

#: It glides without slowing down, the wind giving what the floor takes: 2 N; and it is pushed by the floor alone.
CREEP = (
    "variables: x, fx; constraints: [0]: x; x' = 0.004; [0, n]: fx = -2; m*x'' = fx + 2; method: {method}; "
    + REPLAY.format(z="0*x")
    + "apply body.b.fx = 2; contact body.b.fx = fx; contact body.b.fz = m*g;"
)
PUSHED = (
    "variables: x, fx; constraints: [0]: x; x'; [0, n]: fx = 0.38; m*x'' = fx; method: {method}; "
    + REPLAY.format(z="0*x")
    + "contact body.b.fx = fx; contact body.b.fz = m*g;"
)
#: It glides to a stop at -mu*g, and stays.
STOPS = (
    "constants: na = n/2; variables: x, fx; constraints: [0]: x; x' = mu*g*T/2; [0, na-1]: fx = -mu*m*g; "
    "[na, n]: x' = 0; [0, n]: m*x'' = fx; jumps: [na]: fx; method: {method}; "
    + REPLAY.format(z="0*x")
    + "contact body.b.fx = fx; contact body.b.fz = m*g;"
)


def judged(
    folder: Path, spec: str, n: int, T: float, method: str = "hermite-simpson", **model: str
) -> Certificate:
    (folder / "block.xml").write_text(BLOCK.format(**{"cone": "elliptic", "across": ""} | model))
    (folder / "block.stc").write_text(HEAD.format(n=n, T=T) + spec.replace("{method}", method))
    return certify(stc.load(folder / "block.stc").solve(), equations=False)


def row(certificate: Certificate, name: str) -> Metric:
    return next(metric for metric in certificate.metrics if metric.name.startswith(name))


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
@pytest.mark.parametrize(("spec", "T", "way"), [(CREEP, 1, 0.004), (PUSHED, 0.2, 0.38 / 4 * 0.2**2)])
def test_a_body_does_not_slide_without_its_friction(
    tmp_path: Path, spec: str, T: float, way: float, method: str
) -> None:
    """4 mm at a quarter of the friction, and 3.8 mm along with it, are no motions of the block."""
    certificate = judged(tmp_path, spec, 20, T, method)
    missing = row(certificate, "friction missing")
    # What is slower than 1 mm/s does not count, nor what central leaves out at both ends.
    assert missing.verdict == "fail" and missing.value == pytest.approx(way, rel=0.15)
    assert row(certificate, "friction used").verdict == "pass"
    # Nor does it have the 5 m of a body that slides as it should: its way is 0.3 m at least.
    assert row(certificate, "open-loop error on the ground, at the end").value == pytest.approx(
        way / 0.3, rel=0.05
    )
    assert not certificate.passed
    (step,) = certificate.next_steps
    stated = 2 / 19.62 if spec is CREEP else 0.38 / 19.62
    assert step.endswith(f"body b has {stated:.3g} times its normal force, its contacts have 0.4")


@pytest.mark.daily_every(3)
@pytest.mark.parametrize(("method", "n"), [("hermite-simpson", 10), ("trapezoidal", 10), ("trapezoidal", 40)])
def test_a_body_that_brakes_by_friction_slides_rightly(tmp_path: Path, method: str, n: int) -> None:
    """The law is stated up to the frame before the stop: the last step has it in the mean."""
    certificate = judged(tmp_path, STOPS, n, 0.5, method)
    assert row(certificate, "friction missing").value == 0.0
    assert certificate.passed, certificate.headline


ROUND = (
    "variables: x, y; definitions: v = sqrt(x'^2 + y'^2); constraints: [0]: x; y; x' = 2; y' = 1; "
    "[0, n]: x'' = -mu*g*x'/v; y'' = -mu*g*y'/v; guess: x = 2*t; y = t; method: {method}; "
    + REPLAY.format(z="0*x")
    + "joint y = y; contact body.b.fx = -mu*m*g*x'/v; contact body.b.fy = -mu*m*g*y'/v; contact body.b.fz = m*g;"
)
ACROSS = '<joint name="y" type="slide" axis="0 1 0"/>'


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_slide_off_the_axes_needs_a_round_cone(tmp_path: Path, cone: str) -> None:
    certificate = judged(tmp_path, ROUND, 20, 0.3, cone=cone, across=ACROSS)
    assert row(certificate, "friction missing").value == 0.0  # Coulomb's law it is
    assert certificate.passed is (cone == "elliptic"), certificate.headline
    if not certificate.passed:
        (step,) = certificate.next_steps
        assert step.endswith('give the model <option cone="elliptic"/>, whose friction opposes the velocity')


#: The floor's force goes from 5*m*g at the frames to -m*g at the midpoints: it is m*g in the mean.
PULLS = (
    "variables: x, z, u, fz; constraints: [0, n]: m*x'' = u; m*z'' = fz - m*g; z = 0; x = 0; [0]: fz = 5*m*g; z'; x'; "
    "method: {method}; " + REPLAY.format(z="z") + "actuator px = u; contact body.b.fz = fz;"
)
#: The motor lifts with 1.1 times the weight on the left of the take-off, where the floor still holds the block.
LIFT = (
    "constants: na = n/2; variables: x, z, u, fz; constraints: [0]: x; x'; [0, n]: x'' = 0; m*z'' = u + fz - m*g; "
    "[0, na]: z = 0; z' = 0; z'' = 0; [0, na-1]: u = m*g/2; [na]: before(u) = 1.1*m*g; after(z') = 0; "
    "[na, n]: fz = 0; [n]: z = 0.1; z'; jumps: [na]: u, fz; objective: [na, n]: integral(u^2); method: {method}; "
    + REPLAY.format(z="z")
    + "actuator pz = u; contact body.b.fz = fz;"
)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("spec", "method", "share"), [(PULLS, "hermite-simpson", 1 / 5), (LIFT, "trapezoidal", 0.1 / 0.5)]
)
def test_no_floor_pulls_at_any_node(tmp_path: Path, spec: str, method: str, share: float) -> None:
    certificate = judged(tmp_path, spec, 20, 1, method)
    pull = row(certificate, "contact force, solved one pulls")
    assert pull.value == pytest.approx(share, rel=1e-6) and pull.verdict == "fail"
    assert row(certificate, "contact force that no contact gives").value == pytest.approx(
        share, rel=1e-6
    ) or (method == "trapezoidal")
    assert certificate.next_steps[0].startswith("state that the contact force pushes")


WHEEL = """<mujoco><option gravity="0 0 -9.81" cone="elliptic"/><worldbody>
  <geom type="plane" size="9 9 0.1" friction="0.8"/>
  <body name="w" pos="0 0 0.2">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="roll" type="hinge" axis="0 1 0"/>
    <joint name="z" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="2" diaginertia="0.02 0.04 0.02"/>
    <geom type="sphere" size="0.2" friction="0.8" solref="0.004 1"/>
  </body></worldbody><actuator><motor name="t" joint="roll"/></actuator></mujoco>"""

#: A torque of 0.5 N m rolls it: m*x'' = f and 0.04*x''/0.2 = 0.5 - 0.2*f.
ROLLS = (
    "constants: m = 2, g = 9.81, R = 0.2, n = 20, T = 0.5, h = T/n; variables: x, th, f; "
    "constraints: [0]: x; x'; th; th'; [0, n]: m*x'' = f; 0.04*th'' = 0.5 - R*f; x'' = {slip}*R*th''; "
    'method: hermite-simpson; replay: model = "wheel.xml"; joint x = x; joint roll = th; joint z = 0*x; '
    "actuator t = 0.5 + 0*x; contact body.w.fx = f; contact body.w.my = -R*f; contact body.w.fz = m*g;"
)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("slip", [1.0, 1.05])
def test_a_wheel_rolls_and_does_not_slide(tmp_path: Path, slip: float) -> None:
    """Its contact point stands still, so that less than the whole friction holds it; one that slips has all of it."""
    (tmp_path / "wheel.xml").write_text(WHEEL)
    (tmp_path / "wheel.stc").write_text(ROLLS.format(slip=slip))
    certificate = certify(stc.load(tmp_path / "wheel.stc").solve(), equations=False)
    rows = [m for m in certificate.metrics if m.name.startswith("friction missing")]
    assert certificate.passed is (slip == 1.0), certificate.headline
    assert [m.verdict for m in rows] == ([] if slip == 1.0 else ["fail"])
    if rows:
        # x'' = f/m, with 0.04*x''/(slip*R) = 0.5 - R*f.
        acceleration = 0.5 / (0.04 / (slip * 0.2) + 0.2 * 2)
        assert rows[0].value == pytest.approx(acceleration * 0.5**2 / 2 * (1 - 1 / slip), rel=0.05)


def test_lines_that_nothing_gives_are_named(tmp_path: Path) -> None:
    """A force on the joint, high above the floor and without a limit of the joint."""
    spec = (
        "variables: z, f; constraints: [0, n]: m*z'' = f - m*g; [0]: z; z'; [n]: z = 0; z'; "
        "objective: [0, n]: integral(f^2); method: {method}; replay: "
        'model = "block.xml"; joint z = z; contact joint.z = f;'
    )
    (step,) = judged(
        tmp_path, spec.replace("joint z = z", "joint z = 1 + z"), 8, 0.4, "trapezoidal"
    ).next_steps
    assert step.startswith(
        "contact joint.z acts where nothing touches, so that nothing in the model supplies its force"
    )
