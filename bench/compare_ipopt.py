"""Statuses, objectives and iterations side by side with CasADi + IPOPT, on the problems with known answers.

    python bench/compare_ipopt.py [FOLDER ...] [--only NAME ...] [--time-limit 60] [--write table.md]

Both get the very same nonlinear program from the same starting point with exact derivatives (see casadi_bridge).  A
folder holds specs and an ``expected.json``; the default ones are tests/problems/nlp, tests/problems/traj and
bench/classics.  Prints a Markdown table and a summary.  Needs the extra ``bench`` (CasADi).
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from casadi_bridge import ipopt

import stc
from stc.solver import Options, minimize

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = (ROOT / "tests/problems/nlp", ROOT / "tests/problems/traj", ROOT / "bench/classics")

#: What IPOPT calls the ends that have a word of ours.
WORDS = {
    "Solve_Succeeded": "optimal",
    "Solved_To_Acceptable_Level": "optimal",
    "Feasible_Point_Found": "optimal",
    "Infeasible_Problem_Detected": "infeasible",
    "Diverging_Iterates": "unbounded",
    "Maximum_Iterations_Exceeded": "iteration_limit",
    "Maximum_CpuTime_Exceeded": "time_limit",
    "Maximum_WallTime_Exceeded": "time_limit",
    "Not_Enough_Degrees_Of_Freedom": "refused",
}

HEAD = """# Against IPOPT

`python bench/compare_ipopt.py --write docs/ipopt.md` writes this page. It compares statuses, objectives and iterations
on problems with known answers. Both solvers get the same nonlinear programs, starting points and exact derivatives. The
known answer of a classic of optimal control is the better of the results that IPOPT and stc had found before. `(!)`
marks an answer that differs from the known one. IPOPT relaxes bounds and rows by 1e-8; its objectives can therefore be
lower in the last digits.
"""


@dataclass(frozen=True, slots=True)
class Ending:
    """How one solver ended on one problem."""

    status: str
    objective: float
    iterations: int
    seconds: float
    right: bool

    def cells(self) -> list[str]:
        objective = f"{self.objective:.8g}" if self.status == "optimal" else ""
        mark = "" if self.right else " (!)"
        return [self.status + mark, objective, str(self.iterations)]


def is_right(status: str, objective: float, expected: Mapping[str, Any]) -> bool:
    """Whether an ending is the known answer, or another that counts as right."""
    kind = expected.get("kind", "optimal")
    if status != kind:
        return False
    if kind != "optimal":
        return True
    known = [expected["objective"], *expected.get("other_local_minima", ()), *expected.get("also", ())]
    known = [float(one["objective"] if isinstance(one, dict) else one) for one in known if one is not None]
    tolerance = max(float(expected.get("tol", 1e-5)), 1e-6)
    errors = [(objective - value) / max(1.0, abs(value)) for value in known]
    # Motions may be better than the reference; static problems have no better point than the known ones.
    return any(abs(error) <= tolerance for error in errors) or ("kind" not in expected and errors[0] <= 0.0)


def run(path: Path, expected: Mapping[str, Any], time_limit: float) -> tuple[Ending, Ending]:
    """Our ending and IPOPT's."""
    import time

    problem, transcription = stc.load(path).transcription()
    bound = transcription.bind(problem.constants)
    if bound.contradictions:
        ours = Ending("infeasible", float("nan"), 0, 0.0, expected.get("kind") == "infeasible")
    else:
        begin = time.process_time()
        result = minimize(bound, Options(time_limit=time_limit))
        status = result.status.value
        ours = Ending(
            status,
            result.objective,
            result.iterations,
            time.process_time() - begin,
            is_right(status, result.objective, expected),
        )
    peer = ipopt(transcription.bind(problem.constants), max_cpu_time=time_limit)
    status = WORDS.get(peer.status, peer.status)
    iterations = 0 if status == "refused" else peer.iterations  # CasADi keeps the last solve's
    theirs = Ending(
        status, peer.objective, iterations, peer.seconds, is_right(status, peer.objective, expected)
    )
    return ours, theirs


def table(rows: list[tuple[str, Ending, Ending]]) -> str:
    """The Markdown table and its summary."""
    lines = [
        "| problem | stc | objective | iterations | IPOPT | objective | iterations |",
        "| --- | --- | ---: | ---: | --- | ---: | ---: |",
    ]
    for name, ours, theirs in rows:
        lines.append(f"| {name} | {' | '.join(ours.cells())} | {' | '.join(theirs.cells())} |")
    lines.append("")
    for who, endings in (("stc", [r[1] for r in rows]), ("IPOPT", [r[2] for r in rows])):
        right = [one for one in endings if one.right]
        iterations = statistics.median([one.iterations for one in right]) if right else float("nan")
        false = sum(one.status == "optimal" and not one.right for one in endings)
        lines.append(
            f"{who}: {len(right)} of {len(endings)} answers are right, with a median of {iterations:g} iterations; "
            f"{false} wrong answers have the status optimal."
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path, default=FOLDERS)
    parser.add_argument("--only", nargs="*", default=())
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--write", type=Path, help="also write the table to this file")
    options = parser.parse_args()
    parts = []
    for folder in options.folders:
        expected = json.loads((folder / "expected.json").read_text())
        rows = []
        for name, answer in sorted(expected.items()):
            path = folder / (name if name.endswith(".stc") else f"{name}.stc")
            if path.exists() and (not options.only or path.stem in options.only):
                rows.append((path.stem, *run(path, answer, options.time_limit)))
        parts.append(f"## {folder.name}\n\n{table(rows)}\n")
    text = "\n".join(parts)
    print(text)
    if options.write is not None:
        options.write.write_text(f"{HEAD}\n{text}")


if __name__ == "__main__":
    main()
