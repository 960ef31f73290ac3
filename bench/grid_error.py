"""The printed grid error against the true one: every trajectory solved again on eight times the frames.

    python -m bench.grid_error                      the classics and the trajectories of the tests; some ten minutes
    python -m bench.grid_error bench/classics       some folders or files
    python -m bench.grid_error --saved FOLDER       keeps both solutions of each there, and takes them from there

Prints a Markdown table and how often the estimate is right.  The true error of the objective is the change from the one
grid to the other, relative to the finer one; that of the motion the largest change of a variable that equations of
motion determine, at the same share of the frames, relative to its range.  Each finer solve starts from the coarser
solution, so that both are the same optimum where that is one on both grids.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import stc
from stc.errors import StcError
from stc.solution import Solution, read
from stc.solving.same_motion import check_same_motion
from stc.studies.doubled import apart
from stc.studies.effort import Clock, Effort
from stc.studies.finer import solve_finer
from stc.studies.frames import Spread
from stc.studies.grid_error import GROSS, GridError, determined, grid_error

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("bench/classics", *(f"tests/problems/{name}" for name in ("traj", "literature", "luxo", "speed")))
TIMES = 8
LIMIT = 90.0
"""Seconds for a finer solve."""
NOTHING = 1e-7
"""Errors below this share are rounding and what solves leave."""


@dataclass(frozen=True)
class Row:
    """One trajectory: its estimate, and what is true."""

    name: str
    method: str
    n: int
    estimate: GridError
    objective: float
    motion: float

    @property
    def true(self) -> float:
        return min(max(self.objective, self.motion), 1.0)

    @property
    def is_near(self) -> bool:
        """Whether the estimate is within a factor of ten."""
        largest = self.estimate.largest
        return max(largest, self.true) < NOTHING or 0.1 <= largest / max(self.true, 1e-300) <= 10.0

    def line(self) -> str:
        told = self.estimate
        warned = bool(told.warning)
        verdict = "" if warned == (self.true > GROSS) else "warned of" if warned else "not warned of"
        figures = (told.objective, self.objective, told.motion, self.motion)
        cells = [self.name, self.method, str(self.n), *(f"{figure:.1e}" for figure in figures)]
        return f"| {' | '.join(cells)} | {'' if self.is_near else 'no'} | {verdict} |"


def measured(path: Path, folder: Path | None) -> Row | str:
    """A row, or why there is none."""
    model = stc.load(path)
    if model.problem().n < 2:
        return "no motion"
    try:
        coarse = _kept(folder, f"{path.stem}-1", lambda: model.solve(time_limit=LIMIT))
        if coarse.status != "optimal":
            return f"{coarse.status} on its own grid"
        more = Spread.of(model, None, {}).multiplied(TIMES)
        options = {"constants": more}
        finer = _kept(
            folder,
            f"{path.stem}-{TIMES}",
            lambda: solve_finer(model.solve, coarse, options, Clock(LIMIT), Effort()),
        )
    except StcError as error:
        return str(error).splitlines()[0]
    if finer.status != "optimal":
        return f"{finer.status} on {TIMES} times the frames"
    told = grid_error(coarse)
    assert told is not None
    problem = model.problem()
    ends = np.array([0, problem.n])
    if check_same_motion(problem, model.problem(None, **more), ends, TIMES * ends) != 1.0:
        return "a sum over all frames is another objective on other frames"
    objective = abs(coarse.objective - finer.objective) / max(abs(finer.objective), 1e-9)
    motion = max(apart(coarse, finer, determined(problem, coarse)).values(), default=0.0)
    return Row(path.stem, coarse.method, coarse.n, told, objective if problem.objective else 0.0, motion)


def _kept(folder: Path | None, name: str, solve) -> Solution:  # type: ignore[no-untyped-def]
    file = None if folder is None else folder / f"{name}.npz"
    if file is not None and file.exists():
        return read(file)
    solution: Solution = solve()
    if file is not None:
        solution.save(file)
    return solution


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("specs", nargs="*", type=Path, default=[ROOT / name for name in FOLDERS])
    parser.add_argument("--saved", type=Path, help="folder for solutions")
    given = parser.parse_args()
    if given.saved is not None:
        given.saved.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    files = [file for one in given.specs for file in (sorted(one.glob("*.stc")) if one.is_dir() else [one])]
    rows, others = [], []
    print(
        "| trajectory | method | n | objective: estimated | true | motion: estimated | true "
        "| within a factor of ten | |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for file in files:
        found = measured(file, given.saved)
        if isinstance(found, Row):
            rows.append(found)
            print(found.line(), flush=True)
        elif found != "no motion":
            others.append(f"{file.stem}: {found}")
    print()
    gross = [row for row in rows if row.true > GROSS]
    fine = [row for row in rows if row.true <= GROSS]
    print(f"within a factor of ten: {sum(row.is_near for row in rows)} of {len(rows)}")
    print(f"gross and not warned of: {sum(not row.estimate.warning for row in gross)} of {len(gross)}")
    print(f"fine and warned of: {sum(bool(row.estimate.warning) for row in fine)} of {len(fine)}")
    for other in others:
        print(f"left out: {other}")


if __name__ == "__main__":
    main()
