"""Programs with complementary pairs: how many are solved from many starts, in how many iterations, and how well.

    python bench/complementarity.py [--starts 20] [--only outrata31,block] [--as-rows] [--write]

Small programs of the MacMPEC collection with published optima, and motions with contact and friction that nobody
schedules (tests/problems/complementarity).  The first start of each is the spec's guess; the others are off it at
random, by up to 1 in each unknown of a program and 0.3 in each of a motion.  A start counts as solved where the status
is optimal and the smaller side of each pair at most 1e-6, relative to max(1, the larger one).  With ``--as-rows`` the
products are rows like others.  ``--write`` puts the table into docs/complementarity.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from statistics import geometric_mean, median

import numpy as np

import stc
from stc.solver import Options, Start
from stc.solver.pairs import Pairs
from stc.solver.sqp import minimize

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

ROOT = Path(__file__).resolve().parents[1]
PROBLEMS = ROOT / "tests" / "problems" / "complementarity"
PAGE = ROOT / "docs" / "complementarity.md"
NOISE = {"static": 1.0, "motions": 0.3}
MOST = 1500
HEAD = """
| | unknowns | pairs | iterations from the guess | solved | median | most | best objective | at it | published |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def measured(path: Path, starts: int, as_rows: bool, published: float | None) -> tuple[str, bool, list[int]]:
    """A line of the table, whether all starts were solved, and the iterations of each."""
    model = stc.load(str(path))
    problem, transcription = model.compiled(None, {}, at_once=True)
    program = transcription.bind(problem.constants)
    pairs = program.pairs
    if as_rows:
        program.pairs = Pairs.none()
    iterations, objectives = [], []
    for seed in range(starts):
        noise = np.random.default_rng(seed).uniform(-1.0, 1.0, program.n) * NOISE[path.parent.name]
        x0 = np.clip(program.x0 + (noise if seed else 0.0), program.x_lower, program.x_upper)
        result = minimize(program, Options(max_iterations=MOST), start=Start(x0))
        iterations.append(result.iterations)
        if result.success and pairs.residual(program, result.x) <= 1e-6:
            objectives.append(result.objective)
    best = min(objectives, default=np.nan)
    at_best = sum(f <= best + 1e-4 * max(1.0, abs(best)) for f in objectives)
    line = (
        f"| {path.stem} | {program.n} | {len(pairs)} | {iterations[0]} | {len(objectives)} of {starts} | "
        f"{median(iterations):g} | {max(iterations)} | {best:.6g} | {at_best} | "
        f"{'' if published is None else f'{published:g}'} |"
    )
    return line, len(objectives) == starts, iterations


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--only", default="", help="problems, such as outrata31,block")
    parser.add_argument("--as-rows", action="store_true", help="products are rows like others")
    parser.add_argument("--write", action="store_true", help="write the table into docs/complementarity.md")
    asked = parser.parse_args()
    only = set(filter(None, asked.only.split(",")))
    published = json.loads((PROBLEMS / "published.json").read_text())
    table = HEAD
    for folder in ("static", "motions"):
        spent, solved, count = [], 0, 0
        for path in sorted((PROBLEMS / folder).glob("*.stc")):
            if only and path.stem not in only:
                continue
            line, all_solved, iterations = measured(
                path, asked.starts, asked.as_rows, published.get(path.stem)
            )
            print(line, flush=True)
            table += line + "\n"
            solved += all_solved
            count += 1
            spent.append(median(iterations))
        if count:
            mean = f"geometric mean {geometric_mean(spent):.3g}"
            line = f"| all {folder} | | | | {solved} of {count} from every start | {mean} | | | | |"
            print(line, flush=True)
            table += line + "\n"
    if asked.write:
        put("measured", table, PAGE)


if __name__ == "__main__":
    main()
