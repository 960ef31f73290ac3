"""Which constants give a motion more frames, where contacts and poses of a model stand for most of its statements."""

from __future__ import annotations

import re

import pytest

import stc.specs
from stc.errors import UsageError
from stc.studies.frames import Spread

HOP = """
constants: n = 60, T = 0.8, h = T/n, D = 0.5;
model: "quadruped.xml";
contact:
  FL = point(geom.FL_foot);   FR = point(geom.FR_foot);   RL = point(geom.RL_foot);   RR = point(geom.RR_foot);
  [0, {off}]: FL; FR; RL; RR;
  [{on}, n]: FL; FR; RL; RR;
guess:
  [{up}]: keyframe.stand + (D/2, 0, 0.1);
constraints:
  [0]: keyframe.stand; rest;
  [n]: keyframe.stand + (D, 0, 0); rest;
objective: [0, n]: integral(effort);
"""


@pytest.mark.daily_every(4)
@pytest.mark.parametrize("name", stc.specs.names())
def test_every_shipped_motion_can_have_twice_the_frames(name: str) -> None:
    spread = Spread.of(stc.load(name), None, {})
    finer = spread.model.problem(None, **spread.multiplied(2))
    assert finer.n == 2 * spread.problem.n


def test_phases_of_contacts_can_have_frames_of_their_own() -> None:
    text = HOP.format(off="a", on="b", up="n/2").replace("n = 60", "a = 20, b = 40, n = 60")
    spread = Spread.of(stc.load(text), None, {})
    assert spread.ends == [("a", 20), ("b", 40), ("n", 60)]


@pytest.mark.parametrize(
    ("off", "on", "up", "wrong"),
    [("n/3", "50", "n/2", 50), ("20", "2*n/3", "n/2", 20), ("n/3", "2*n/3", "30", 30)],
)
def test_the_frame_is_named_that_does_not_keep_its_share(off: str, on: str, up: str, wrong: int) -> None:
    text = HOP.format(off=off, on=on, up=up)
    with pytest.raises(UsageError, match=f"frame {wrong} of 60 would be frame {wrong} of 120") as caught:
        Spread.of(stc.load(text), None, {}).multiplied(2)
    line = next(k for k, row in enumerate(text.splitlines(), 1) if re.search(rf"\[(0, )?{wrong}[,\]]", row))
    assert f"<text>:{line}:" in str(caught.value)
    assert f"`{wrong}/60*n`" in str(caught.value)
