"""What `data:` declares: columns, tables as functions, and one message for everything that can be wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline

import stc
from stc.errors import SpecError
from stc.language.show import show_syntax
from stc.problem import ConstantRef, Problem, VariableRef
from stc.symbolic.expr import evaluate

SHELL = "constants: n = 4, c = 2; variables: x, y;\n{data}\ndefinitions: e = {e};\nconstraints: [0]: x = 0; y = e;"
ANGLES = np.array([-0.2, 0.0, 0.1, 0.3, 0.5])
LIFTS = np.array([-0.9, 0.1, 0.6, 1.2, 1.1])


def written(folder: Path, name: str, content: str | bytes) -> None:
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def stated(folder: Path, data: str, e: str = "x", **constants: float) -> Problem:
    """The problem of a short spec in a folder, with a definition `e`."""
    path = folder / "short.stc"
    path.write_text(SHELL.format(data=data, e=e), encoding="utf-8")
    return stc.load(path, **constants).problem()


def value(problem: Problem, x: object, y: object = 0.0) -> np.ndarray:
    """The definition `e` at a place."""
    values = {VariableRef("x"): x, VariableRef("y"): y, ConstantRef("c"): 2.0}
    values |= {VariableRef("x", 1): 1.0, VariableRef("y", 1): 1.0}
    return np.asarray(evaluate(problem.macros["e"], values))


def polar(folder: Path, mark: str = ",") -> None:
    rows = [f"{a!r}{mark}{c!r}" for a, c in zip(ANGLES.tolist(), LIFTS.tolist(), strict=True)]
    written(folder, "polar.csv", "\n".join([f"alpha{mark}cl", *rows]))


@pytest.mark.parametrize("mark", [",", ";", "\t", ", "])
def test_a_column_of_a_file_is_a_spline(mark: str, tmp_path: Path) -> None:
    polar(tmp_path, mark)
    data = 'data: polar = "polar.csv"; CL = table(polar.alpha, polar.cl);'
    at = np.linspace(-0.2, 0.5, 50)
    np.testing.assert_allclose(value(stated(tmp_path, data, "CL(x)"), at), CubicSpline(ANGLES, LIFTS)(at))
    slope = value(stated(tmp_path, data, "CL(x + y)'"), at / 2, at / 2)
    np.testing.assert_allclose(slope, 2.0 * CubicSpline(ANGLES, LIFTS)(at, 1), rtol=1e-10, atol=1e-12)


def test_what_files_may_have_besides_numbers(tmp_path: Path) -> None:
    written(
        tmp_path,
        "a.csv",
        b'\xef\xbb\xbf# measured\n\n"angle, deg",joint.knee\r\n0, 1\r\n\n# so\n 1 , 3.5\r\n2,\r\n',
    )
    problem = stated(tmp_path, 'data: a = "a.csv"; b = (x, y): (0, 1), (c, 3); f = table(b.x, b.y);', "f(1)")
    columns = problem.data["a"].columns
    assert list(columns) == ["angle, deg", "joint.knee"]
    np.testing.assert_array_equal(columns["joint.knee"], [1.0, 3.5, np.nan])
    assert value(problem, 0.0) == pytest.approx(2.0)
    assert "c" in problem.structural


@pytest.mark.parametrize("order", [1, 2, 3])
def test_primes_before_the_arguments_are_slopes(order: int, tmp_path: Path) -> None:
    polar(tmp_path)
    data = 'data: polar = "polar.csv"; CL = table(polar.alpha, polar.cl);'
    at, primes = np.linspace(-0.19, 0.49, 50), "'" * order
    spline = CubicSpline(ANGLES, LIFTS)
    slope = value(stated(tmp_path, data, f"CL{primes}(x)^2"), at)
    np.testing.assert_allclose(slope, spline(at, order) ** 2, rtol=1e-9, atol=1e-12)
    if order < 3:
        rate = value(stated(tmp_path, data, f"CL{primes}(2*x)'"), at / 2)
        np.testing.assert_allclose(rate, 2.0 * spline(at, order + 1), rtol=1e-9, atol=1e-9)


def test_a_slope_is_solved_for(tmp_path: Path) -> None:
    """The lowest place of measured ground, where its slope is none."""
    polar(tmp_path)
    text = 'data: polar = "polar.csv"; H = table(polar.alpha, polar.cl); parameters: a; guess: a = 0.4;'
    (tmp_path / "top.stc").write_text(text + "constraints: H'(a) = 0;")
    solved = stc.load(tmp_path / "top.stc").solve()
    roots = CubicSpline(ANGLES, LIFTS).derivative().roots(extrapolate=False)
    assert np.abs(roots - solved["a"]).min() < 1e-9


@pytest.mark.parametrize(
    ("content", "hint"),
    [
        ("x;y\n0,5;1", "the decimal point is a `.`"),
        ("x,y\n0,5,1,5", "if these are decimal commas, write points"),
        ("x,y\nm,N\n0,1", "if the line contains units, begin it with `#`"),
        ("x,y\n0,1\n1,NA", "leave a cell without a number empty"),
        ("x,y\n0,1,\n", "take away the `,` at the end of the line"),
        (",x,y\n0,0,1", "`to_csv(..., index=False)`"),
        ("sep=;\nx;y\n0;1", "take the line `sep=` away"),
        ("# x,y\n0,1\n1,2", "if the first one names the columns, remove the `#`"),
        ("0,1\n1,2", "write a first line such as `time,height`"),
        ("x y\n0 1", "cells are separated by commas, semicolons or tabulators"),
        ("", "the first line names the columns"),
    ],
)
def test_what_to_do_about_a_file(content: str, hint: str, tmp_path: Path) -> None:
    written(tmp_path, "d.csv", content)
    with pytest.raises(SpecError) as caught:
        stated(tmp_path, 'data: d = "d.csv";')
    (diagnostic,) = caught.value.diagnostics
    assert hint in diagnostic.hint


@pytest.mark.parametrize(
    ("data", "e", "message", "hint"),
    [
        ("f = table(d.a, d.b) monotone;", "f(x)", "expected `,` before `monotone`", ""),
        (
            "f = table(d.a, d.b), hold;",
            "f(x)",
            "`hold` is not an option of a table",
            "write `outside = hold`",
        ),
        ("f = table(7);", "f(x)", "expected a column, as in `polar.alpha`, found `7`", ""),
        ("e1 = (a, b): (0, 1) (1, 2);", "x", "expected `,` between two rows, found `(`", "rows are"),
        (
            "",
            "table(d.a, d.b)",
            "`table` cannot stand in an expression",
            "`f = table(polar.alpha, polar.cl);`",
        ),
        ("", "interp1d(x, d.a, d.b)", "`interp1d` cannot stand in an expression", "under `data:`"),
        ("", "d.b(x)", "expected an operator or `;`, found `(`", "is a table: `f = table(data.x, data.y);`"),
        ("", "D.b", "`D.b` is a path of a model", "did you mean `d`?"),
        ("", "x'(y)", "`x'(...)` would be the slope of a table, and `x` is none", "write `x'*(...)`"),
        ("constants: a = d.b;", "x", "`d.b` is a column of data", "use it in a statement"),
    ],
)
def test_each_mistake_has_one_message(data: str, e: str, message: str, hint: str, tmp_path: Path) -> None:
    rows = "data: d = (a, b): (0, 1), (1, 3); "
    with pytest.raises(SpecError) as caught:
        stated(tmp_path, rows + data, e)
    (diagnostic,) = caught.value.diagnostics
    assert message in diagnostic.message
    assert hint in diagnostic.hint


def test_constants_in_rows_can_be_set(tmp_path: Path) -> None:
    data = "data: b = (x, y): (0, 1), (c, 3); f = table(b.x, b.y);"
    assert value(stated(tmp_path, data, "f(1)", c=1.0), 0.0) == pytest.approx(3.0)


def test_shape_preserving_and_straight(tmp_path: Path) -> None:
    polar(tmp_path)
    at = np.linspace(-0.2, 0.5, 50)
    start = 'data: polar = "polar.csv"; CL = table(polar.alpha, polar.cl), '
    found = value(stated(tmp_path, start + "monotone;", "CL(x)"), at)
    np.testing.assert_allclose(found, PchipInterpolator(ANGLES, LIFTS)(at), rtol=1e-12)
    problem = stated(tmp_path, start + "linear;", "CL(x)")
    np.testing.assert_allclose(value(problem, at), np.interp(at, ANGLES, LIFTS), rtol=1e-12)
    assert [w.message for w in problem.warnings if "kinks" in w.message]


@pytest.mark.parametrize(
    ("option", "low", "high"),
    [
        ("", lambda s: LIFTS[0] - s(-0.2, 1), lambda s: LIFTS[-1] + 2.0 * s(0.5, 1)),
        (", outside = extend", lambda s: LIFTS[0] - s(-0.2, 1), lambda s: LIFTS[-1] + 2.0 * s(0.5, 1)),
        (", outside = hold", lambda s: LIFTS[0], lambda s: LIFTS[-1]),
        (", outside = error", lambda s: np.nan, lambda s: np.nan),
    ],
)
def test_outside(option: str, low: object, high: object, tmp_path: Path) -> None:
    polar(tmp_path)
    data = f'data: polar = "polar.csv"; CL = table(polar.alpha, polar.cl){option};'
    spline = CubicSpline(ANGLES, LIFTS)
    found = value(stated(tmp_path, data, "CL(x)"), np.array([-1.2, 2.5, -0.2, 0.5]))
    np.testing.assert_allclose(found, [low(spline), high(spline), LIFTS[0], LIFTS[-1]])  # type: ignore[operator]


@pytest.mark.parametrize("form", ["matrix", "rows"])
def test_two_arguments(form: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    a, b = np.sort(rng.uniform(0.0, 9.0, 7)), np.sort(rng.uniform(-1.0, 1.0, 5))
    z = rng.normal(size=(7, 5))
    if form == "matrix":
        np.savez(tmp_path / "map.npz", a=a, b=b, z=z)
        data = 'data: map = "map.npz"; H = table(map.a, map.b, map.z);'
    else:
        rows = [f"{a[i]!r},{b[j]!r},{z[i, j]!r}" for i, j in rng.permutation(list(np.ndindex(7, 5)))]
        written(tmp_path, "map.csv", "a,b,z\n" + "\n".join(rows).replace("np.float64(", "").replace(")", ""))
        data = 'data: map = "map.csv"; H = table(map.a, map.b, map.z);'
    truth = RectBivariateSpline(a, b, z, s=0)
    x, y = rng.uniform(a[0], a[-1], 40), rng.uniform(b[0], b[-1], 40)
    np.testing.assert_allclose(value(stated(tmp_path, data, "H(x, y)"), x, y), truth.ev(x, y), rtol=1e-9)
    rate = truth.ev(x, y, dx=1) + truth.ev(x, y, dy=1)
    np.testing.assert_allclose(value(stated(tmp_path, data, "H(x, y)'"), x, y), rate, rtol=1e-8)


FILE = 'data: d = "d.csv"; '
WRONG = [
    ('data: d = "no.csv";', "a,b\n0,1\n1,2", "there is no file `no.csv`", 'd = "no.csv"'),
    ('data: d = "c.csv";', "a,b\n0,1\n1,2", "did you mean `d.csv`?", 'd = "c.csv"'),
    ('data: d = "d.txt";', "", "from a .csv, .tsv or .npz file", 'd = "d.txt"'),
    (FILE, "", "`d.csv` contains no table", 'd = "d.csv"'),
    (FILE, "a,b", "`d.csv` contains no table", 'd = "d.csv"'),
    (FILE, "0,1\n1,2", "line 1 of `d.csv` holds numbers; it has to name the columns", 'd = "d.csv"'),
    (FILE, "a,b\n0,1\n1,2,3", "line 3 of `d.csv` has 3 cells for 2 columns", 'd = "d.csv"'),
    (
        FILE,
        "a,b\n0,1\n\n# so\n1,two",
        "line 5 of `d.csv` has `two` for b, which is not a number",
        'd = "d.csv"',
    ),
    (FILE, "a,b\n0,1\n1,-inf", "line 3 of `d.csv` has `-inf` for b, which is not a number", 'd = "d.csv"'),
    (FILE, "a,a\n0,1\n1,2", "`d.csv` has two columns `a` on line 1", 'd = "d.csv"'),
    (FILE, "a,\n0,1\n1,2", "column 2 of `d.csv` has no name on line 1", 'd = "d.csv"'),
    (FILE, b"a,b\n0,\xff\n", "`d.csv` is not UTF-8 text: line 2 has the byte 0xff", 'd = "d.csv"'),
    (FILE, b" " * (2**25 + 1), "a data file may have 33554432 at most", 'd = "d.csv"'),
    (FILE + "f = table(d.a, d.c);", "a,b\n0,1\n1,2", "`d.csv` has no column `c`", "d.c"),
    (FILE + "f = table(d.a, q.c);", "a,b\n0,1\n1,2", "there is no data set `q`", "q.c"),
    (FILE + "f = table(d.a);", "a,b\n0,1\n1,2", "two or three columns, not of 1", "f = table(d.a)"),
    (FILE + "f = table(d.a, d.b);", "a,b\n0,1", "`d.a` has 1 number, and a table needs two", "d.a"),
    (
        FILE + "f = table(d.a, d.b);",
        "a,b\n0,1\n2,1\n1,4",
        "`d.a` is less than before on line 4 of `d.csv`",
        "d.a",
    ),
    (
        FILE + "f = table(d.a, d.b);",
        "a,b\n0,1\n1,1\n1,4",
        "`d.a` is the same twice on line 4 of `d.csv`",
        "d.a",
    ),
    (FILE + "f = table(d.a, d.b);", "a,b\n0,1\n1,\n2,4", "`d.b` has no number on line 3 of `d.csv`", "d.b"),
    (
        FILE + "f = table(d.a, d.b), smooth;",
        "a,b\n0,1\n1,2",
        "`smooth` is not an option of a table",
        "smooth",
    ),
    (FILE + "f = table(d.a, d.b), outside = zero;", "a,b\n0,1\n1,2", "no `zero`", "zero"),
    (
        FILE + "f = table(d.a, d.b), linear, monotone;",
        "a,b\n0,1\n1,2",
        "either `linear` or `monotone`",
        "monotone",
    ),
    (
        FILE + "f = table(d.a, d.b, d.b);",
        "a,b\n0,1\n1,2",
        "there is no value of `d.b` for d.a = 0, d.b = 2",
        "f = ",
    ),
    (
        FILE + "f = table(d.a, d.b, d.b);",
        "a,b\n0,1\n0,1\n1,2\n1,1",
        "line 3 of `d.csv` has the same place",
        "f = ",
    ),
    (FILE + "f = table(d.a, d.b, d.b), monotone;", "a,b\n0,1\n1,2", "no `monotone` form", "f = "),
    (FILE + "f = table(d.a, d.b);", "a,b\n0,0\n1e-300,1e300\n1,0", "`d.a` rises too little on line 3", "d.a"),
    (FILE + "f = table(d.a, d.b);", "a,b\n0,0\n1e-9,1e300\n1,0", "too large, or too near", "f = "),
    ("data: d = (a, b): (0, 1), (1);", "", "a row has 1 number for 2 columns", "(1)"),
    ("data: d = (a, b): (0, x), (1, 2);", "", "a row of data cannot use the variable `x`", "x"),
    ("data: d = (a, a): (0, 1), (1, 2);", "", "there are two columns `a`", "a"),
    ("data: d = 3;", "", "expected data after `d =`", "3"),
    ("data: d = keyframes;", "", "keyframes are those of a model, and the spec has none", "d = keyframes"),
    ("data: x = (a, b): (0, 1), (1, 2);", "", "`x` is declared already, as a variable", "x"),
    ("data: joint = (a, b): (0, 1), (1, 2);", "", "`joint` is what paths of a model begin with", "joint"),
    ("data: h = (a, b): (0, 1), (1, 2);", "", "`h` is the time from one frame to the next", "h"),
    ("data: sin = (a, b): (0, 1), (1, 2);", "", "`sin` is a function", "sin"),
]


@pytest.mark.parametrize(("data", "content", "message", "marked"), WRONG)
def test_mistakes_in_data(data: str, content: str | bytes, message: str, marked: str, tmp_path: Path) -> None:
    written(tmp_path, "d.csv", content)
    with pytest.raises(SpecError) as caught:
        stated(tmp_path, data)
    assert message in str(caught.value)
    first = caught.value.diagnostics[0]
    assert len(caught.value.diagnostics) == 1
    assert first.span is not None
    assert first.span.text.startswith(marked)


@pytest.mark.parametrize(
    ("e", "message"),
    [
        ("d", "`d` is a data set, not a number"),
        ("d.a", "`d.a` is a column of numbers"),
        ("d.q", "`d` has no column `q`"),
        ("f", "the table `f` has no arguments"),
        ("f(x, y)", "the table `f` takes 1 argument, not 2"),
        ("g(x)", "there is no function `g`"),
        ("f(z)", "`z` is not declared"),
    ],
)
def test_mistakes_in_use(e: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SpecError) as caught:
        stated(tmp_path, "data: d = (a, b): (0, 1), (1, 2); f = table(d.a, d.b);", e)
    assert message in str(caught.value)
    assert len(caught.value.diagnostics) == 1


@pytest.mark.parametrize(("column", "size"), [(np.zeros(4), "4"), (np.zeros((5, 2)), "5 x 2")])
def test_a_recorded_array_has_a_number_for_each_time(column: np.ndarray, size: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "d.npz", time=np.arange(5.0), b=column)
    with pytest.raises(SpecError) as caught:
        stated(tmp_path, 'data: d = "d.npz";', "d.b")
    assert f"`d.b` has {size} numbers, and `d.time` 5" in str(caught.value)


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"a": np.array([0.0, 1.0]), "b": np.zeros((2, 2, 2))}, "has the shape (2, 2, 2)"),
        ({"a": np.array([0.0, 1.0]), "b": np.array([0.0, np.inf])}, "`b` in `d.npz` is infinite somewhere"),
        ({"a": np.array([0.0, 1.0]), "b": np.array(["x", "y"])}, "holds other data than numbers"),
        ({"a": np.array([0.0, 1.0]), "b": np.array([1.0, 2.0, 3.0])}, "`d.b` has 3 numbers and `d.a` has 2"),
        ({"a": np.array([0.0, 1.0]), "b": np.zeros((2, 3))}, "`d.b` is a matrix, not a column"),
    ],
)
def test_mistakes_in_arrays(members: dict[str, np.ndarray], message: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "d.npz", **members)
    with pytest.raises(SpecError, match=r".*") as caught:
        stated(tmp_path, 'data: d = "d.npz"; f = table(d.a, d.b);')
    assert message in str(caught.value)


def test_a_cut_archive(tmp_path: Path) -> None:
    np.savez(tmp_path / "d.npz", a=np.arange(9.0))
    written(tmp_path, "d.npz", (tmp_path / "d.npz").read_bytes()[:-40])
    with pytest.raises(SpecError, match="damaged"):
        stated(tmp_path, 'data: d = "d.npz";')


def test_canonical_text() -> None:
    text = """data:
  a = "a.csv";
  b = (x, joint.knee): (0, c/2), (1, 2);
  walk = keyframes;
  f = table(a.x, a."so so"), monotone, outside = hold;
guess:
  walk;"""
    from stc.errors import Source
    from stc.language.parser import parse

    assert show_syntax(parse(Source("<text>", text))) == text
