"""What each heuristic of the solver is worth: it is switched off, and all collections are solved again.

    python bench/ablation.py run [--off NAME,NAME+NAME|all] [--only kinds,fresh] [--fast 0.5] [--results FILE]
    python bench/ablation.py table

A result is one line of JSON in FILE, so that a run that was stopped goes on where it was.  The first run,
with nothing off, tells how long each problem takes; later ones leave out those that took longer than ``--fast``, and
those that were not solved.  Limits are of processor time, of one thread.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "STC_THREADS"):
    os.environ.setdefault(_name, "1")

import time  # noqa: E402

time.perf_counter = time.process_time  # limits of time are of this process's own

import argparse  # noqa: E402
import hashlib  # noqa: E402
import json  # noqa: E402
import math  # noqa: E402
import re  # noqa: E402
import runpy  # noqa: E402
import shutil  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from dataclasses import dataclass, field, replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from kinds import KINDS  # noqa: E402
from robots import ROBOTS  # noqa: E402

import stc  # noqa: E402
from stc.solver import Options, minimize  # noqa: E402
from stc.solving.fewer_frames import own_constants  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "out" / "ablation.jsonl"
LIMIT = 10.0
"""Seconds of processor time for one problem; MOTION_LIMIT for a motion of a whole robot."""
MOTION_LIMIT = 120.0
FRESH = 20_000
"""Seeds of kinds from here on are drawn for nothing else."""
WIDER = 0.02
SAME = 1e-4
LARGEST = 150
"""Frames of a random motion: larger ones are scaled down."""


@dataclass(frozen=True, slots=True)
class Case:
    """A problem: its collection, its name, its spec (a path or the text) and the constants given."""

    collection: str
    name: str
    spec: str
    constants: dict[str, float] = field(default_factory=dict)
    seed: int = 0

    @property
    def key(self) -> str:
        return f"{self.collection}/{self.name}"


def _files(collection: str, folder: str) -> Iterator[Case]:
    for path in sorted((ROOT / folder).glob("*.stc")):
        if path.stem not in ROBOTS:
            yield Case(collection, path.stem, str(path))


def _robots() -> Iterator[Case]:
    """Motions in space, most of them of whole robots; left out of the neighbours, which would take hours."""
    for name in ROBOTS:
        yield Case("robots", name, str(ROOT / "specs" / f"{name}.stc"))


def _random(collection: str, seed: int, each: int) -> Iterator[Case]:
    for kind in KINDS:
        for number in range(each):
            text = kind(np.random.default_rng([seed, number]))
            text = re.sub(r"\bn = (\d+)", lambda m: f"n = {min(int(m[1]), LARGEST)}", text)
            yield Case(collection, f"{kind.__name__}-{seed}-{number}", text)


def _neighbours(cases: list[Case]) -> Iterator[Case]:
    for k, case in enumerate(cases):
        rng = np.random.default_rng([7, k])
        model = stc.load(case.spec)
        try:
            problem = model.problem()
        except Exception:  # what is wrong with it is told elsewhere
            continue
        given = {
            name: float(problem.constants[name] * (1 + rng.uniform(0.01, 0.1) * rng.choice([-1, 1])))
            for name in own_constants(model.tree, {})
            if name not in problem.structural and np.ndim(problem.constants[name]) == 0
        }
        if given:
            yield Case("neighbours", f"{case.collection}-{case.name}", case.spec, given)


#: Limits are set as if variables moved by at least so much.
FLAT = 1e-3


def boxed(text: str, solution: stc.Solution, wider: float) -> str:
    """The spec with limits around a solution, farther out by so much of the way between them."""
    declared = re.search(r"variables:(.*?);", text, re.DOTALL)
    assert declared is not None
    limits = []
    for name in (word.strip() for word in declared[1].split(",")):
        values = np.asarray(solution[name])
        low, high = float(values.min()), float(values.max())
        out = wider * max(high - low, FLAT)
        limits.append(f"{low - out:.9g} <= {name} <= {high + out:.9g};")
    return text.replace("objective:", f"  [0, n]: {' '.join(limits)}\n    objective:", 1)


def _boxed(folder: Path, each: int) -> Iterator[Case]:
    folder.mkdir(parents=True, exist_ok=True)
    for case in _random("kinds", 3, each):
        file = folder / f"{case.name}.stc"
        if not file.exists():
            solution = stc.load(case.spec).solve(time_limit=LIMIT)
            file.write_text(boxed(case.spec, solution, WIDER) if solution.status == "optimal" else "")
        if file.stat().st_size:
            yield Case("boxed", case.name, file.read_text())


class Disguised:
    """A program in other units, or from another start: :class:`stc.solver.nlp.NLP`."""

    def __init__(self, nlp: Any, rng: np.random.Generator, units: bool) -> None:
        self.nlp = nlp
        self.n, self.m = nlp.n, nlp.m
        power = 3.0 if units else 0.0
        self.x_unit = 10.0 ** rng.uniform(-power, power, nlp.n)
        self.row_unit = 10.0 ** rng.uniform(-power, power, nlp.m)
        self.f_unit = 10.0 ** rng.uniform(-power, power)
        self.x_lower, self.x_upper = nlp.x_lower / self.x_unit, nlp.x_upper / self.x_unit
        self.row_lower, self.row_upper = nlp.row_lower * self.row_unit, nlp.row_upper * self.row_unit
        x0 = np.asarray(nlp.x0, float)
        if not units:
            moved = x0 + rng.standard_normal(nlp.n) * np.maximum(1.0, np.abs(x0))
            f, r = nlp.values(moved)
            x0 = moved if np.isfinite(f + r.sum()) else x0
        self.x0 = x0 / self.x_unit
        for name in ("jac_rows", "jac_cols", "hess_rows", "hess_cols", "var_stage", "row_stage", "row_linear",
                     "objective_degree", "fixed_curvature"):  # fmt: skip
            setattr(self, name, getattr(nlp, name))

    def values(self, x: Any) -> tuple[float, Any]:
        f, r = self.nlp.values(x * self.x_unit)
        return self.f_unit * f, self.row_unit * r

    def derivatives(self, x: Any, multipliers: Any, objective_factor: float) -> tuple[Any, Any, Any]:
        gradient, jac, hess = self.nlp.derivatives(
            x * self.x_unit, multipliers * self.row_unit, objective_factor * self.f_unit
        )
        units = self.x_unit
        return (
            self.f_unit * gradient * units,
            jac * self.row_unit[self.jac_rows] * units[self.jac_cols],
            hess * units[self.hess_rows] * units[self.hess_cols],
        )


def _disguised(collection: str, cases: list[Case], each: int) -> Iterator[Case]:
    for case in cases:
        for number in range(each):
            yield Case(collection, f"{case.name}-{number}", case.spec, case.constants, FRESH + number)


def all_cases(results: Path) -> list[Case]:
    static = [*_files("static", "tests/problems/nlp"), *_files("literature", "tests/problems/literature")]
    motions = [
        *_files("traj", "tests/problems/traj"),
        *_files("luxo", "tests/problems/luxo"),
        *_files("classics", "bench/classics"),
        *_files("bundled", "specs"),
    ]
    return [
        *static, *motions, *_neighbours(motions), *_random("kinds", 1, 6), *_boxed(results.parent / "boxed", 6),
        *_random("fresh", FRESH, 24), *_disguised("units", static, 2), *_disguised("starts", static, 3), *_robots(),
    ]  # fmt: skip


def limit_of(case: Case) -> float:
    """Seconds that a first solve of it may take."""
    return MOTION_LIMIT if case.collection == "robots" else LIMIT


def solved(case: Case, model: Any, limit: float) -> dict[str, Any]:
    """How the solve ends."""
    outcome: dict[str, Any] = {"case": case.key}
    try:
        if isinstance(model, Exception):
            raise model
        begin = time.process_time()
        if case.seed:
            problem, transcription = model.transcription()
            bound = transcription.bind(problem.constants)
            rng = np.random.default_rng([case.seed, bound.n])
            program = Disguised(bound, rng, case.collection == "units")
            solution = minimize(program, Options(time_limit=limit))
            solution = replace(
                solution, status=solution.status.value, objective=solution.objective / program.f_unit
            )
        else:
            solution = model.solve(time_limit=limit)
        outcome |= {
            "status": solution.status,
            "objective": solution.objective,
            "iterations": solution.iterations,
            "cpu": round(time.process_time() - begin, 4),
        }
    except Exception as error:  # a crash is a loss
        outcome |= {
            "status": f"{type(error).__name__}: {error}"[:200],
            "objective": None,
            "iterations": 0,
            "cpu": 0,
        }
    return outcome


#: A heuristic is switched off by a number that keeps it from acting: the module, its name there, and that number.  A
#: module that ends in ``.c`` or ``.h`` is a file of ``stc/core/iteration``.
PATCHES: dict[str, list[tuple[str, str, Any]]] = {
    "least_squares_start": [("starting", "least_squares_multipliers", lambda work: np.zeros(work.form.m))],
    "usual_curvature": [
        ("inertia_correction.c", "SMALLEST_CURVATURE", 1.0),
        ("inertia_correction.c", "LARGEST_CURVATURE", 1.0),
    ],
    "convex_shift": [("step.c", "SHARE", 1e300)],
    "lengthen": [("line_search.c", "LONGER", 1.0)],
    "short_no_reduction": [("step.c", "SHORT_STEP", 0.0)],
    "damped": [("newton_system", "UNKNOWN", 0)],
    "untried": [("inertia_correction.c", "MOST_UNTRIED", 0)],
    "coarse_solves": [("inertia_correction.c", "SMALL_VIOLATION", 1e300)],
    "stiffen": [("interior", "SHORT", 0.0)],
    "short_steps": [("progress.c", "MOST_SHORT_STEPS", 10**9)],
    "traub": [("active_set.c", "CORRECTIONS", 0)],
    "second_order_correction": [("line_search.c", "MOST_CORRECTIONS", 0)],
    "finish": [("active_set", "NEAR", 0.0)],
    "by_gaps": [("formulation", "MANY_GAPS", 10**9)],
    "rescale_at_solution": [("sqp", "RESCALINGS", 1)],
    **{
        f"strategy: {name}": [("sqp", "LEFT_OUT", frozenset({name}))]
        for name in (
            "rescaled",
            "feasibility first",
            "least violation",
            "perturbed start",
            "best feasible point",
        )
    },
}


def switch_off(names: set[str]) -> None:
    """In a process of its own, before anything was compiled or loaded that may be different."""
    from importlib import import_module

    in_core: list[tuple[str, str, Any]] = []
    for name in names:
        for module, attribute, value in PATCHES.get(name, []):
            if module.endswith((".c", ".h")):
                in_core.append((module, attribute, value))
                continue
            found = import_module(f"stc.solver.{module}")
            assert hasattr(found, attribute), (module, attribute)
            setattr(found, attribute, value)
    if in_core:
        from stc.core import library

        library.FOLDER = str(core_with(in_core))


def core_with(numbers: list[tuple[str, str, Any]]) -> Path:
    """The folder of a core compiled with other numbers; one that was made before serves again."""
    from stc.core.compiling import digest_of_sources

    key = hashlib.blake2b(f"{digest_of_sources()} {sorted(numbers)}".encode(), digest_size=8).hexdigest()
    folder = RESULTS.parent / "cores" / key
    core = folder / "core"
    if (folder / "made").exists():
        return core
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "stc" / "core", core, ignore=shutil.ignore_patterns("libcore_*", "__pycache__"))
    for file, name, value in numbers:
        path = core / "iteration" / file
        pattern = rf"(?P<before>^#define {name} |\b{name} = )[^\s,;}}]+"
        text, found = re.subn(pattern, rf"\g<before>{value!r}", path.read_text(), flags=re.MULTILINE)
        if not found:  # it comes from a header, and is another one in this file alone
            last = text.index("\n", text.rindex("#include")) + 1
            text = f"{text[:last]}#undef {name}\n#define {name} {value!r}\n{text[last:]}"
        path.write_text(text)
    runpy.run_path(str(core / "compiling.py"))["compile_libraries"](core, folder / "scratch")
    (folder / "made").touch()
    return core


def read(results: Path) -> dict[str, dict[str, dict[str, Any]]]:
    """By what was off, and by case."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    if results.exists():
        for line in results.read_text().splitlines():
            one = json.loads(line)
            found.setdefault(one["off"], {})[one["case"]] = one
    return found


def sweep(labels: list[str], results: Path, only: set[str], fast: float) -> None:
    """One label after the other, each a name or several joined by ``+``, or none; a process for each."""
    known = read(results)
    first = known.get("", {})
    models: dict[str, Any] = {}
    cases = [c for c in all_cases(results) if not only or c.collection in only]
    if first and labels != [""]:
        # What is not solved anyway takes most of the time, and can tell little.
        kept = {key for key, one in first.items() if one["cpu"] <= fast and one["status"] in GOOD}
        cases = [c for c in cases if c.key in kept]
    for label in labels:
        names = set(filter(None, label.split("+")))
        todo = [c for c in cases if c.key not in known.get(label, {})]
        for case in todo:
            if case.key not in models:
                try:
                    models[case.key] = model = stc.load(case.spec, **case.constants)
                    model.transcription()
                except Exception as error:
                    models[case.key] = error
        print(time.strftime("%H:%M:%S"), label, len(todo), flush=True)
        child = os.fork()
        if child == 0:
            switch_off(names)
            with results.open("a") as file:
                for case in todo:
                    file.write(
                        json.dumps(
                            {"off": label}
                            | solved(
                                case,
                                models[case.key],
                                limit_of(case) if label == "" else max(1.0, 6.0 * first[case.key]["cpu"]),
                            )
                        )
                        + "\n"
                    )
                    file.flush()
            os._exit(0)
        os.waitpid(child, 0)


def compare(base: dict[str, dict[str, Any]], other: dict[str, dict[str, Any]]) -> dict[str, Any]:
    lost, won, worse, better, ratios, times = [], [], [], [], [], []
    for key, one in other.items():
        if key not in base:
            continue
        before = base[key]
        good, now = before["status"] in GOOD, one["status"] in GOOD
        if good and (not now or before["status"] != one["status"]):
            lost.append(key)
        elif now and not good:
            won.append(key)
        elif now and before["status"] == "optimal":
            gap = (one["objective"] - before["objective"]) / max(1e-3, abs(before["objective"]))
            if gap > SAME:
                worse.append(key)
            elif gap < -SAME:
                better.append(key)
            else:
                ratios.append(math.log(max(one["iterations"], 1) / max(before["iterations"], 1)))
                times.append(math.log(max(one["cpu"], 1e-3) / max(before["cpu"], 1e-3)))
    mean = lambda logs: math.exp(sum(logs) / len(logs)) if logs else 1.0
    return {
        "run": len(other), "lost": lost, "won": won, "worse": worse, "better": better,
        "iterations": mean(ratios), "time": mean(times), "same": len(ratios),
    }  # fmt: skip


GOOD = {"optimal", "infeasible", "unbounded"}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["run", "table"])
    parser.add_argument(
        "--off", default="", help="labels, separated by commas: names, joined by + where together"
    )
    parser.add_argument("--only", default="")
    parser.add_argument("--fast", type=float, default=1e9, help="problems that took no longer, in seconds")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    options.results.parent.mkdir(parents=True, exist_ok=True)
    if options.what == "run":
        labels = options.off.split(",")
        if options.off == "all":
            labels = list(PATCHES)
        sweep(labels, options.results, set(filter(None, options.only.split(","))), options.fast)
    else:
        known = read(options.results)
        print("| off | run | lost | (fresh) | won | (fresh) | worse | better | iterations | time |")
        print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
        for name, results in known.items():
            if not name:
                continue
            c = compare(known.get("", {}), results)
            fresh = [sum(key.startswith("fresh") for key in c[k]) for k in ("lost", "won")]
            print(
                f"| {name} | {c['run']} | {len(c['lost'])} | {fresh[0]} | {len(c['won'])} | {fresh[1]} | "
                f"{len(c['worse'])} | {len(c['better'])} | {c['iterations']:.3f} | {c['time']:.2f} |"
            )


if __name__ == "__main__":
    main()
