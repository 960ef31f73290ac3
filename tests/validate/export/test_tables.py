"""Motions as tables."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import smooth_particle, waypoint_spline

from stc.errors import UsageError
from stc.solution import Solution
from stc.validate.export import FORMATS, default_name, export


def spline() -> Solution:
    return smooth_particle("hermite-simpson", np.linspace(0, 2, 21), *waypoint_spline(), name="spline")


def test_a_table_at_the_frames_keeps_every_digit(tmp_path: Path) -> None:
    solution = spline()
    with export(solution, "csv", tmp_path / "a.csv").open() as stream:
        header, *rows = csv.reader(stream)
    assert header == ["time", *solution.names]
    table = np.array(rows, dtype=float)
    assert np.array_equal(table[:, 0], solution.time)
    for k, name in enumerate(solution.names):
        assert np.array_equal(table[:, k + 1], np.broadcast_to(solution[name], (21,)))


def test_a_table_at_a_rate_ends_where_the_motion_ends(tmp_path: Path) -> None:
    solution = spline()
    with np.load(export(solution, "npz", tmp_path / "a.npz", rate=7.0)) as table:
        assert np.allclose(table["time"], [*np.arange(14) / 7, 2.0], atol=1e-15)
        assert np.allclose(table["x"], solution.at(table["time"])["x"])


def test_names_of_files_and_formats() -> None:
    solution = spline()
    names = [default_name(solution, kind) for kind in ("csv", "npz", "keyframes", "controls", "gltf")]
    assert names == [
        "spline_motion.csv",
        "spline_motion.npz",
        "spline_keyframes.xml",
        "spline_controls.npz",
        "spline.glb",
    ]
    with pytest.raises(UsageError, match="unknown format `fbx`"):
        export(solution, "fbx")
    with pytest.raises(UsageError, match=r"the format gltf is written to \*.glb"):
        export(solution, "gltf", "a.gltf")
    with pytest.raises(UsageError, match="the rate must be positive"):
        export(solution, "csv", rate=0.0)


@pytest.mark.parametrize(
    ("kind", "asked"),
    [
        ("csv", {"rate": 1e9}),
        ("npz", {"rate": float("inf")}),
        ("gltf", {"rate": 1e7}),
        ("controls", {"time_step": 1e-9}),
    ],
)
def test_what_is_out_of_proportion_is_refused_before_the_work(
    kind: str, asked: dict[str, float], tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="numbers at most"):
        export(spline(), kind, tmp_path / f"a{FORMATS[kind]}", **asked)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_a_table_that_is_stopped_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = export(spline(), "npz", tmp_path / "a.npz")
    before = file.read_bytes()

    def fail(stream: object, **arrays: object) -> None:
        stream.write(b"half")  # type: ignore[attr-defined]
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", fail)
    for kind in ("npz", "controls"):
        with pytest.raises(KeyboardInterrupt):
            export(spline(), kind, file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]
