"""Columns of angles that begin anew after a whole turn: when they are told of, and what the word for it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import SpecError

TIME = np.linspace(0.0, 4.0, 41)
ANGLE = 2.0 + 3.0 * TIME + 0.2 * np.sin(5.0 * TIME)
NOISE = np.random.default_rng(4).normal(scale=0.02, size=41)

SPEC = """
data: d = "turns.csv"{option};
constants: n = 60, T = 4, h = T/n;
variables: q;
objective: {term}; [0, n]: integral(1e-6*q''^2);
"""


def model(folder: Path, values: np.ndarray, term: str, option: str = "") -> stc.Model:
    """A spec that follows a column `a` of a file."""
    lines = [f"{t:g},{'' if np.isnan(v) else f'{v:.9g}'}" for t, v in zip(TIME, values, strict=True)]
    (folder / "turns.csv").write_text("time,a\n" + "\n".join(lines) + "\n", encoding="utf-8")
    path = folder / "turns.stc"
    path.write_text(SPEC.format(term=term, option=option), encoding="utf-8")
    return stc.load(path)


def told(of: stc.Model) -> list[str]:
    """The warnings about whole turns."""
    return [str(one) for one in of.problem().warnings if "turn" in one.message]


def gaps(values: np.ndarray) -> np.ndarray:
    """The same with every third number missing."""
    return np.where(np.arange(len(values)) % 3 == 2, np.nan, values)


@pytest.mark.parametrize("term", ["[d]: (q - d.a)^2", "[0, n]: integral((q - d.a)^2)"])
@pytest.mark.parametrize(
    ("values", "option"),
    [
        ((ANGLE + np.pi) % (2.0 * np.pi) - np.pi, "unwrap a"),
        ((ANGLE + NOISE) % (2.0 * np.pi), "unwrap a"),
        (np.rad2deg(-ANGLE) % 360.0, "unwrap a = 360"),
        (gaps(np.rad2deg(ANGLE) % 360.0), "unwrap a = 360"),
    ],
)
def test_a_wrapped_angle_is_told_of_once_and_its_advice_helps(
    values: np.ndarray, option: str, term: str, tmp_path: Path
) -> None:
    (warning,) = told(model(tmp_path, values, term))
    known = np.flatnonzero(np.isfinite(values))
    k = next(k for k, step in enumerate(np.diff(values[known])) if abs(step) > 0.6 * np.nanmax(values))
    assert f"on line {known[k] + 2} of `turns.csv` to" in warning
    assert f'`d = "turns.csv", {option};`' in warning
    better = model(tmp_path, values, term, f", {option}")
    assert not told(better)
    whole = np.rad2deg(2.0 * np.pi) if "360" in option else 2.0 * np.pi
    followed = better.solve()["q"]
    assert abs(followed[-1] - followed[0]) == pytest.approx(
        whole * (ANGLE[-1] - ANGLE[0]) / (2.0 * np.pi), rel=0.02
    )


@pytest.mark.parametrize(
    ("values", "term"),
    [
        (ANGLE, "[d]: (q - d.a)^2"),  # never wrapped
        (np.sin(ANGLE), "[d]: (q - d.a)^2"),
        (np.where(np.arange(41) // 7 % 2, 6.0, 0.0), "[d]: (q - d.a)^2"),  # a valve
        (np.random.default_rng(0).uniform(0.0, 6.2, 41), "[d]: (q - d.a)^2"),
        (300.0 + 50.0 * np.sin(ANGLE), "[0, n]: integral((q - d.a)^2)"),
        (
            ANGLE % (2.0 * np.pi),
            "[d]: (sin(q) - sin(d.a))^2 + (cos(q) - cos(d.a))^2",
        ),  # where turns do not matter
    ],
)
def test_other_columns_are_not_told_of(values: np.ndarray, term: str, tmp_path: Path) -> None:
    assert not told(model(tmp_path, values, term))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (", unwrap b", "`turns.csv` has no column `b`"),
        (", unwrap a = 0", "a whole turn is 0"),
        (", monotone", "a file has the option `unwrap`"),
    ],
)
def test_mistakes(option: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError) as caught:
        model(tmp_path, ANGLE, "[d]: (q - d.a)^2", option).problem()
    assert message in str(caught.value)
    assert len(caught.value.diagnostics) == 1
