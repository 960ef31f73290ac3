"""Files as people write them: exact against MuJoCo's inverse dynamics, as files that a spec names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mechanism_files import FILES
from mechanism_states import Compared, actuation, inverse, relative_error

from stc.mechanism.refusals import refusals
from stc.model_source import opened


@pytest.mark.filterwarnings("ignore:.*settotalmass")
@pytest.mark.parametrize("name", FILES)
def test_equations_are_mujocos(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is refused; inverse dynamics, passive forces and actuation to 1e-9 of the largest force."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes what it warns of into a file of the working directory
    for path, text in FILES[name].items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    both = Compared(tmp_path / "model.xml")
    assert not refusals(both.mechanism)
    dyn, nv = both.dynamics, both.model.nv
    found = both.values([*dyn.inverse(), *dyn.passive_forces(), *dyn.actuation()])
    wanted = np.vstack(
        [both.in_mujoco(inverse), both.in_mujoco(lambda m, d: d.qfrc_passive), both.in_mujoco(actuation)]
    )
    for rows in (slice(0, nv), slice(nv, 2 * nv), slice(2 * nv, None)):
        assert relative_error(found[rows], wanted[rows]) < 1e-9


_OVERLAPPING = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="palm"><geom type="box" size=".05 .05 .05"/>
    <body name="finger" pos=".05 0 0"><joint/><geom size=".02"/>
      <body name="tip" pos=".03 0 0"><joint/><geom size=".02"/></body></body>
    <body><joint axis="0 0 1"/><geom size=".02" pos="-.06 0 0"/></body></body>
  <body name="cup" pos=".1 0 0"><freejoint/><geom size=".035"/></body>
  <body name="lid" pos=".1 0 .04"><freejoint/><geom size=".02"/></body></worldbody>
  <equality><weld body1="cup" body2="lid"/></equality></mujoco>"""


def test_bodies_of_one_robot_that_overlap_do_not_touch_if_the_spec_says_so() -> None:
    """A finger and its fixed palm, a body without a name, a cup with its lid; fingers and floor touch the cup."""
    model = opened("m.xml", ("excludes",), _OVERLAPPING).model
    pairs = {
        (model.body(int(s) >> 16).name, model.body(int(s) & 0xFFFF).name) for s in model.exclude_signature
    }
    assert pairs == {("palm", "finger"), ("palm", "body"), ("cup", "lid")}
    assert opened("m.xml", (), _OVERLAPPING).model.nexclude == 0
