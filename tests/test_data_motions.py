"""Motions that are made with data: against closed forms, finite differences, SciPy, MuJoCo, and what was recorded."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import stc
from stc import specs
from stc.errors import SolutionError, SpecError
from stc.solution import Solution
from stc.solution_claims import judge

PENDULUM = """
constants: n = 40, T = 1.5, h = T/n, k = 3;
variables: q, u;
{data}
constraints:
  [0, n]: q'' = -k*{sine} + u;
  [0]: q = 0; q';
  [n]: q = 1.5; q';
objective: [0, n]: integral(u^2);
method: hermite-simpson;
"""


def saved_spec(folder: Path, text: str, name: str = "motion") -> Path:
    path = folder / f"{name}.stc"
    path.write_text(text, encoding="utf-8")
    return path


def table_of_sine(folder: Path, count: int, name: str = "sine.csv") -> str:
    """A file of a sine at uneven places, and the declaration of the table."""
    rng = np.random.default_rng(count)
    at = np.linspace(-1.0, 4.0, count) + rng.uniform(-0.3, 0.3, count) * 5.0 / count
    rows = [f"{x!r},{y!r}" for x, y in zip(at.tolist(), np.sin(at).tolist(), strict=True)]
    (folder / name).write_text("x,y\n" + "\n".join(rows))
    return f'data: d = "{name}"; S = table(d.x, d.y);'


def test_a_table_of_the_sine_is_a_sine(tmp_path: Path) -> None:
    exact = stc.load(PENDULUM.format(data="", sine="sin(q)")).solve()
    path = saved_spec(tmp_path, PENDULUM.format(data=table_of_sine(tmp_path, 60), sine="S(q)"))
    solved = stc.load(path).solve()
    assert solved.status == "optimal"
    assert solved.objective == pytest.approx(exact.objective, rel=1e-4)
    np.testing.assert_allclose(solved["q"], exact["q"], atol=1e-4)
    assert not judge(solved).faults
    assert not solved.outside


def test_derivatives_are_those_of_differences(tmp_path: Path) -> None:
    data = table_of_sine(tmp_path, 17) + " t2 = (a, b, c): (0, 0, 1), (0, 2, 3), (3, 0, -1), (3, 2, 0);"
    data += " H = table(t2.a, t2.b, t2.c);"
    path = saved_spec(tmp_path, PENDULUM.format(data=data, sine="(S(q)*u + H(q, u)^2)"))
    program = stc.load(path, n=4).transcription()[1].bind()
    rng = np.random.default_rng(0)
    x, y = program.x0 + rng.uniform(0.1, 1.0, program.n), rng.normal(size=program.m)
    _, jac, hess = (part.copy() for part in program.derivatives(x, y, 0.7))
    dense, curved = np.zeros((program.m, program.n)), np.zeros((program.n, program.n))
    dense[program.jac_rows, program.jac_cols] = jac
    curved[program.hess_rows, program.hess_cols] = hess
    curved = curved + np.tril(curved, -1).T
    step = 1e-6

    def slope(at: np.ndarray) -> np.ndarray:
        gradient, rows, _ = (part.copy() for part in program.derivatives(at, y, 0.7))
        lagrangian = 0.7 * gradient
        np.add.at(lagrangian, program.jac_cols, rows * y[program.jac_rows])
        return lagrangian

    for k in range(program.n):
        ahead, behind = x.copy(), x.copy()
        ahead[k] += step
        behind[k] -= step
        rows = (program.values(ahead)[1].copy() - program.values(behind)[1].copy()) / (2.0 * step)
        np.testing.assert_allclose(dense[:, k], rows, atol=1e-6)
        np.testing.assert_allclose(curved[:, k], (slope(ahead) - slope(behind)) / (2.0 * step), atol=1e-6)


def test_other_numbers_need_no_other_program(tmp_path: Path) -> None:
    tapes = []
    for count in (20, 900):
        folder = tmp_path / str(count)
        folder.mkdir()
        path = saved_spec(folder, PENDULUM.format(data=table_of_sine(folder, count), sine="S(q)"))
        tapes.append([tape.digest() for tape in stc.load(path).transcription()[1].tapes])
    assert tapes[0] == tapes[1]


@pytest.mark.parametrize(
    ("option", "word"), [("", "continues linearly"), (", outside = hold", "keeps its last value")]
)
def test_use_outside_is_told(option: str, word: str, tmp_path: Path) -> None:
    data = f"data: d = (x, y): (-1, -1), (0, 0), (1, 1); S = table(d.x, d.y){option};"
    solved = stc.load(saved_spec(tmp_path, PENDULUM.format(data=data, sine="S(q)"))).solve()
    (told,) = solved.outside
    assert "`S` is from -1 to 1" in told
    assert "farthest at frame 40 (1.5)" in told
    assert word in told


def test_a_table_without_values_outside_keeps_the_motion_inside(tmp_path: Path) -> None:
    text = """
constants: n = 20, T = 1, h = T/n;
variables: x, u;
data: d = (x, y): (0, 0), (1, 1), (2, 4); F = table(d.x, d.y), outside = error;
constraints: [0, n]: x' = u; [0]: x = 0.5;
objective: [0, n]: integral((F(x) - 9)^2 + 0.01*u^2);
guess: x = 1;
method: trapezoidal;
"""
    solved = stc.load(saved_spec(tmp_path, text)).solve()
    assert solved["x"].max() <= 2.0 + 1e-9
    with pytest.raises(stc.StcError, match="no value"):
        stc.load(saved_spec(tmp_path, text.replace("x = 0.5", "x = 2.5"), "beyond")).solve()


FOLLOWED = """
constants: n = 60, T = 2, h = T/n, w = 1e-7;
variables: x, y, u, v;
data: walk = "walk.csv";
constraints: [0, n]: x'' = u; y'' = v;
objective: [0, n]: integral((x - walk.x)^2 + (y - walk.y)^2 + w*(u^2 + v^2));
guess: walk;
method: hermite-simpson;
"""


def recorded(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times that are nobody's frames, and two columns, the second one with a gap and cut at its ends."""
    time = np.linspace(-0.03, 2.05, 37)
    x, y = np.sin(2.0 * time), np.cos(3.0 * time)
    y[:4] = y[15:22] = y[-3:] = np.nan
    columns = [column.tolist() for column in (time, x, y)]
    rows = [f"{t!r},{a!r},{'' if b != b else repr(b)}" for t, a, b in zip(*columns, strict=True)]
    (folder / "walk.csv").write_text("time,x,y\n" + "\n".join(rows))
    return time, x, y


def test_a_recording_is_followed_where_it_has_numbers(tmp_path: Path) -> None:
    time, _, y = recorded(tmp_path)
    solved = stc.load(saved_spec(tmp_path, FOLLOWED)).solve()
    assert solved.status == "optimal"
    np.testing.assert_allclose(solved["x"], np.sin(2.0 * solved.time), atol=2e-3)
    known = np.isfinite(y)
    inside = np.interp(solved.time, time, known.astype(float)) == 1.0
    np.testing.assert_allclose(solved["y"][inside], np.cos(3.0 * solved.time)[inside], atol=2e-2)
    # Over the gap nothing pulls: the least acceleration between the two ends is a cubic, whose force is a line.
    gap = (solved.time > time[14] + 0.05) & (solved.time < time[22] - 0.05)
    assert gap.sum() > 5
    assert np.abs(np.diff(solved["v"][gap], 2)).max() < 1e-3 * np.abs(solved["v"][gap]).max()
    assert not judge(solved).faults


def test_a_motion_that_lasts_longer_than_its_recording_is_told(tmp_path: Path) -> None:
    recorded(tmp_path)
    assert not stc.load(saved_spec(tmp_path, FOLLOWED)).solve().outside[1:]
    told = stc.load(saved_spec(tmp_path, FOLLOWED)).solve(T=3.0).outside
    assert any("`walk.x` is recorded from -0.03 to 2.05 s" in each and "(3 s)" in each for each in told)


def test_the_objective_counts_the_known_stretches(tmp_path: Path) -> None:
    time, _, y = recorded(tmp_path)
    text = FOLLOWED.replace("(x - walk.x)^2 + (y - walk.y)^2 + w*(u^2 + v^2)", "(y - walk.y)^2")
    text = text.replace("x'' = u; y'' = v;", "x'' = u; y = 3*t; u = 0; v = 0; x = 0;").replace(
        "n = 60", "n = 2000"
    )
    solved = stc.load(saved_spec(tmp_path, text)).solve()
    total = 0.0
    for first, last in ((4, 14), (22, 33)):
        spline = CubicSpline(time[first : last + 1], y[first : last + 1])
        at = np.linspace(time[first], time[last], 20_001)
        total += float(np.trapezoid((3.0 * at - spline(at)) ** 2, at))
    assert solved.objective == pytest.approx(total, rel=2e-3)


def test_a_recording_is_a_guess_by_one_word(tmp_path: Path) -> None:
    time, x, y = recorded(tmp_path)
    model = stc.load(saved_spec(tmp_path, FOLLOWED))
    problem, transcription = model.transcription()
    x0 = transcription.guess(problem.constants)
    frames = np.linspace(0.0, 2.0, 61)
    channels = transcription.recovery(x0).trajectories()
    np.testing.assert_allclose(channels["x", 0].before, CubicSpline(time, x)(frames), atol=1e-9)
    known = np.isfinite(y)
    bridged = np.interp(frames, time[known], y[known])
    gap = (frames > time[14]) & (frames < time[22])
    np.testing.assert_allclose(channels["y", 0].before[gap], bridged[gap], atol=1e-9)


def test_a_column_with_every_other_number_is_a_guess_and_is_summed(tmp_path: Path) -> None:
    """Two sensors in one file, each with a number on every other row, and one number alone between two gaps."""
    lines = [f"{k / 20},{k**2},\n{k / 20 + 0.02},,{3 * k}" for k in range(40)]
    (tmp_path / "walk.csv").write_text("time,x,y\n" + "\n".join(lines))
    model = stc.load(
        saved_spec(tmp_path, FOLLOWED.replace("[0, n]: integral(", "[walk]: ((y - walk.y)^2); #"))
    )
    problem, transcription = model.transcription()
    channels = transcription.recovery(transcription.guess(problem.constants)).trajectories()
    frames = np.linspace(0.0, 2.0, 61)
    numbers = np.arange(40)
    np.testing.assert_allclose(
        channels["x", 0].before, np.interp(frames, numbers / 20, numbers**2), atol=1e-9
    )
    np.testing.assert_allclose(
        channels["y", 0].before, np.interp(frames, numbers / 20 + 0.02, 3 * numbers), atol=1e-9
    )
    with pytest.raises(SpecError, match=r"`walk.x` has no two consecutive numbers") as caught:
        stc.load(saved_spec(tmp_path, FOLLOWED)).problem()
    assert "sum over its rows instead, as in `[walk]: (x - walk.x)^2;`" in str(caught.value)


def test_statements_at_every_frame_want_numbers_there(tmp_path: Path) -> None:
    recorded(tmp_path)
    text = FOLLOWED.replace("y'' = v;", "y'' = v; x = walk.x; y <= walk.y + 1;")
    with pytest.raises(SpecError, match=r"`walk.y` has a gap at t = ") as caught:
        stc.load(saved_spec(tmp_path, text)).problem()
    assert len(caught.value.diagnostics) == 1
    unknown = text.replace("T = 2, ", "").replace("variables:", "parameters: T;\nvariables:")
    unknown = unknown.replace("h = T/n", "S = 1").replace(
        "variables:", "definitions: h = T/n;\nvariables:", 1
    )
    with pytest.raises(
        SpecError, match=r"`walk.y` has gaps, and this statement needs a number at every frame"
    ):
        stc.load(saved_spec(tmp_path, unknown)).problem()
    fine = FOLLOWED.replace("y'' = v;", "y'' = v; x = walk.x;")
    solved = stc.load(saved_spec(tmp_path, fine)).solve()
    np.testing.assert_allclose(solved["x"], np.sin(2.0 * solved.time), atol=1e-4)


@pytest.mark.parametrize(
    ("statement", "frame", "instant"),
    [
        ("[9]: y = walk.y", 9, 0.3),
        ("[50]: y = walk.y[10]", 50, 1.0 / 3.0),
        ("[40, 45]: walk.y - 1e-9 <= y <= walk.y + 1e-9", 45, 1.5),
        ("[n]: y = walk.y[n - 20]", 60, 4.0 / 3.0),
    ],
)
def test_statements_may_read_a_column_with_gaps_where_it_has_numbers(
    statement: str, frame: int, instant: float, tmp_path: Path
) -> None:
    time, _, y = recorded(tmp_path)
    text = FOLLOWED.replace("y'' = v;", f"y'' = v;\n  {statement};\n  [0]: x = 0;")
    model = stc.load(saved_spec(tmp_path, text))
    solved = model.solve()
    assert solved.status == "optimal"
    run = slice(4, 15) if instant < 0.9 else slice(22, 34)
    assert solved["y"][frame] == pytest.approx(CubicSpline(time[run], y[run])(instant), abs=1e-7)
    if statement.startswith("[9]"):  # another duration puts the frame into the gap
        with pytest.raises(SpecError, match=r"`walk\.y` has a gap at t = 1 s"):
            model.solve(T=20.0 / 3.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("guess: walk;", "guess: wlk;"), "did you mean `walk`?"),
        (("guess: walk;", "guess: x;"), "`x` is a variable"),
        (("time,x,y", "t,x,y"), "`walk.x` is a column of numbers"),
        (("time,x,y", "time,a,b"), "has no column `x`"),
        (("\n-0.03,", "\n,"), "`walk.time` has no number on line 2 of `walk.csv`"),
        (("\n-0.03,", "\n0.9,"), "`walk.time` is less than before on line 3 of `walk.csv`"),
    ],
)
def test_mistakes_in_recordings(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    recorded(tmp_path)
    table = (tmp_path / "walk.csv").read_text()
    (tmp_path / "walk.csv").write_text(table.replace(*change))
    with pytest.raises(SpecError) as caught:
        stc.load(saved_spec(tmp_path, FOLLOWED.replace(*change))).problem()
    assert message in str(caught.value)


@pytest.fixture
def kept(tmp_path: Path) -> tuple[Path, Solution]:
    """A saved motion whose folder has lost its data since."""
    recorded(tmp_path)
    text = FOLLOWED.replace("y'' = v;", "y'' = v - S(y);")
    text = text.replace("variables:", table_of_sine(tmp_path, 30) + "\nvariables:")
    solved = stc.load(saved_spec(tmp_path, text)).solve()
    solved.save(tmp_path / "kept.npz")
    solved.save(tmp_path / "kept.csv")
    (tmp_path / "walk.csv").unlink()
    (tmp_path / "sine.csv").write_text("x,y\n-1,0\n5,1\n")
    return tmp_path, solved


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_solution_carries_its_data(suffix: str, kept: tuple[Path, Solution]) -> None:
    folder, solved = kept
    again = stc.read(folder / f"kept{suffix}")
    np.testing.assert_array_equal(again["y"], solved["y"])
    claims = judge(again)
    assert not claims.faults
    (note,) = claims.notes
    assert note.startswith("sine.csv has changed since")
    assert next(claim.recomputed for claim in claims.claims if claim.name == "objective") == pytest.approx(
        solved.objective
    )
    resolved = again.resolve()
    assert resolved.status == "optimal"
    assert resolved.objective == pytest.approx(solved.objective, rel=1e-6)
    again.save(folder / f"again{suffix}")
    assert [file.path for file in stc.read(folder / f"again{suffix}").data] == ["sine.csv", "walk.csv"]


def altered(folder: Path, change: str) -> Path:
    """The saved file with something about its data changed."""
    archive = dict(np.load(folder / "kept.npz"))
    facts = json.loads(archive["facts"].tobytes())
    (first, other) = facts["files"]
    if change == "content":
        archive["files/0"] = archive["files/0"].copy()
        archive["files/0"][-3] ^= 1
    elif change == "missing":
        del facts["files"][1], archive["files/1"]
    elif change == "hash alone":
        other["carried"] = False
        del archive["files/1"]
    elif change == "role":
        first["role"] = "part"
    else:
        first["path"] = "another.csv"
    archive["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    np.savez(folder / "altered.npz", **archive)
    return folder / "altered.npz"


@pytest.mark.parametrize("change", ["content", "missing", "hash alone", "role", "path"])
def test_altered_data_is_refused(change: str, kept: tuple[Path, Solution]) -> None:
    with pytest.raises(SolutionError):
        stc.read(altered(kept[0], change))


DRAG = """
constants: n = 40, T = 1, h = T/n, m = 1;
variables: x, z, fx, fz;
data: drag = (v, f): (-6, -9), (-3, -2.5), (-1, -0.6), (0, 0), (1, 0.6), (3, 2.5), (6, 9);
  D = table(drag.v, drag.f);
constraints:
  [0, n]: m*x'' = fx - D(x'); m*z'' = fz - 9.81*m - D(z');
  [0]: x; z; x'; z';
  [n]: x = 1; z = 1; x'; z';
objective: [0, n]: integral(fx^2 + fz^2);
method: hermite-simpson;
replay:
  model = "particle.xml";
  joint x = x; joint z = z;
  actuator fx = fx; actuator fz = fz;
  apply joint.x = -D(x'); apply joint.z = -D(z');
  set body.particle.mass = m;
  set option.gravity.z = -9.81;
"""


def test_mujoco_repeats_a_motion_with_a_table_in_it(tmp_path: Path) -> None:
    from stc.validate import validate

    stc.load(saved_spec(tmp_path, DRAG)).solve().save(tmp_path / "drag.npz")
    report = validate(tmp_path / "drag.npz")
    assert report.passed, report.to_text()


def test_the_bundled_flight_keeps_to_the_measured_ground() -> None:
    folder = Path(specs.__file__).parent
    x, height = np.loadtxt(folder / "particle_terrain.csv", delimiter=",", skiprows=2, unpack=True)
    solved = stc.load("particle_terrain").solve()
    assert solved.status == "optimal"
    above = solved["y"] - CubicSpline(x, height)(solved["x"])
    assert above.min() == pytest.approx(0.1, abs=1e-7)
    assert above.max() == pytest.approx(0.25, abs=1e-7)
    # Less room costs more, and without a limit above the ground is passed in a gentler arc.
    assert solved.objective > stc.load("particle_terrain").solve(low=np.inf).objective + 1.0
