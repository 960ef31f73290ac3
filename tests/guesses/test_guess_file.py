"""Starting values from tables: where rows stand, gaps, jumps, and tables that do not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import UsageError
from stc.guesses.file import read_guess
from stc.guesses.values import CoverageWarning, SolutionValues, TableValues, UnusedWarning, table
from stc.trajectory import METHODS
from stc.validate.export import export

TEXT = """
constants: n = 4, T = 2, h = T/n;
variables: x, y;
parameters: p;
constraints: [0, n]: x'' = y; p >= 0;
objective: [0, n]: integral(y^2 + (x - p)^2);
method: trapezoidal;
"""


def written(folder: Path, text: str, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def start(path: Path, **constants: float):
    """The starting point that a file leads to, by name."""
    model = stc.load(TEXT)
    problem, transcription = model.transcription(**constants)
    return transcription.recovery(transcription.bind(problem.constants, guess=read_guess(path)).x0)


def test_rows_stand_where_a_column_says(tmp_path: Path):
    for head, places in (("t", (0, 1, 2)), ("frame", (0, 2, 4)), ("time", (0, 1, 2))):
        rows = "\n".join(f"{place},{value}" for place, value in zip(places, (0, 10, 0), strict=True))
        found = start(written(tmp_path, f"{head},x\n{rows}\n"))
        assert found.trajectories()["x", 0].before == pytest.approx([0, 5, 10, 5, 0])
    found = start(written(tmp_path, "x;y\n0;1\n10;1\n0;1\n"))
    assert found.trajectories()["x", 0].before == pytest.approx([0, 5, 10, 5, 0])


def test_gaps_are_interpolated_and_parameters_are_their_first_number(tmp_path: Path):
    found = start(written(tmp_path, "t,x,p\n0,0,\n1,,7\n2,4,8\n"))
    assert found.trajectories()["x", 0].before == pytest.approx([0, 1, 2, 3, 4])
    assert found.parameters["p"] == 7


def test_arrays_and_solutions_are_read_as_well(tmp_path: Path):
    np.savez(tmp_path / "a.npz", t=[2, 0], x=[4, 0], p=3.0)
    found = start(tmp_path / "a.npz")
    assert found.trajectories()["x", 0].before == pytest.approx([0, 1, 2, 3, 4])
    assert found.parameters["p"] == 3
    solution = stc.load("particle_waypoints").solve(n=8)
    for name in ("b.npz", "b.csv"):
        solution.save(tmp_path / name)
        assert isinstance(read_guess(tmp_path / name), SolutionValues)
        again = stc.load("particle_waypoints").solve(n=8, guess=tmp_path / name)
        assert again.iterations <= 2


def test_two_rows_at_one_time_are_a_jump():
    values = table({"t": [0, 1, 1, 2], "x": [0, 1, 5, 6]})
    before, after, mid = values.values("x", 0, np.array([0, 1, 2.0]))
    assert before == pytest.approx([0, 1, 6], abs=1e-8) and after == pytest.approx([0, 5, 6], abs=1e-8)
    assert mid == pytest.approx([0.5, 5.5])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "contains no table"),
        ("t,x\n", "contains no table"),
        ("1,2\n3,4\n", "the first line of `.*a.csv` holds numbers"),
        ("t,x,x\n0,1,1\n", "one name twice"),
        ("t,x\n0,one\n", "row 2 of `.*a.csv` has `one` for x, which is not a number"),
        ("t,x\n0,1,2\n", "row 2 of `.*a.csv` has 3 entries for 2 names"),
        ("t,x\n0,inf\n1,0\n", "x is infinite somewhere"),
        ("t,x,y\n0,nan,1\n1,,1\n", "x has no number at all"),
        ("t,x\n0,1\n,2\n", "t has a gap"),
    ],
)
def test_damaged_tables_are_refused(tmp_path: Path, text: str, message: str):
    with pytest.raises(stc.UsageError, match=message):
        read_guess(written(tmp_path, text))


def test_other_files_are_refused(tmp_path: Path):
    with pytest.raises(stc.UsageError, match=r"from a .csv or .npz file"):
        read_guess(written(tmp_path, "x", "a.txt"))
    with pytest.raises(stc.UsageError, match="there is no file"):
        read_guess(tmp_path / "b.csv")
    with pytest.raises(stc.UsageError, match=r"is no \.npz file"):
        read_guess(written(tmp_path, "junk", "a.npz"))
    np.savez(tmp_path / "b.npz", x=np.array([{}]))
    with pytest.raises(stc.UsageError, match="other data than numbers"):
        read_guess(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", x=np.zeros((2, 2)))
    with pytest.raises(stc.UsageError, match=r"not a list of numbers \(shape \(2, 2\)\)"):
        read_guess(tmp_path / "c.npz")
    np.savez(tmp_path / "d.npz", t=np.zeros(3), x=np.zeros(2))
    with pytest.raises(stc.UsageError, match="x has 2 numbers and t has 3"):
        read_guess(tmp_path / "d.npz")


def test_names_that_the_spec_does_not_have_come_with_the_nearest_one(tmp_path: Path):
    path = written(tmp_path, "t,xx,aa\n0,0,0\n2,1,1\n")
    with pytest.raises(stc.UsageError, match="did you mean `x`"):
        stc.load(TEXT).solve(guess=path)
    with pytest.raises(stc.UsageError, match="not from both"):
        stc.load(TEXT).solve(guess=path, warm_start=stc.load(TEXT).solve())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,x,x''',y\n0,0,0,0\n2,1,0,1\n", "a.csv` has `x'''`, which text does not use; it uses x, x', x''$"),
        ("t,x,p'\n0,0,0\n2,1,0\n", "a.csv` has `p'`, which text does not use; p is a parameter$"),
    ],
)
def test_columns_that_nothing_uses_are_told_once(tmp_path: Path, text: str, message: str) -> None:
    model, guess = stc.load(TEXT), read_guess(written(tmp_path, text))
    with pytest.warns(UnusedWarning, match=message):
        model.solve(guess=guess)
    assert model.solve(guess=guess).status == "optimal"  # and no further warning, which would be an error


def test_what_a_motion_has_beside_the_spec_is_told() -> None:
    other = stc.load(TEXT.replace("y", "ya")).solve()
    with pytest.warns(UnusedWarning, match="motion of text has `ya`, which text does not .*`y` by `ya`"):
        stc.load(TEXT).solve(guess=other)


def test_tables_and_motions_of_the_same_spec_are_all_of_use(tmp_path: Path) -> None:
    """Whatever the method that they come from and the one that they go to, warnings being errors."""
    for method in METHODS:
        solution = stc.load("particle_jet").solve(method=method)
        export(solution, "csv", tmp_path / "table.csv")
        solution.save(tmp_path / "motion.csv")
        for name in ("table.csv", "motion.csv"):
            for other in METHODS:
                stc.load("particle_jet").solve(guess=tmp_path / name, method=other, max_iterations=1)


def test_a_table_for_another_time_is_told():
    time = np.linspace(0, 2, 5)
    with pytest.warns(CoverageWarning, match="covers t = 0 to 1, the motion 0 to 2"):
        table({"t": [0, 1], "x": [0, 1]}).values("x", 0, time)
    with pytest.raises(stc.UsageError, match=r"has a row for frame 9; the motion has frames 0 to 4"):
        table({"frame": [0, 9], "x": [0, 1]}).values("x", 0, time)
    # A hundredth is no other time, and a table without places fits any motion.
    assert table({"t": [0, 1.99], "x": [0, 1]}).values("x", 0, time) is not None
    assert TableValues({"x": np.array([0.0, 1.0])}).values("x", 0, time)[0][-1] == 1


def test_numbers_by_name() -> None:
    """As from a file; what is not a list of numbers is told."""
    model = stc.load(TEXT)
    name = next(iter(model.problem().variables))
    times = [0.0, 1.0, 2.0]
    solution = model.solve(guess={"t": times, name: [0.0, 1.0, 0.0]})
    assert solution.status == "optimal"
    for wrong in ([[0.0, 1.0]], "much", [], {}):
        with pytest.raises(
            UsageError, match=f"`{name}` in the guess is neither a number nor a list of numbers"
        ):
            model.solve(guess={name: wrong})
    with pytest.raises(UsageError, match="names `nobody`"):
        model.solve(guess={"nobody": [1.0]})


def test_damaged_arrays_are_told_in_plain_words(tmp_path: Path) -> None:
    whole, guess = tmp_path / "whole.npz", tmp_path / "guess.npz"
    np.savez_compressed(whole, x=np.random.default_rng(1).random(300))
    content = whole.read_bytes()
    np.save(tmp_path / "single.npy", np.zeros(3))
    for damaged, what in (
        (b"", "it is empty"),
        (content[: len(content) // 2], "it was cut off"),
        (content[:400] + bytes(200) + content[600:], "it was cut off"),
        ((tmp_path / "single.npy").read_bytes(), "it was cut off, or is no .npz file"),
    ):
        guess.write_bytes(damaged)
        with pytest.raises(UsageError, match=f"no guess can be read from `.*guess.npz`: {what}"):
            read_guess(guess)
