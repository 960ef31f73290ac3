"""Files as people write them: exact against MuJoCo's inverse dynamics, as files that a spec names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mechanism_files import FILES
from mechanism_states import Compared, actuation, inverse, relative_error

from stc.mechanism.refusals import refusals


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
