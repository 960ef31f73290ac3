"""Solutions: names, interpolation against closed forms, and files."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

import stc
from stc.errors import SolutionError, UsageError
from stc.solution import Solution, UnknownNameError, read
from stc.solver import Result, Status
from stc.solving.collect import collect
from stc.trajectory import Channel, FloatArray

SPEC = "# a test\nconstants: n = 4;\n"


def grid(steps: list[float]) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(steps)])


def of_polynomial(
    curve: Polynomial, orders: int, time: FloatArray, mid: bool
) -> dict[tuple[str, int], Channel]:
    """Exact node values of a polynomial motion and its derivatives."""
    middle = 0.5 * (time[:-1] + time[1:])
    found = {}
    for order in range(orders + 1):
        derivative = curve.deriv(order) if order else curve
        found["x", order] = Channel.smooth(derivative(time), derivative(middle) if mid else None)
    return found


def make(
    method: str, time: FloatArray, trajectories: dict[tuple[str, int], Channel], **more: object
) -> Solution:
    return Solution(
        name="test",
        source=SPEC,
        constants={"n": len(time) - 1},
        method=method,
        time=time,
        trajectories=trajectories,
        status="optimal",
        **more,  # type: ignore[arg-type]
    )


coefficients = st.lists(st.floats(-3, 3), min_size=1, max_size=5)
steps = st.lists(st.floats(0.05, 1.0), min_size=1, max_size=6)


@given(coefficients, steps, st.lists(st.floats(0, 1), min_size=1, max_size=5))
@settings(max_examples=60, deadline=None)
def test_hermite_simpson_is_exact_for_quartics(c: list[float], h: list[float], shares: list[float]) -> None:
    """A quartic has a parabola as its second derivative, which is all that the method can hold."""
    time, curve = grid(h), Polynomial(c)
    solution = make("hermite-simpson", time, of_polynomial(curve, 2, time, mid=True))
    t = time[-1] * np.array(shares)
    found = solution.at(t)
    for order, name in enumerate(("x", "x'", "x''")):
        exact = curve.deriv(order)(t) if order else curve(t)
        np.testing.assert_allclose(found[name], exact, rtol=0, atol=1e-11 * (1 + time[-1] ** 4) * 10)


@given(coefficients, steps)
@settings(max_examples=60, deadline=None)
def test_trapezoidal_is_exact_for_parabolas_and_passes_through_the_frames(
    c: list[float], h: list[float]
) -> None:
    time = grid(h)
    parabola = Polynomial(c[:3])
    solution = make("trapezoidal", time, of_polynomial(parabola, 2, time, mid=False))
    t = np.linspace(0, time[-1], 17)
    np.testing.assert_allclose(solution.at(t)["x"], parabola(t), rtol=0, atol=1e-11 * (1 + time[-1] ** 2))
    anything = make("trapezoidal", time, of_polynomial(Polynomial(c), 2, time, mid=False))
    close = anything.at(time[1:] - 1e-8 * np.diff(time))
    for name in ("x", "x'", "x''"):
        np.testing.assert_allclose(close[name], anything[name][1:], rtol=0, atol=1e-5)


def test_central_is_smooth_and_third_order_between_the_frames() -> None:
    errors = []
    for n in (20, 40):
        time = np.linspace(0, 2, n + 1)
        x = np.sin(time)
        orders = {
            ("x", 0): Channel.smooth(x),
            ("x", 1): Channel.smooth(np.cos(time)),
            ("f", 0): Channel.smooth(-x),
        }
        solution = make("central", time, orders)
        t = np.linspace(0, 2, 333)
        errors.append(np.abs(solution.at(t)["x"] - np.sin(t)).max())
        found = solution.at(time)
        np.testing.assert_array_equal(found["x"], x)
        np.testing.assert_allclose(solution.at(t)["f"], np.interp(t, time, -x), atol=1e-14)
    assert np.log2(errors[0] / errors[1]) > 3.7


def test_jumps_have_two_sides() -> None:
    """Free fall from 1 m, a bounce at t = 1 that turns the velocity round and halves it."""
    time = np.array([0.0, 0.5, 1.0, 1.5])
    g = -2.0
    x = Channel.smooth([1.0, 0.75, 0.0, 0.25], [1 - 0.0625, 1 - 0.5625, 0.25 - 0.0625])
    v = Channel(
        np.array([0.0, -1.0, -2.0, 0.0]), np.array([0.0, -1.0, 1.0, 0.0]), np.array([-0.5, -1.5, 0.5])
    )
    a = Channel.smooth([g] * 4, [g] * 3)
    solution = make("hermite-simpson", time, {("x", 0): x, ("x", 1): v, ("x", 2): a})
    assert solution["x'"][2] == 1.0
    assert solution.before["x'"][2] == -2.0
    assert solution.after["x'"][2] == 1.0
    assert solution.at(1.0)["x'"] == 1.0
    assert solution.at(1.0, side="before")["x'"] == -2.0
    assert solution.at(1.0 - 1e-13, side="before")["x'"] == pytest.approx(-2.0, abs=1e-12)
    assert solution.at(0.8)["x"] == pytest.approx(1 - 0.64, abs=1e-14)
    assert solution.at(1.2)["x"] == pytest.approx(0.2 - 0.04, abs=1e-14)
    assert solution.at_frame(2.4)["x"] == pytest.approx(0.2 - 0.04, abs=1e-14)
    assert list(solution.frames_that_jump()) == [2]
    assert set(solution.before) == {"x", "x'", "x''"}


def test_what_links_leave_over_is_spread_so_that_frames_are_met() -> None:
    time = np.array([0.0, 1.0])
    x, v = Channel.smooth([0.0, 5.0], [2.0]), Channel.smooth([1.0, 1.0], [1.0])
    solution = make("hermite-simpson", time, {("x", 0): x, ("x", 1): v})
    assert solution.at(0.5)["x"] == pytest.approx(2.5)
    assert solution.at(1.0)["x"] == 5.0


def test_shapes_of_at_follow_the_argument() -> None:
    time = np.linspace(0, 1, 5)
    solution = make("trapezoidal", time, {("x", 0): Channel.smooth(time)}, parameters={"T": 2.0})
    scalar = solution.at(0.3)
    assert scalar == {"x": pytest.approx(0.3), "T": 2.0}
    assert isinstance(scalar["x"], float)
    assert np.shape(solution.at([[0.1, 0.2], [0.3, 0.4]])["x"]) == (2, 2)
    assert solution.at([])["x"].shape == (0,)


def test_a_single_frame_is_a_motion_too() -> None:
    solution = make("central", np.array([0.0]), {("x", 0): Channel.smooth([3.0])})
    assert solution.n == 0
    assert solution.at(0.0)["x"] == 3.0


@pytest.mark.parametrize("t", [-0.1, 1.1, float("nan")])
def test_times_outside_the_motion_are_refused(t: float) -> None:
    solution = make("central", np.linspace(0, 1, 5), {("x", 0): Channel.smooth(np.zeros(5))})
    with pytest.raises(UsageError, match=r"outside of the motion, 0 to 1 s"):
        solution.at(t)
    with pytest.raises(UsageError, match="outside of the motion, 0 to 4"):
        solution.at_frame(4 * t)


def test_a_motion_ends_when_it_is_stated_to_end() -> None:
    """To the last bit, so that other programs accept its times as times of the motion."""
    for n, duration in ((100, 4.0), (30, 0.3), (7, 1.0)):
        spec = f"constants: n = {n}, T = {duration}, h = T/n; variables: x; constraints: x'' = 1; [0]: x; x';"
        assert stc.load(spec).solve(method="trapezoidal").time[-1] == duration


def test_unknown_names_offer_the_nearest() -> None:
    time = np.linspace(0, 1, 5)
    orders = of_polynomial(Polynomial([1.0]), 1, time, mid=False) | {("hip", 0): Channel.smooth(time)}
    solution = make("central", time, orders, parameters={"mass": 2.0})
    with pytest.raises(UnknownNameError) as caught:
        solution["hipp"]
    assert str(caught.value) == "the solution of test has no hipp; did you mean hip?"
    with pytest.raises(KeyError, match=r"no such derivative is used \(it has x, x'\)"):
        solution["x''"]
    with pytest.raises(UnknownNameError, match="mass is a parameter"):
        solution["mass'"]
    assert solution["mass"] == 2.0
    assert "hip" in solution
    assert "mass" in solution
    assert "x'" in solution
    assert "x''" not in solution
    assert solution.variables == ["x", "hip"]


def test_contradictions_are_found_when_a_solution_is_made() -> None:
    time = np.linspace(0, 1, 5)
    good = {("x", 0): Channel.smooth(time)}
    with pytest.raises(SolutionError, match="at least one number"):
        make("central", np.zeros((2, 2)), {})
    with pytest.raises(SolutionError, match="unknown method 'euler'"):
        make("euler", time, good)
    with pytest.raises(SolutionError, match="x has no values at the midpoints"):
        make("hermite-simpson", time, good)
    with pytest.raises(SolutionError, match="x has values at midpoints, which central does not know"):
        make("central", time, {("x", 0): Channel.smooth(time, np.zeros(4))})
    with pytest.raises(SolutionError, match=r"x has \(4,\) values on 5 frames"):
        make("central", time, {("x", 0): Channel.smooth(np.zeros(4))})
    with pytest.raises(SolutionError, match="without the derivative below"):
        make("central", time, {("x", 1): Channel.smooth(time)})


def test_a_failed_solve_may_leave_steps_without_length(tmp_path: Path) -> None:
    """It can be kept, read and resampled by frames; only asking for a time makes no sense."""
    text = (
        "constants: n = 2, g = 1; variables: x; parameters: T; definitions: h = T - i; constraints: x' = g;"
    )
    problem, transcription = stc.load(text).transcription("trapezoidal")
    x = np.array([1.0, 0.0, 2.0, 0.0, 4.0, 0.0, 0.0])
    result = Result(Status.FAILED, x, np.zeros(3), np.zeros(7), *[float("nan")] * 3, 0, 0, "")
    collect(transcription, result, problem.constants, {}, {}).save(tmp_path / "a.npz")
    again = read(tmp_path / "a.npz")
    assert list(again.time) == [0.0, 0.0, -1.0]
    np.testing.assert_allclose(again.at_frame([0.0, 1.0, 2.0])["x"], [1.0, 2.0, 4.0])
    with pytest.raises(SolutionError, match=r"time does not increase .* step 0 takes 0 s"):
        again.at(0.0)
    assert make("central", np.array([0.0, np.nan]), {}).n == 1


def test_where_forces_are_determined() -> None:
    time = np.linspace(0, 1, 9)
    quartic = Polynomial([0, 0, 0, 0, 1.0])
    assert make("central", time, of_polynomial(quartic, 1, time, mid=False)).force_frames == (0, 8)
    assert make("central", time, of_polynomial(quartic, 2, time, mid=False)).force_frames == (1, 7)
    assert make("central", time, of_polynomial(quartic, 4, time, mid=False)).force_frames == (2, 6)
    assert make("trapezoidal", time, of_polynomial(quartic, 2, time, mid=False)).force_frames == (0, 8)
    held = Channel.smooth(time).held_outside(1, 7)
    np.testing.assert_array_equal(held.after, [time[1], *time[1:8], time[7]])


def test_it_prints_on_one_line() -> None:
    solution = make("central", np.linspace(0, 1, 5), {("x", 0): Channel.smooth(np.zeros(5))}, objective=1 / 3)
    assert repr(solution) == "<Solution of test: optimal, central, n = 4, 1 s, objective 0.333333333>"


RICH = """# Größe, 'quoted', "double", back\\slash
constants: n = 6, g = 9.8, h = 0.1;
variables: x, f; parameters: T;
{jumps}
constraints:
  x'*x'*T = f;   # a "statement"
  f <= g;
  [n]: T*x[0] = x;
objective: integral(f^2);
replay: model = "particle.xml"; joint x = x; set body.particle.mass = T;
"""


def rich_solution(method: str) -> Solution:
    """A solution with everything in it: jumps, replay lines, multipliers, odd numbers and letters."""
    rng = np.random.default_rng(7)
    jumps = "" if method == "central" else "jumps: [2]: x';"
    problem, transcription = stc.load(RICH.format(jumps=jumps)).transcription(method, g=9.75)
    size = transcription.layout.size
    result = Result(
        status=Status.ITERATION_LIMIT,
        x=rng.normal(size=size) * 10.0 ** rng.integers(-100, 100, size),
        row_multipliers=rng.normal(size=transcription.row_count),
        bound_multipliers=rng.normal(size=size),
        objective=1 / 7,
        violation=float("nan"),
        optimality=1e-12,
        iterations=3,
        factorizations=4,
        message="stopped\nafter two",
    )
    return collect(transcription, result, problem.constants, {"g": 9.75}, {"solve": 0.25})


def assert_equal(a: object, b: object) -> None:
    """Deep equality, bit by bit."""
    assert type(a) is type(b)
    if isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    elif isinstance(a, dict) and isinstance(b, dict):
        assert list(a) == list(b)
        for key in a:
            assert_equal(a[key], b[key])
    elif isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        assert len(a) == len(b)
        for left, right in zip(a, b, strict=True):
            assert_equal(left, right)
    elif hasattr(a, "__slots__") and not isinstance(a, (str, int, float)):
        for slot in a.__slots__:
            assert_equal(getattr(a, slot), getattr(b, slot))
    else:
        assert a == b or (a != a and b != b)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_files_keep_every_bit(tmp_path: Path, method: str, suffix: str) -> None:
    solution = rich_solution(method)
    path = tmp_path / f"a{suffix}"
    solution.save(path)
    solution.save(path)  # over itself
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    again = read(path)
    assert [(file.role, file.path) for file in again.files] == [("model", "particle.xml")]
    again.files = solution.files  # found when it was saved
    assert_equal(again, solution)


def test_a_csv_reads_as_a_table(tmp_path: Path) -> None:
    rich_solution("hermite-simpson").save(tmp_path / "a.csv")
    rows = [line for line in (tmp_path / "a.csv").read_text().splitlines() if not line.startswith("#")]
    assert rows[0] == "node,x,x',f"
    kinds = [row.split(",")[0] for row in rows[1:]]
    assert kinds == ["frame", "mid", "frame", "mid", "before", "after", "mid", *["frame", "mid"] * 3, "frame"]


def test_names_and_missing_files_are_explained(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"ends in \.npz or \.csv"):
        rich_solution("central").save(tmp_path / "a.txt")
    with pytest.raises(UsageError, match="there is no solution file"):
        read(tmp_path / "none.npz")
    with pytest.raises(UsageError, match=r"ends in \.npz or \.csv"):
        read(tmp_path / "none")


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_damaged_files_are_told_from_good_ones(tmp_path: Path, suffix: str) -> None:
    solution = rich_solution("trapezoidal")
    path = tmp_path / f"a{suffix}"
    solution.save(path)
    whole = path.read_bytes()
    for content in (b"", b"nonsense", whole[: len(whole) // 2], whole[:200]):
        path.write_bytes(content)
        with pytest.raises(SolutionError, match=r"solution file|damaged"):
            read(path)


def test_altered_and_newer_files_are_refused(tmp_path: Path) -> None:
    solution, path = rich_solution("trapezoidal"), tmp_path / "a.csv"
    solution.save(path)
    path.write_text(path.read_text().replace("constants: n = 6", "constants: n = 5", 1))
    with pytest.raises(SolutionError, match="does not match its hash"):
        read(path)
    archive = tmp_path / "a.npz"
    solution.save(archive)
    with np.load(archive) as found:
        arrays = dict(found)
    facts = json.loads(arrays["facts"].tobytes())

    def refused(message: str, more: dict[str, object], **told: object) -> None:
        text = np.frombuffer(json.dumps({**facts, **told}).encode(), dtype=np.uint8)
        np.savez(archive, **{**arrays, "facts": text, **more})  # type: ignore[arg-type]
        with pytest.raises(SolutionError, match=message):
            read(archive)

    refused("states 5 steps, its text 6", {}, n=5)
    refused("states 6 steps and has 2", {"unknowns/x": np.zeros(3)})
    refused("no numbers that are not finite", {"unknowns/x": np.full(7, np.nan)}, status="optimal")
    refused("holds replay/0, which does not belong to this solution", {"replay/0": np.zeros(3)})
    refused("its unknowns are x, x'; its text states", {}, unknowns=facts["unknowns"][:2])
    refused("x has two values at frame 3", {}, unknowns=[{"name": "x", "after": [3]}, *facts["unknowns"][1:]])
    refused("multipliers/0 has 2 numbers where there are 6", {"multipliers/0": np.zeros(2)})
    block = {"kind": "row", "label": "y = 1"}
    refused("multipliers of `y = 1`, which its text", {}, multipliers=[block, *facts["multipliers"][1:]])
    refused("several motions", {}, trials=["one", "other"])
    content = arrays["files/0"].copy()
    content[7] ^= 1
    refused(r"particle\.xml, which it contains, does not match its hash", {"files/0": content})
    other_text = facts["source"].replace("variables: x,", "variables: y,")
    digest = hashlib.sha256(other_text.encode()).hexdigest()
    refused("this version cannot read its text", {}, source=other_text, sha256=digest)
    refused("format 99, written by stc .* install a newer stc", {}, format=99)
    other = tmp_path / "b.npz"
    np.savez(other, a=np.zeros(3))
    with pytest.raises(SolutionError, match="not a solution file"):
        read(other)


def test_a_solution_that_its_text_does_not_state_is_not_saved(tmp_path: Path) -> None:
    by_hand = make("central", np.linspace(0, 1, 5), {("x", 0): Channel.smooth(np.zeros(5))})
    with pytest.raises(UsageError, match="the solution of test cannot be saved"):
        by_hand.save(tmp_path / "a.npz")
    assert not (tmp_path / "a.npz").exists()


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solution, path = rich_solution("central"), tmp_path / "a.npz"
    solution.save(path)
    old = path.read_bytes()

    def full_disk(*_: object, **__: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("stc.npz.save", full_disk)
    with pytest.raises(OSError, match="no space"):
        solution.save(path)
    assert path.read_bytes() == old
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_the_folder_of_a_spec_is_where_its_relative_path_led(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "rest.stc").write_text("constants: n = 2; variables: x; constraints: x = 1;")
        monkeypatch.chdir(tmp_path / name)
        assert stc.load("rest.stc").solve().directory == str((tmp_path / name).resolve())
