"""Numbers that leave the range of doubles are told of in the words of the spec, never in NumPy's."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from stc.cli.main import run


@pytest.mark.parametrize(
    "setting",
    [
        ("particle_jet", "xw=1e308"),
        ("particle_jet", "P=1e-320"),
        ("cart_pole_swing_up", "T=1e-300"),
        ("cart_pole_swing_up", "T=1e-320"),
        ("cart_pole_swing_up", "T=1e308"),
        ("particle_waypoints", "m=1e300"),
    ],
    ids=" ".join,
)
def test_no_note_of_numpy_is_shown(
    setting: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, constant = setting
    words = ["solve", name, "--set", "n=6", "--set", constant, "--max-iterations", "5"]
    with warnings.catch_warnings():
        warnings.simplefilter("always", RuntimeWarning)
        status = run([*words, "-o", str(tmp_path / "out.npz")])
    assert status in (0, 1, 2)
    printed = capsys.readouterr()
    assert "encountered in" not in printed.out + printed.err
    assert status == 0 or printed.out + printed.err
