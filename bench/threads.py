"""Two threads beside one: time on the clock of solves, of evaluations and of compiling, and who is faster.

    python bench/threads.py [--rounds 15] [--quick] [--only P2 --only "20 rods"]

One thread and two take turns, a different one first each round: solves and evaluations in one process and the same
memory, since its place matters; compiling in a process each time, from an empty object cache.  A round gives one ratio,
two threads over one, of times taken one right after the other: what else the machine does changes both.  Prints a
Markdown table.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402 (threads are counted when NumPy is imported)
import json  # noqa: E402
import statistics  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable, Sequence  # noqa: E402
from dataclasses import asdict, dataclass  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.peers.problems import constants_of, spec_of  # noqa: E402

#: Rounds of each case, those of a quick run, and how many there are at least where they are long.
ROUNDS, QUICK_ROUNDS, FEWEST = 15, 6, 5
#: Calls are repeated until a time is at least so many seconds; no more rounds begin after so many seconds.
BATCH, BUDGET = 0.1, 20.0
#: Ratios this close to 1 are level.
MARGIN = 0.02

#: Wall and processor time of a call, in seconds.
Times = tuple[float, float]
#: Those with one thread, and those with two.
Round = tuple[Times, Times]


@dataclass(frozen=True, slots=True)
class Case:
    """What is measured: ``solve``, ``evaluate`` or ``compile``, of which problem, on how many intervals.

    ``iterations`` limits a solve that takes another way each time it is repeated, since its plans go on evolving.
    """

    what: str
    problem: str
    n: int
    rods: int = 0
    iterations: int | None = None

    @property
    def label(self) -> str:
        """What the table calls it."""
        name = f"{self.problem}, {self.rods} rods" if self.problem == "P4" else self.problem
        name = name.replace("P6", "luxo_jump")
        if self.what == "compile":
            return f"{self.what} {name}"
        limit = f", {self.iterations} iterations" if self.iterations else ""
        return f"{self.what} {name}, n = {self.n:,}{limit}"

    @property
    def constants(self) -> dict[str, int]:
        """Those that give the spec its number of intervals."""
        return constants_of(self.problem, self.n)


CASES = (
    Case("solve", "P1", 1000),
    Case("solve", "P1", 10_000),
    Case("solve", "P2", 50),
    Case("solve", "P2", 1000),
    Case("solve", "P2", 10_000),
    Case("solve", "P2", 100_000),
    Case("solve", "P3", 50, 5),
    Case("solve", "P3", 1000, 5),
    Case("solve", "P3", 3000, 5),
    Case("solve", "P4", 50, 10),
    Case("solve", "P4", 200, 10, iterations=80),
    Case("solve", "P5", 120),
    Case("solve", "P5", 990),
    Case("solve", "P6", 120),
    Case("evaluate", "P2", 10_000),
    Case("evaluate", "P2", 100_000),
    Case("evaluate", "P4", 1000, 20),
    Case("compile", "P2", 50),
    Case("compile", "P6", 120),
    Case("compile", "P4", 50, 20),
)

#: Solves before those that are timed: the elimination's plan settles in them, the same way with one thread and two.
SETTLING = 6


def work(case: Case) -> Callable[[], object]:
    """A solve, from the same guess each time, or one evaluation of functions and all derivatives there; all set up."""
    import numpy as np

    import stc
    from stc.solver.evaluator import Scaling, evaluator_of

    model = stc.load(spec_of(case.problem, case.rods))
    if case.what == "solve":
        return model.prepare(max_iterations=case.iterations, **case.constants).run
    problem, transcription = model.transcription(**case.constants)
    bound = transcription.bind(problem.constants)
    evaluator = evaluator_of(bound, Scaling.none(bound.n, bound.m))
    evaluator.x[:] = bound.x0
    evaluator.y[:] = np.sin(np.arange(bound.m))
    return lambda: (evaluator.values_call(), evaluator.derivatives_call())


def timed(call: Callable[[], object], count: int) -> Times:
    """Mean times of so many calls: what is only tried now and then counts as well."""
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(count):
        call()
    return (time.perf_counter() - wall) / count, (time.process_time() - cpu) / count


def alternate(measure: Callable[[int], Times], rounds: int) -> list[Round]:
    """Rounds of a measurement with one thread and with two; fewer of them where they are long.

    Args:
        measure: takes the number of threads.
        rounds: how many.
    """
    found: list[Round] = []
    begin = time.perf_counter()
    while len(found) < rounds and (len(found) < FEWEST or time.perf_counter() - begin < BUDGET):
        first = 1 + len(found) % 2
        times = {count: measure(count) for count in (first, 3 - first)}
        found.append((times[1], times[2]))
    return found


def repeated(case: Case, rounds: int) -> list[Round]:
    """Rounds of a solve or an evaluation in this process, all set up before."""
    from stc.codegen import threads

    threads.limit(2)
    call = work(case)
    once = min(timed(call, 1)[0] for _ in range(SETTLING))
    repeats = max(1, round(BATCH / once))

    def measure(count: int) -> Times:
        threads.limit(count)
        return timed(call, repeats)

    measure(2)  # finds out which way is faster
    return alternate(measure, rounds)


def compile_once(case: Case) -> Times:
    """Times of compiling all kernels of a problem, LLVM being imported."""
    import llvmlite.binding  # noqa: F401

    import stc

    _, transcription = stc.load(spec_of(case.problem, case.rods)).transcription(**case.constants)
    return timed(lambda: transcription.compile(cache=False), 1)


def in_fresh_process(case: Case, *arguments: str, threads: int = 2) -> Any:
    """What this script finds in another process."""
    environment = {**os.environ, "STC_THREADS": str(threads)}
    command = [sys.executable, __file__, "--one", json.dumps(asdict(case)), *arguments]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    return json.loads(run.stdout.splitlines()[-1])


def measured(case: Case, rounds: int) -> list[Round]:
    """All rounds of a case."""
    if case.what == "compile":
        return alternate(lambda count: in_fresh_process(case, threads=count), rounds)
    found: list[Round] = in_fresh_process(case, "--rounds", str(rounds))
    return found


def quartiles(values: Sequence[float]) -> tuple[float, float, float]:
    """The lower one, the median and the upper one."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, middle, high


def verdict(rounds: Sequence[Round]) -> str:
    """``faster``, ``level`` or ``slower``, by the clock, as three rounds in four have it."""
    low, _, high = quartiles([two[0] / one[0] for one, two in rounds])
    return "slower" if low > 1.0 + MARGIN else "faster" if high < 1.0 - MARGIN else "level"


HEAD = (
    "| | one thread, ms | two, ms | two over one | quartiles | processor time of one, ms | of two | two threads are |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |"
)


def line(case: Case, rounds: Sequence[Round]) -> str:
    """A line of the table."""
    wall, cpu = [], []
    for count in (0, 1):
        wall.append(statistics.median(both[count][0] for both in rounds))
        cpu.append(statistics.median(both[count][1] for both in rounds))
    low, _, high = quartiles([two[0] / one[0] for one, two in rounds])
    times = " | ".join(f"{1e3 * t:.3g}" for t in wall)
    used = " | ".join(f"{1e3 * t:.3g}" for t in cpu)
    ratio = wall[1] / wall[0]
    ratios = f"{ratio:.2f} | {low:.2f} to {high:.2f}"
    return f"| {case.label} | {times} | {ratios} | {used} | {verdict(rounds)} |"


def summary(verdicts: Sequence[str]) -> str:
    """The text below the table."""
    counts = [f"{verdicts.count(name)} {name}" for name in ("faster", "level", "slower")]
    return (
        "Times are medians over the rounds, *two over one* is their ratio; the quartiles are those of the ratios of "
        f"the rounds. Two threads are *slower* if three rounds in four took more than {1 + MARGIN:g} times as long, "
        f"*faster* if three in four took less than {1 - MARGIN:g} times as long, otherwise *level*. Solves and "
        f"evaluations give the same bits.\n\nOf {len(verdicts)} cases, two threads are {', '.join(counts)}."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--rounds", type=int, help=f"of each case, the longest ones excepted; default {ROUNDS}"
    )
    parser.add_argument("--quick", action="store_true", help=f"n up to 10,000, {QUICK_ROUNDS} rounds")
    parser.add_argument("--only", action="append", metavar="TEXT", help="cases whose names contain this")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    rounds = options.rounds or (QUICK_ROUNDS if options.quick else ROUNDS)
    if options.one:
        case = Case(**json.loads(options.one))
        print(json.dumps(compile_once(case) if case.what == "compile" else repeated(case, rounds)))
        return
    verdicts = []
    print(HEAD)
    for case in CASES:
        wanted = any(text in case.label for text in options.only or [""])
        if wanted and not (options.quick and case.n > 10_000):
            found = measured(case, rounds)
            verdicts.append(verdict(found))
            print(line(case, found), flush=True)
    print(f"\n{summary(verdicts)}")


if __name__ == "__main__":
    main()
