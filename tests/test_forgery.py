"""Solution files that were altered in one place, every hash recomputed: whatever it moves is named.

The oracle is not the judge.  What an alteration moves is evaluated by the compiled program that the solver uses, and
held against the tolerances that the verdict prints.
"""

from __future__ import annotations

import functools
import json
from pathlib import Path

import forgery
import numpy as np
import pytest
from forgery import Forger, told, written

import stc
from stc.certification import certify
from stc.solution import Solution, read
from stc.solution_claims import judge
from stc.solver.residuals import assess
from stc.validate import limits, validate

#: Ten motions: every method, jumps, parameters, changed constants, clipped ends, another optimizer, more frames.
FILES = {
    "waypoints": ("particle_waypoints", {}),
    "waypoints-central": ("particle_waypoints", {"method": "central", "n": 24}),
    "waypoints-trapezoidal": ("particle_waypoints", {"method": "trapezoidal", "g": 1.62}),
    "waypoints-witkin-kass": ("particle_waypoints", {"optimizer": "witkin-kass", "n": 12, "m": 3}),
    "waypoints-slsqp": ("particle_waypoints", {"optimizer": "nlopt:slsqp", "method": "central", "n": 8}),
    "jet": ("particle_jet", {}),
    "reach": ("arm_reach", {"method": "trapezoidal"}),
    "pole": ("cart_pole_swing_up", {}),
    "flip": ("segment_flip", {"method": "central"}),
    "swing": ("segment_swing", {}),
}


@functools.cache
def solved(name: str) -> Solution:
    spec, given = FILES[name]
    solution = stc.load(spec).solve(**given)  # type: ignore[arg-type]
    assert solution.status == "optimal"
    return solution


@pytest.fixture(params=FILES)
def motion(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / f"{request.param}.npz"
    solved(request.param).save(path)
    return path


def moved(path: Path) -> bool:
    """Whether the compiled program finds a quantity of a file well beyond the tolerance that is printed for it."""
    solution = read(path)
    problem, transcription = stc.load(solution.source).transcription(solution.method, **solution.overrides)
    # Started there, since what nothing determines (forces at frames without equations) may be anything.
    bound = transcription.bind(problem.constants, start=solution.x, check=False)
    found = assess(bound, solution.x, solution.row_multipliers, solution.bound_multipliers)
    claimed = {claim.name: claim for claim in judge(solution).claims}
    off = abs(found.objective - solution.objective) > 2.0 * claimed["objective"].tolerance
    pairs = ((found.violation, solution.violation), (found.optimality, solution.optimality))
    for new, old in pairs:
        allowed = limits.CLAIMED_ERROR + limits.CLAIMED_ERROR_SHARE * max(new, old)
        off |= not abs(new - old) <= 2.0 * allowed
    return bool(off or not found.violation <= limits.VIOLATION or not found.optimality <= limits.KKT_RESIDUAL)


def require_named(path: Path, count: int | None, seed: int) -> None:
    """Alters arrays and claims, ``count`` of each or all of them."""
    assert told(path) == []
    forger = Forger(path, seed)
    target = path.with_name("forged.npz")

    def chosen(places: list) -> list:
        if count is None or len(places) <= count:
            return places
        return [places[k] for k in sorted(forger.rng.choice(len(places), count, replace=False))]

    named = 0
    silent: list[object] = []
    arrays = chosen(forger.arrays())
    for name in arrays:
        written(*forger.with_array(name), target)
        found = told(target)
        named += bool(found)
        if not found and moved(target):
            silent.append(name)
    assert named >= 0.7 * len(arrays)  # what is altered by little, of what matters little, moves nothing
    for place in chosen(forger.claims()):
        members, facts = forger.with_claim(place)
        written(members, facts, target)
        if place[0] in forgery.OWN_WORDS:
            continue
        value = forger.facts
        for key in place:
            value = value[key]
        if place[0] in ("violation", "optimality") and abs(value) < 0.1 * limits.CLAIMED_ERROR:
            continue  # nothing beside the tolerance, whatever it is multiplied by
        if not told(target):
            silent.append(place)
    assert silent == []


@pytest.mark.daily_every(2)
def test_what_is_altered_is_named(motion: Path) -> None:
    require_named(motion, 8, seed=1)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_whatever_is_altered_is_named(motion: Path, seed: int) -> None:
    require_named(motion, None, seed)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_facts_of_another_kind_are_refused_in_a_sentence(tmp_path: Path, suffix: str) -> None:
    """Whatever stands where something else is expected: no traceback, and nothing that passes for it."""
    path = tmp_path / f"a{suffix}"
    stc.load("particle_waypoints").solve(n=4, method="trapezoidal").save(path)
    stc.load("particle_waypoints").solve(n=4, method="trapezoidal").save(tmp_path / "b.npz")
    forger = Forger(tmp_path / "b.npz", 0)
    whole = path.read_text().split("\n", 1)[1] if suffix == ".csv" else ""
    places = [*forger.claims(), *((key,) for key in forger.facts)]
    others = (None, [], {}, "x\x1b", -1, 1e308, float("nan"), True, [[]], {"a": 1})
    for k, place in enumerate(places):
        for other in (others[k % 10], others[(3 * k + 4) % 10]):
            _, facts = forger.with_claim(place, other)
            if suffix == ".csv":
                path.write_text(f"# facts {json.dumps({**facts, 'rows': 5})}\n{whole}")
            else:
                written(dict(forger.members), facts, path)
            told(path)  # raises what is no message


def test_text_that_states_another_motion_is_named(tmp_path: Path) -> None:
    """A waypoint elsewhere, another objective, another constant: each with a hash that fits."""
    path = tmp_path / "a.npz"
    solved("waypoints").save(path)
    forger = Forger(path, 0)
    for old, new, wanted in (
        ("y1 = 0.8", "y1 = -3.0", "`y = y1` at frame 15 is missed by 3.8: 0.8 where -3 is the bound"),
        ("integral(x''^2 + y''^2)", "integral(x''^2 + 2*y''^2)", "objective: the solution says 180.82"),
        ("g = 9.8", "g = 9.9", "constant g: the solution says 9.8, its text and numbers give 9.9"),
    ):
        members, facts = forger.with_text(old, new)
        if "y1" in old:
            facts["constants"]["y1"] = -3.0
        assert any(wanted in line for line in told(written(members, facts, tmp_path / "b.npz")))
    members, facts = forger.with_text("# frames are", "# the frames are")
    assert told(written(members, facts, tmp_path / "b.npz")) == []


def test_what_does_not_hold_is_the_headline(tmp_path: Path) -> None:
    """In words that name quantity, claim, what it is, and where it is stated; the replay alone would pass."""
    path = tmp_path / "a.npz"
    solved("waypoints").save(path)
    assert validate(path).passed
    forger = Forger(path, 0)
    members, facts = dict(forger.members), {**forger.facts, "objective": 1.0}
    certificate = certify(written(members, facts, tmp_path / "b.npz"), equations=False)
    assert not certificate.passed
    assert certificate.headline == (
        "objective: the solution says 1, its text and numbers give 180.822857 (tolerance 1.8e-07): "
        "particle_waypoints.stc:34:11: `integral(x''^2 + y''^2)`"
    )
    assert all(metric.verdict != "fail" for metric in certificate.report.metrics)
    facts = {**forger.facts, "iterations": 12345, "optimizer": "by hand"}
    report = validate(written(members, facts, tmp_path / "b.npz"))
    assert report.passed
    words = dict(report.claims.words)
    assert "12345" in words["iterations"] and words["optimizer"] == "by hand"


@pytest.mark.parametrize("name", ["max_iterations", "time_limit"])
def test_a_solve_that_was_stopped_says_so_and_is_believed(name: str, tmp_path: Path) -> None:
    given = {"max_iterations": 3} if name == "max_iterations" else {"time_limit": 1e-9}
    solution = stc.load("cart_pole_swing_up").solve(**given)  # type: ignore[arg-type]
    assert solution.status in ("iteration_limit", "time_limit")
    solution.save(tmp_path / "a.npz")
    assert judge(read(tmp_path / "a.npz")).findings == []
    forger = Forger(tmp_path / "a.npz", 0)
    written(dict(forger.members), {**forger.facts, "status": "optimal"}, tmp_path / "a.npz")
    assert any(
        "is missed by" in line or "says that it is optimal" in line for line in told(tmp_path / "a.npz")
    )


def test_numbers_agree_with_the_compiled_program(motion: Path) -> None:
    """The judge's own evaluation, against the kernels that the solver uses."""
    solution = read(motion)
    problem, transcription = stc.load(solution.source).transcription(solution.method, **solution.overrides)
    bound = transcription.bind(problem.constants)
    rng = np.random.default_rng(5)
    solution.x = solution.x + 1e-3 * rng.normal(size=len(solution.x))
    solution.row_multipliers = solution.row_multipliers + rng.normal(size=len(solution.row_multipliers))
    found = assess(bound, solution.x, solution.row_multipliers, solution.bound_multipliers)
    judged = judge(solution)
    assert judged.violation == pytest.approx(found.violation, rel=1e-9)
    assert judged.optimality == pytest.approx(found.optimality, rel=1e-9)
    assert judged.claims[0].recomputed == pytest.approx(found.objective, rel=1e-12)
