"""Contacts whose friction is not one number: pairs of geoms with two, and condim 4, which turns while it slides."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.validate import Metric
from stc.validate.certificate import Certificate

MODEL = """<mujoco><option gravity="0 0 -9.81" cone="elliptic"/><worldbody>
  <geom name="floor" type="plane" size="9 9 0.1" {friction}/>
  <body name="b" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
    <joint name="z" type="slide" axis="0 0 1"/>{turn}
    <inertial pos="0 0 0" mass="2" diaginertia="0.008 0.008 0.008"/>
    <geom name="g" {shape} {friction} solref="0.004 1"/></body></worldbody>{pair}</mujoco>"""
HEAD = "constants: m = 2, I = 0.008, g = 9.81, n = 20, T = 0.25, h = T/n; method: hermite-simpson; "
REPLAY = 'replay: model = "b.xml"; joint z = 0*t; contact body.b.fz = m*g; '


def judged(folder: Path, spec: str, **model: str) -> Certificate:
    (folder / "b.xml").write_text(MODEL.format(**{"friction": "", "turn": "", "pair": ""} | model))
    (folder / "b.stc").write_text(HEAD + spec)
    return certify(stc.load(folder / "b.stc").solve(), equations=False)


def rows(certificate: Certificate, name: str) -> list[Metric]:
    return [metric for metric in certificate.metrics if metric.name.startswith(name)]


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("along", ["x", "y"])
@pytest.mark.parametrize("first", ["0.1", "0.5"])
def test_each_direction_has_its_friction(tmp_path: Path, first: str, along: str) -> None:
    """A box on a floor whose friction is 0.1 one way and 0.5 the other; MuJoCo's first tangent here is y."""
    second = "0.5" if first == "0.1" else "0.1"
    across, mu = ("y", second) if along == "x" else ("x", first)
    friction = f'friction="{first} {second} 0.005 0.0001 0.0001"'
    pair = f'<contact><pair geom1="floor" geom2="g" {friction} solref="0.004 1"/></contact>'
    spec = (
        f"constants: mu = {mu}; variables: q; constraints: [0]: q; q' = 2; [0, n]: q'' = -mu*g; "
        f"{REPLAY} joint {along} = q; joint {across} = 0*q; contact body.b.f{along} = -mu*m*g;"
    )
    certificate = judged(tmp_path, spec, shape='type="box" size="0.1 0.1 0.1"', pair=pair)
    assert certificate.passed, certificate.headline


#: It slides and turns about the vertical, with all of a cone whose axes are mu and s, against the velocity.
SPUN = (
    "constants: mu = 0.4, s = {s}; variables: x, w; definitions: v = sqrt((mu*x')^2 + (s*w')^2); "
    "N = m*g*{share}; constraints: [0]: x; w; x' = 2; w' = 60; "
    "[0, n]: m*x'' = -mu^2*x'/v*N; I*w'' = -s^2*w'/v*N; guess: x = 2*t; w = 60*t; "
    + REPLAY
    + "joint x = x; joint y = 0*x; joint w = w; contact body.b.fx = -mu^2*x'/v*N; contact body.b.mz = -s^2*w'/v*N;"
)


@pytest.mark.parametrize(
    ("s", "share", "right"), [("0.005", "1", True), ("0.02", "1", True), ("0.02", "0.9", False)]
)
def test_what_turns_while_it_slides_shares_its_friction(
    tmp_path: Path, s: str, share: str, right: bool
) -> None:
    certificate = judged(
        tmp_path,
        SPUN.format(s=s, share=share),
        shape='type="sphere" size="0.1" condim="4"',
        turn='<joint name="w" axis="0 0 1"/>',
        friction=f'friction="0.4 {s} 0.001"',
    )
    (missing,) = rows(certificate, "friction missing")
    assert (missing.value == 0.0) is right
    assert certificate.passed is right, certificate.headline
