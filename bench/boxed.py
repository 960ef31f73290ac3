"""Motions between limits hardly wider than a known one needs: how many are found, and how many called infeasible.

    python bench/boxed.py [--seeds 1,2,3] [--each 4] [--wider 0.02,0.1] [--only acrobot,rods] [--ipopt] [--list]

A random motion of every kind (see kinds.py) is solved; then every variable gets limits, the least and the largest that
it was, farther out by a share of the way between them.  So all of these can be met.  With ``--ipopt`` IPOPT gets the
same programs (needs the extra ``bench``).
"""

from __future__ import annotations

import argparse
import re
import warnings
from collections import Counter
from collections.abc import Iterator

import numpy as np
from kinds import KINDS, Kind

import stc

FLAT = 1e-3
"""Limits are set as if variables moved by at least so much."""
TIME_LIMIT = 20.0


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


def motions(kinds: list[Kind], seed: int, each: int) -> Iterator[tuple[str, str, stc.Solution]]:
    """Random motions that are found: name, spec, solution."""
    for kind in kinds:
        for number in range(each):
            text = kind(np.random.default_rng([seed, number]))
            solution = stc.load(text).solve(time_limit=TIME_LIMIT)
            if solution.status == "optimal":
                yield kind.__name__, text, solution


def by_ipopt(text: str) -> str:
    """How IPOPT ends on a spec."""
    from casadi_bridge import ipopt
    from compare_ipopt import WORDS

    problem, transcription = stc.load(text).transcription()
    status = ipopt(transcription.bind(problem.constants), max_cpu_time=TIME_LIMIT).status
    return WORDS.get(status, status)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--wider", default="0.02,0.1")
    parser.add_argument("--only", help="kinds, separated by commas")
    parser.add_argument("--ipopt", action="store_true")
    parser.add_argument("--list", action="store_true", help="every motion that is not found, with its spec")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    kinds = [kind for kind in KINDS if not options.only or kind.__name__ in options.only.split(",")]
    shares = [float(share) for share in options.wider.split(",")]
    ends: dict[str, Counter[str]] = {kind.__name__: Counter() for kind in kinds}
    for seed in map(int, options.seeds.split(",")):
        for name, text, solution in motions(kinds, seed, options.each):
            for wider in shares:
                spec = boxed(text, solution, wider)
                status = stc.load(spec).solve(time_limit=TIME_LIMIT).status
                ends[name][status] += 1
                if options.ipopt:
                    ends[name]["found by IPOPT"] += by_ipopt(spec) == "optimal"
                if status != "optimal" and options.list:
                    print(f"# {name}, seed {seed}, {wider} wider: {status}\n{spec}")
    print("| kind | motions | found | infeasible | other |" + (" found by IPOPT |" if options.ipopt else ""))
    print("| --- | ---: | ---: | ---: | ---: |" + (" ---: |" if options.ipopt else ""))
    ends["all"] = sum(ends.values(), Counter())
    for name, counts in ends.items():
        found, infeasible, others = counts["optimal"], counts["infeasible"], counts["found by IPOPT"]
        count = counts.total() - others
        line = f"| {name} | {count} | {found} | {infeasible} | {count - found - infeasible} |"
        print(line + (f" {others} |" if options.ipopt else ""))


if __name__ == "__main__":
    main()
