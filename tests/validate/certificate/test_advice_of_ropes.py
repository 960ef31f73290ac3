"""A rope of the model that is taut gives what a ``contact`` line on a joint says: no step says that nothing does."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify

MODEL = """<mujoco><option gravity="0 0 -9.81"/><worldbody><geom type="plane" size="5 5 0.1" pos="0 0 -9"/>
  <body name="b"><inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
    <joint name="z" type="slide" axis="0 0 1"/><geom type="sphere" size="0.1"/></body></worldbody>
  <tendon><fixed limited="{limited}" range="-1 2"><joint joint="z" coef="1"/></fixed></tendon></mujoco>"""

#: It falls by 1 m, where the rope is taut, and hangs there.
SPEC = (
    "constants: m = 2, g = 9.81, n = 20, na = n/2; parameters: T; variables: z, N; definitions: h = T/n; "
    "constraints: [0]: z; z'; [0, na]: N = 0; [0, n]: m*z'' = N - m*g; [na]: z = -1; after(z') = 0; [na, n]: z'' = 0; "
    "jumps: [na]: z', N; guess: T = 1; z = -t; method: hermite-simpson; "
    'replay: model = "rope.xml"; joint z = z; contact joint.z = N;'
)


@pytest.mark.parametrize("limited", ["true", "false"])
def test_a_taut_rope_gives_a_force(tmp_path: Path, limited: str) -> None:
    (tmp_path / "rope.xml").write_text(MODEL.format(limited=limited))
    (tmp_path / "rope.stc").write_text(SPEC)
    certificate = certify(stc.load(tmp_path / "rope.stc").solve(), equations=False)
    told = any(
        step.startswith("contact joint.z acts where nothing touches") for step in certificate.next_steps
    )
    assert told == (limited == "false")
