"""Sums over the rows of a data set: what they are, whatever the method, and how parameters follow from them."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import stc
from stc.cli.main import run
from stc.errors import Source, SpecError, UsageError
from stc.language import read_problem
from stc.language.show import show_problem
from stc.pipeline import Model
from stc.solution_claims import judge
from stc.studies.uncertainty import uncertainty
from stc.transcription import transcribe

METHODS = ("central", "trapezoidal", "hermite-simpson")

SWING = """
constants: n = 12, T = 3, h = T/n;
variables: q, u;
parameters: k;
data: walk = (time, q, v, weight): (0, 0.9, 0.1, 1), (0.31, 0.8, -1.0, 2), (0.33, 0.7, -1.1, 1), (0.75, 0.1, -1.9, 1),
  (1.6, -0.9, 0.1, 3), (2.99, 0.7, 1.3, 1), (3, 0.8, 1.2, 1);
constraints: [0, n]: q'' = -k*q + u; -0.3 <= u <= 0.3;
objective:
  [walk]: walk.weight*(q - walk.q)^2;
  [walk]: 0.1*(q' - walk.v)^2 + 0.001*t*q^2;
  [0, n]: integral(0.01*u^2);
guess: k = 4; q = cos(2*t);
"""


@pytest.mark.parametrize("method", METHODS)
def test_a_row_reads_the_curve_that_the_solution_is_read_off(method: str) -> None:
    solution = Model(Source("swing.stc", SWING)).solve(method=method)
    assert solution.status == "optimal"
    time = np.array([0, 0.31, 0.33, 0.75, 1.6, 2.99, 3])
    measured = np.array([0.9, 0.8, 0.7, 0.1, -0.9, 0.7, 0.8])
    rates = np.array([0.1, -1.0, -1.1, -1.9, 0.1, 1.3, 1.2])
    motion = solution.at(time)
    misfit = np.array([1, 2, 1, 1, 3, 1, 1]) @ (motion["q"] - measured) ** 2
    misfit += np.sum(0.1 * (motion["q'"] - rates) ** 2 + 0.001 * time * motion["q"] ** 2)
    u = solution.channel("u")
    h = 0.25
    if u.mid is None:
        effort = h * (np.sum(u.before**2) - (u.before[0] ** 2 + u.before[-1] ** 2) / 2)
    else:
        effort = h / 6 * np.sum(u.before[:-1] ** 2 + 4 * u.mid**2 + u.before[1:] ** 2)
    assert solution.objective == pytest.approx(misfit + 0.01 * effort, rel=1e-9)


TOP = """<mujoco><worldbody><body name="top"><joint name="turn" type="ball" damping="0.1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.2 0.3 0.4"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("method", METHODS)
def test_an_orientation_is_read_off_its_curve_too(method: str, tmp_path: Path) -> None:
    (tmp_path / "top.xml").write_text(TOP, encoding="utf-8")
    spec = tmp_path / "top.stc"
    spec.write_text(
        """constants: n = 16, T = 1, h = T/n; model: "top.xml";
        data: d = (time, q, w): (0.11, 0.1, 1.9), (0.4, 0.3, 1.8), (0.77, 0.5, 1.6);
        constraints: [0]: joint.turn.qw = 1; joint.turn.qx; joint.turn.qy; joint.turn.qz;
        objective: [d]: (joint.turn.qx - d.q)^2; 0.1*(joint.turn.wx - d.w)^2;
        guess: joint.turn.wx = 2;""",
        encoding="utf-8",
    )
    solution = stc.load(spec).solve(method=method)
    assert solution.status == "optimal"
    motion = solution.at([0.11, 0.4, 0.77])
    misfit = (motion["joint.turn.qx"] - [0.1, 0.3, 0.5]) ** 2
    misfit += 0.1 * (motion["joint.turn.wx"] - [1.9, 1.8, 1.6]) ** 2
    # Under central differences the rate of an angular velocity is one of the quaternion's: alike to second order.
    assert solution.objective == pytest.approx(misfit.sum(), rel=1e-3 if method == "central" else 1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_derivatives_on_rows_agree_with_differences(method: str) -> None:
    model = Model(Source("swing.stc", SWING))
    problem, transcription = model.transcription(method)
    bound = transcription.bind(problem.constants)
    rng = np.random.default_rng(3)
    x = bound.x0 + 0.1 * rng.standard_normal(bound.n)
    direction = rng.standard_normal(bound.n)
    step = 1e-5
    gradient, _, hessian = (part.copy() for part in bound.derivatives(x, np.zeros(bound.m), 1.0))
    ahead, behind = bound.values(x + step * direction)[0], bound.values(x - step * direction)[0]
    assert gradient @ direction == pytest.approx((ahead - behind) / (2 * step), rel=1e-7)
    dense = np.zeros((bound.n, bound.n))
    np.add.at(dense, (bound.hess_rows, bound.hess_cols), hessian)
    dense += np.tril(dense, -1).T
    slopes = [bound.derivatives(x + s * direction, np.zeros(bound.m), 1.0)[0].copy() for s in (step, -step)]
    assert dense @ direction == pytest.approx((slopes[0] - slopes[1]) / (2 * step), rel=1e-6, abs=1e-6)


def test_empty_cells_are_left_out_row_by_row_for_each_term(tmp_path: Path) -> None:
    (tmp_path / "d.csv").write_text("time,a,b\n0,1,\n1,,5\n2,3,7\n", encoding="utf-8")
    spec = tmp_path / "s.stc"
    spec.write_text(
        """constants: n = 0; parameters: p, q;
        data: d = "d.csv";
        objective: [d]: (p - d.a)^2; (q - d.b)^2 + (p - d.a)^2;""",
        encoding="utf-8",
    )
    solution = stc.load(spec).solve()
    assert solution.parameters["p"] == pytest.approx((1 + 3 + 3) / 3)
    assert solution.parameters["q"] == pytest.approx(7)


TRIALS = """
constants: n = 40, T = 2, h = T/n;
for k in 1..3: { data: trial{k} = "trial{k}.csv"; }
variables: for k in 1..3: q{k};
parameters: c, w, for k in 1..3: a{k};
constraints: for k in 1..3: { [0, n]: q{k}'' = -w*q{k} - c*q{k}'; [0]: q{k} = a{k}; q{k}' = 0; }
objective: for k in 1..3: [trial{k}]: (q{k} - trial{k}.q)^2;
guess: c = 0.2; w = 8; for k in 1..3: { a{k} = {k}; q{k} = {k}*cos(3*t); }
method: hermite-simpson;
"""


def test_trials_of_one_body_share_its_parameters_and_have_the_errors_of_a_dense_fit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    times = [np.sort(rng.uniform(0, 2, 15)) for _ in range(3)]

    def motion(c: float, w: float, a: float, at: np.ndarray) -> np.ndarray:
        turns = np.sqrt(w - c**2 / 4)  # let go at a, at rest
        swing = np.cos(turns * at) + c / (2 * turns) * np.sin(turns * at)
        return np.asarray(a * np.exp(-c * at / 2) * swing)

    measured = [motion(0.3, 9.0, k + 1.0, at) + 0.05 * rng.standard_normal(15) for k, at in enumerate(times)]
    for k in range(3):
        lines = [f"{t!r},{q!r}" for t, q in zip(times[k].tolist(), measured[k].tolist())]
        (tmp_path / f"trial{k + 1}.csv").write_text("time,q\n" + "\n".join(lines) + "\n", encoding="utf-8")
    spec = tmp_path / "trials.stc"
    spec.write_text(TRIALS, encoding="utf-8")
    model = stc.load(spec)
    solution = model.solve(tolerance=1e-10)
    found = uncertainty(model, solution)
    dense = least_squares(
        lambda p: np.concatenate([motion(p[0], p[1], p[2 + k], times[k]) - measured[k] for k in range(3)]),
        [0.2, 8.0, 1, 2, 3],
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
        jac="3-point",
    )
    assert list(solution.parameters.values()) == pytest.approx(dense.x.tolist(), rel=1e-5)
    assert found.freedom == 45 - 5
    variance = 2 * dense.cost / 40
    covariance = variance * np.linalg.inv(dense.jac.T @ dense.jac)
    assert found.covariance == pytest.approx(covariance, rel=1e-4, abs=1e-9)


def test_a_saved_estimate_is_judged_and_solved_on_from_without_its_file(tmp_path: Path) -> None:
    data = tmp_path / "d.csv"
    data.write_text("time,x\n0,1\n0.7,0.55\n1.4,0.2\n", encoding="utf-8")
    spec = tmp_path / "s.stc"
    spec.write_text(
        """constants: n = 20, T = 2, h = T/n; parameters: c; variables: x;
        data: for k in 1..1: d{k} = "d.csv";
        constraints: [0, n]: x' = -c*x; [0]: x = 1;
        objective: [d1]: (x - d1.x)^2; guess: c = 1; x = exp(-t); method: hermite-simpson;""",
        encoding="utf-8",
    )
    solution = stc.load(spec).solve()
    solution.save(tmp_path / "s.npz")
    data.unlink()
    again = stc.read(tmp_path / "s.npz")
    claims = judge(again)
    assert any(claim.name == "objective" for claim in claims.claims)
    assert not claims.findings, claims.findings
    again.objective *= 1.01
    assert any("objective" in finding for finding in judge(again).findings)
    assert again.resolve(T=2.2).parameters["c"] == pytest.approx(solution.parameters["c"], rel=1e-5)


def test_a_bound_that_holds_a_parameter_takes_its_error_away() -> None:
    spec = """constants: n = 0; parameters: a, b;
    data: d = (x, y): (0, 1), (1, 3), (2, 4), (3, 8);
    constraints: b <= 1;
    objective: [d]: (a + b*d.x - d.y)^2;"""
    model = Model(Source("line.stc", spec))
    solution = model.solve()
    found = uncertainty(model, solution)
    assert found.errors["b"] == 0.0 and found.freedom == 3
    rest = np.array([1, 3, 4, 8]) - np.arange(4)
    assert solution.parameters["a"] == pytest.approx(rest.mean())
    assert found.errors["a"] == pytest.approx(rest.std(ddof=1) / 2)


def test_what_the_data_do_not_determine_has_no_finite_error() -> None:
    spec = """constants: n = 0; parameters: a, b, c;
    data: d = (x, y): (0, 1), (1, 3), (2, 4), (3, 8), (4, 9);
    objective: [d]: (a + b + c*d.x - d.y)^2;"""
    solution = Model(Source("line.stc", spec)).solve()
    found = solution.uncertainty()
    assert found.errors["a"] == found.errors["b"] == np.inf
    # The slope is determined nevertheless, as by a line with one constant.
    rows = np.column_stack([np.ones(5), np.arange(5.0)])
    slope = np.linalg.inv(rows.T @ rows)[1, 1] ** 0.5
    assert found.errors["c"] == pytest.approx(found.deviation * slope, rel=1e-6)


def test_a_constraint_that_is_stated_twice_takes_no_error_away() -> None:
    spec = """constants: n = 0; parameters: a, b, c;
    data: d = (x, y): (0, 1), (1, 3), (2, 4), (3, 8), (4, 9);
    constraints: a = b; 2*a = 2*b;
    objective: [d]: (a + b + c*d.x - d.y)^2;"""
    found = Model(Source("line.stc", spec)).solve().uncertainty()
    rows = np.column_stack([np.full(5, 2.0), np.arange(5.0)])
    expected = found.deviation * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert [found.errors["a"], found.errors["c"]] == pytest.approx(expected.tolist(), rel=1e-6)


@pytest.mark.parametrize(
    ("objective", "parts"),
    [
        ("[d]: integral((x - d.x)^2);", ("over time, not over rows", "leave `integral` out")),
        ("[d]: (x[i+1] - d.x)^2;", ("`x[i + 1]` belongs to a frame", "write `x`")),
        ("[d]: (x - d.x)^2*i;", ("no index `i`", "column of `d`")),
        ("[d]: (x - d.y)^2;", ("`y`", "its columns are `time`, `x`")),
        ("[d]: (x' - d.x')^2;", ("no time derivative",)),
        ("[d]: e^2;", ("`d.x` as a function of time", "under `[d]:` itself")),
        ("[walk]: (x - walk.x)^2;", ("`walk` is not declared", 'under `data:`, as in `walk = "walk.csv";`')),
        ("[lat]: (x - late.x)^2;", ("`lat` is not declared", "did you mean `late`?")),
        ("[late]: (x - late.x)^2;", ("at t = 5 s", "from 0 to 1 s")),
        ("[untimed]: (x - untimed.x)^2;", ("no column `time`",)),
        ("[0, n]: x^2; constraints: [d]: x = d.x;", ("only the objective is a sum over its rows",)),
        ("[0, n]: x^2; guess: [d]: x = 1;", ("only the objective is a sum over its rows",)),
    ],
)
def test_mistakes_are_told_with_what_to_do(objective: str, parts: tuple[str, ...]) -> None:
    spec = f"""constants: n = 4, h = 1/4; variables: x;
    data: d = (time, x): (0, 1), (0.6, 3); late = (time, x): (0, 1), (5, 3); untimed = (x, y): (0, 1), (5, 3);
    definitions: e = x - d.x;
    constraints: [0, n]: x' = -x;
    objective: {objective}"""
    with pytest.raises(SpecError) as caught:
        transcribe(read_problem(Source("a.stc", spec)))
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_times_of_measurements_are_known_so_that_steps_are_not_free() -> None:
    spec = """constants: n = 4; parameters: T; variables: x; definitions: h = T/n;
    data: d = (time, x): (0, 1), (0.6, 3);
    constraints: [0, n]: x' = -x; T >= 1;
    objective: [d]: (x - d.x)^2; guess: T = 1;"""
    with pytest.raises(SpecError, match="depends on `T`"):
        Model(Source("a.stc", spec)).solve()


def test_rows_find_their_steps_anew_where_a_constant_moves_the_frames() -> None:
    spec = """constants: n = 20, T = 2, h = T/n; parameters: c; variables: x;
    data: d = (time, x): (0, 1), (0.7, 0.55), (1.4, 0.2);
    constraints: [0, n]: x' = -c*x; [0]: x = 1;
    objective: [d]: (x - d.x)^2; guess: c = 1; x = exp(-t);
    method: hermite-simpson;"""
    model = Model(Source("a.stc", spec))
    one, other = model.solve(), model.solve(T=3.1)
    assert one.parameters["c"] == pytest.approx(other.parameters["c"], rel=1e-5)


def test_the_problem_is_shown_with_its_rows() -> None:
    assert "[walk]: walk.weight*(q - walk.q)^2" in show_problem(read_problem(Source("s.stc", SWING)))


def test_standard_errors_are_printed_and_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = tmp_path / "line.stc"
    spec.write_text(
        """parameters: a, b; data: d = (x, y): (0, 1), (1, 3), (2, 4), (3, 8);
        objective: [d]: (a + b*d.x - d.y)^2;""",
        encoding="utf-8",
    )
    slope_error = np.sqrt(
        1.8 / 2 / 5
    )  # sum of squares 1.8, spread of x 5: the closed form of a straight line
    assert run(["solve", str(spec), "-o", str(tmp_path / "line.npz")]) == 0
    assert f"2.2, standard error {slope_error:.5g}" in capsys.readouterr().out
    assert run(["solve", str(spec), "-o", str(tmp_path / "line.npz"), "--json"]) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])["estimation"]
    assert record["degrees_of_freedom"] == 2
    assert record["standard_errors"]["b"] == pytest.approx(slope_error)


@pytest.mark.parametrize(
    ("objective", "reason"),
    [
        ("[d]: (a + b*d.x - d.y)^2; [0]: a^2;", "`a^2` is not a square on the rows"),
        ("[d]: exp(a + b*d.x - d.y) - a;", "is not a square on the rows"),
        ("[few]: (a + b*few.x - few.y)^2;", "2 residuals for 2 unknowns"),
    ],
)
def test_where_there_are_no_standard_errors_the_reason_is_told(objective: str, reason: str) -> None:
    spec = f"""parameters: a, b; data: d = (x, y): (0, 1), (1, 3), (2, 4), (3, 8); few = (x, y): (0, 1), (1, 3);
    constraints: -9 <= b <= 9; -9 <= a <= 9; objective: {objective}"""
    solution = Model(Source("line.stc", spec)).solve()
    assert solution.status == "optimal"
    with pytest.raises(UsageError, match=re.escape(reason)):
        solution.uncertainty()


@pytest.mark.parametrize(
    ("kinked", "expected"),
    [
        ("abs(a - d.y)", 2.0),  # the median
        ("max(a - d.y, 3*(d.y - a))", 10.0),  # the third quartile, of few numbers the largest
        ("-min(a - d.y, d.y - a)", 2.0),
    ],
)
def test_a_kink_on_rows_is_rounded_as_the_message_says(kinked: str, expected: float) -> None:
    text = (
        "parameters: a; data: d = (y): (1), (2), (10); constants: e = 1e-4; guess: a = 1; objective: [d]: {};"
    )
    with pytest.raises(SpecError) as caught:
        stc.load(text.format(kinked)).problem()
    (diagnostic,) = caught.value.diagnostics
    rounded = diagnostic.hint.split("`")[1]
    start, end = kinked.index("m") if "m" in kinked else 0, kinked.rindex(")") + 1
    solved = stc.load(text.format(kinked[:start] + rounded + kinked[end:])).solve()
    assert solved.status == "optimal"
    assert solved["a"] == pytest.approx(expected, abs=1e-2)
