"""Contact without a schedule: what is found from the guess and from random starts, and whether it is valid.

    python bench/free_contact.py [--starts 20] [--judged 20] [--only hops_free,step_free] [--write]

The pages ``docs/*_free.stc`` are solved from their own guess and from others, with three sine waves of up to 0.1 m or
rad each added to every coordinate.  What each solve finds is written as a schedule, solved to full order with more
frames, and validated in MuJoCo, which takes most of the time: only so many starts of each page are judged.  A start is
valid where all of that succeeds.  Times are those of the processor, of the free solve alone, with one thread.
``--write`` puts the table into docs/complementarity.md.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
import time
import warnings
from pathlib import Path
from statistics import median

import numpy as np

import stc
from stc.errors import StcError
from stc.scheduling import joint_coordinates, write_schedule
from stc.solution import Solution
from stc.validate import validate

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = DOCS / "complementarity.md"
#: With how many times as many frames the schedule of each page is solved.
FINER = {"lamp_free": 5}
USUAL = 2
WAVES, SIZE = 3, 0.1
VALID = "valid"
MOST = 1500
HEAD = """
| page | frames | unknowns | from the guess | CPU s | solved | within 150 | median | most | scheduled | valid |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def waves(rng: np.random.Generator, frames: int) -> np.ndarray:
    """A few sine waves over the motion, (frames,)."""
    s = np.linspace(0.0, np.pi, frames)
    found = np.zeros(frames)
    for k in range(1, WAVES + 1):
        found += SIZE * rng.uniform(-1.0, 1.0) * np.sin(k * s + rng.uniform(0.0, 2.0 * np.pi))
    return found


def scheduled(path: Path, rough: Solution, judged: bool) -> tuple[int, bool, str]:
    """Iterations with the schedule that was found, whether that is solved, and the verdict if it is ``judged``."""
    with tempfile.TemporaryDirectory() as folder:
        for model in path.parent.glob("*.xml"):
            shutil.copy(model, folder)
        try:
            write_schedule(rough, Path(folder) / "scheduled.stc")
            n = FINER.get(path.stem, USUAL) * rough.n
            solution = stc.load(Path(folder) / "scheduled.stc").solve(n=n, max_iterations=MOST)
        except StcError as error:
            return 0, False, f"no schedule: {error}"
        solved = solution.status == "optimal"
        if not (solved and judged):
            return solution.iterations, solved, "not judged" if solved else solution.status
        report = validate(solution)
        worst = [metric for metric in report.metrics if metric.verdict == "fail"]
        told = [
            *report.findings,
            *(f"{one.name}, {one.subject}: {one.value:.3g}, not {one.limit:.3g}" for one in worst),
        ]
        return solution.iterations, solved, VALID if report.passed else "; ".join(told)


def measured(path: Path, starts: int, judged: int) -> str:
    """A line of the table."""
    model = stc.load(path)
    guess = model.solve(max_iterations=0)
    names = joint_coordinates(model.problem())
    spent, times = [], []
    solved = finished = valid = quickly = 0
    for seed in range(starts):
        rng = np.random.default_rng(seed)
        off = {name: np.asarray(guess[name]) + waves(rng, guess.n + 1) for name in names} if seed else None
        begin = time.process_time()
        rough = model.solve(guess=off, max_iterations=MOST)
        times.append(time.process_time() - begin)
        spent.append(rough.iterations)
        found = rough.status == "optimal"
        iterations, done, verdict = (
            scheduled(path, rough, seed < judged) if found else (0, False, "not solved")
        )
        solved, finished, valid = solved + found, finished + done, valid + (verdict == VALID)
        quickly += found and rough.iterations <= 150
        print(
            f"  {path.stem} {seed}: {rough.status}, {rough.iterations}, {iterations}, {done}, {verdict}",
            flush=True,
        )
    return (
        f"| {path.stem} | {guess.n} | {guess.x.size} | {spent[0]} | {median(times):.2g} | {solved} of {starts} | "
        f"{quickly} | {median(spent):g} | {max(spent)} | {finished} | {valid} of {min(judged, starts)} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--judged", type=int, default=20, help="starts of each page that MuJoCo judges")
    parser.add_argument("--only", default="", help="pages, such as hops_free,step_free")
    parser.add_argument("--write", action="store_true", help="write the table into docs/complementarity.md")
    asked = parser.parse_args()
    only = set(filter(None, asked.only.split(",")))
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    warnings.simplefilter("ignore")
    table = HEAD
    for path in sorted(DOCS.glob("*_free.stc")):
        if not only or path.stem in only:
            line = measured(path, asked.starts, asked.judged)
            print(line, flush=True)
            table += line + "\n"
    if asked.write:
        put("free", table, PAGE)


if __name__ == "__main__":
    main()
