"""Solves of random motions of many kinds, beside IPOPT on the very same programs: what is general, and what is not.

    python bench/variety.py [--each 8] [--seed 1] [--only crane,hop] [--frames 800] [--time-limit 30] [--list]

For every kind (see kinds.py) specs with random constants are drawn, with so many frames where that is asked for.  IPOPT
gets each program kernel by kernel (casadi_bridge), expanded and with exact derivatives.  Processor time of a solve, set
up before; here that of the second solve of the program.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "STC_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402 (threads are counted when NumPy is imported)
import math  # noqa: E402
import time  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import dataclass  # noqa: E402

import numpy as np  # noqa: E402
from compare_ipopt import WORDS  # noqa: E402
from kinds import KINDS, Kind  # noqa: E402

import stc  # noqa: E402

SAME = 1e-4
"""Relative difference of objectives that counts as none."""


@dataclass(frozen=True, slots=True)
class Ending:
    """How one tool ended on one problem."""

    status: str
    objective: float
    iterations: int
    seconds: float

    @property
    def solved(self) -> bool:
        """Whether it found a solution."""
        return self.status == "optimal"


Pair = tuple[Ending, Ending]


def solve(text: str, time_limit: float, frames: int | None = None) -> Pair:
    """How stc ends on a spec, with another number of frames than its own if one is given, and how IPOPT does."""
    from casadi_bridge import ipopt

    model = stc.load(text) if frames is None else stc.load(text, n=frames)
    model.solve(time_limit=time_limit)
    begin = time.process_time()
    ours = model.solve(time_limit=time_limit)
    seconds = time.process_time() - begin
    problem, transcription = model.transcription()
    theirs = ipopt(transcription.bind(problem.constants), max_cpu_time=time_limit)
    return (
        Ending(ours.status, ours.objective, ours.iterations, seconds),
        Ending(WORDS.get(theirs.status, theirs.status), theirs.objective, theirs.iterations, theirs.seconds),
    )


def mean_ratio(above: Sequence[float], below: Sequence[float]) -> str:
    """The geometric mean of ratios."""
    logs = [math.log(a / b) for a, b in zip(above, below, strict=True) if a > 0 and b > 0]
    return f"{math.exp(sum(logs) / len(logs)):.2g}" if logs else ""


def line(name: str, pairs: Sequence[Pair]) -> str:
    """A row of the table: times and iterations where both found a solution."""
    both = [(ours, theirs) for ours, theirs in pairs if ours.solved and theirs.solved]
    differences = [
        (ours.objective - theirs.objective) / max(1.0, abs(theirs.objective)) for ours, theirs in both
    ]
    same = sum(abs(d) <= SAME for d in differences)
    better = sum(d < -SAME for d in differences)
    ratios = sorted(theirs.seconds / ours.seconds for ours, theirs in both)
    cells = [
        name,
        str(len(pairs)),
        str(sum(ours.solved for ours, _ in pairs)),
        str(sum(theirs.solved for _, theirs in pairs)),
        f"{same} / {better} / {len(both) - same - better}",
        mean_ratio([ours.iterations for ours, _ in both], [theirs.iterations for _, theirs in both]),
        mean_ratio([theirs.seconds for _, theirs in both], [ours.seconds for ours, _ in both]),
        f"{ratios[0]:.2g} to {ratios[-1]:.2g}" if ratios else "",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--each", type=int, default=8, help="problems of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds, such as crane,hop")
    parser.add_argument("--frames", type=int, help="of each motion, instead of its own number")
    parser.add_argument("--time-limit", type=float, default=30.0, help="seconds, for each solve")
    parser.add_argument("--list", action="store_true", help="also a line for every problem")
    options = parser.parse_args()
    wanted = {word.strip() for word in options.only.split(",") if word.strip()}
    kinds: list[Kind] = [kind for kind in KINDS if not wanted or kind.__name__ in wanted]
    warnings.simplefilter("ignore")  # of specs: what is not used, what is not scaled
    rows, everything = [], []
    for kind in kinds:
        pairs = []
        for k in range(options.each):
            text = kind(np.random.default_rng([options.seed, k]))
            pairs.append(solve(text, options.time_limit, options.frames))
            if options.list:
                print(kind.__name__, k, *pairs[-1], flush=True)
        rows.append(line(kind.__name__.replace("_", " "), pairs))
        everything += pairs
    print(
        "| kind | problems | solved here | by IPOPT | same / better / worse optimum | iterations, times IPOPT's "
        "| times faster | from, to |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    )
    print("\n".join([*rows, line("all", everything)]))


if __name__ == "__main__":
    main()
