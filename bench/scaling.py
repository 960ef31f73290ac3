"""How cost grows with the number of frames: time to set up and to compile, time per iteration, memory.

    python bench/scaling.py [SPEC] [--frames 50,1000,10000,100000] [--plot scaling.png]

Each frame count runs in processes of its own: with an empty object cache (for the compile time) and with the cache
that left, on one thread and on as many as a solve takes by itself.  Prints a Markdown table and the power of the
number of frames that the time per iteration grows with, fitted from 1000 frames on; with ``--plot`` also draws it
(matplotlib).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

#: How often a solve is made, and from so many frames on.
SOLVES = 5
FEW_SOLVES, MANY = 3, 50_000
LONG_ENOUGH = 0.5  # seconds


def compile_time(spec: str, n: int) -> dict[str, float]:
    """What compiling takes, in this process."""
    import stc

    _, transcription = stc.load(spec).transcription(n=n)
    begin = time.process_time()
    transcription.compile()
    return {"compile_s": time.process_time() - begin}


def direct(spec: str, n: int) -> dict[str, float]:
    """Setting up, an evaluation, and a solve on all frames, in this process."""
    import stc
    from stc.solver import minimize
    from stc.solver.evaluator import Scaling, evaluator_of

    begin = time.process_time()
    problem, transcription = stc.load(spec).transcription(n=n)
    bound = transcription.bind(problem.constants)
    setup = time.process_time() - begin
    evaluator = evaluator_of(bound, Scaling.none(bound.n, bound.m))
    evaluator.x[:] = bound.x0
    evaluate = min(_timed(evaluator.values_call) + _timed(evaluator.derivatives_call) for _ in range(10))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    best, result = _least(n, lambda: minimize(bound), time.process_time)
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return {
        "n": n,
        "variables": bound.n,
        "setup_s": setup,
        "evaluate_ns_per_frame": 1e9 * evaluate / (n + 1),
        "iterations": result.iterations,
        "solve_s": best,
        "memory_mb": memory,
    }


def direct_on_the_clock(spec: str, n: int) -> dict[str, float]:
    """A solve on all frames, by the clock."""
    import stc
    from stc.solver import minimize

    problem, transcription = stc.load(spec).transcription(n=n)
    bound = transcription.bind(problem.constants)
    return {"threads_s": _least(n, lambda: minimize(bound), time.perf_counter)[0]}


def nested(spec: str, n: int) -> dict[str, float]:
    """A solve by way of fewer frames."""
    import stc

    model = stc.load(spec)
    return {"nested_s": _least(n, lambda: model.solve(n=n), time.process_time)[0]}


#: What is measured in processes of their own, in this order: compiling leaves an object cache to the others.
MEASURES = {m.__name__: m for m in (compile_time, direct, direct_on_the_clock, nested)}


def _least(n: int, solve: Callable[[], Any], timer: Callable[[], float]) -> tuple[float, Any]:
    """The least time of some solves, of more where they are short, and what the last one gave."""
    times: list[float] = []
    while len(times) < (SOLVES if n < MANY else FEW_SOLVES) or sum(times) < LONG_ENOUGH:
        begin = timer()
        result = solve()
        times.append(timer() - begin)
        assert result.status == "optimal", result.status
    return min(times), result


def _timed(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def in_fresh_process(spec: str, n: int, cache: str, what: str) -> dict[str, float]:
    environment = {**os.environ, "STC_CACHE_DIR": cache, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("STC_THREADS", None)
    if what != direct_on_the_clock.__name__:
        environment["STC_THREADS"] = "1"
    command = [sys.executable, __file__, spec, "--one", str(n), "--what", what]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    return json.loads(run.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("spec", nargs="?", default="cart_pole_swing_up")
    parser.add_argument("--frames", default="50,1000,10000,100000")
    parser.add_argument("--plot")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--what", choices=MEASURES, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(MEASURES[args.what](args.spec, args.one)))
        return
    rows = []
    print(
        "| n | variables | compile, s | set up, s | iterations | solve, s | us per iteration and frame "
        "| with two threads | by way of fewer frames, s | evaluate, ns per frame | memory, MB |"
    )
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for n in map(int, args.frames.split(",")):
        with tempfile.TemporaryDirectory() as cache:
            row: dict[str, float] = {}
            for what in MEASURES:
                row.update(in_fresh_process(args.spec, n, cache, what))
        rows.append(row)
        print(
            f"| {n:,} | {row['variables']:,} | {row['compile_s']:.2f} | {row['setup_s']:.2f} "
            f"| {row['iterations']} | {row['solve_s']:.4g} | {share(row, 'solve_s'):.2f} "
            f"| {share(row, 'threads_s'):.2f} | {row['nested_s']:.4g} "
            f"| {row['evaluate_ns_per_frame']:.0f} | {row['memory_mb']:.0f} |",
            flush=True,
        )
    print(
        f"\n{args.spec}, solved on all its frames. Times are the minimum of at least {SOLVES} solves ({FEW_SOLVES} "
        f"from {MANY:,} frames on), in processor time of one thread; *with two threads*, the default, in wall time. "
        "*By way of fewer frames* is the default solve, here on one thread. *Set up* is the time from the text to the "
        "nonlinear program, without compiling. *Evaluate* is one evaluation of the functions and all derivatives. "
        "*Memory* is that of the solve. "
        f"{exponent(rows)}"
    )
    if args.plot:
        draw(rows, args.plot, args.spec)


def per_iteration(row: dict[str, float], key: str = "solve_s") -> float:
    """Seconds."""
    return row[key] / max(row["iterations"], 1)


def share(row: dict[str, float], key: str) -> float:
    """Microseconds for each iteration and frame."""
    return 1e6 * per_iteration(row, key) / (row["n"] + 1)


def exponent(rows: list[dict[str, float]]) -> str:
    """The power of n that the time per iteration grows with from 1000 frames on: least squares of the logarithms."""
    long = [row for row in rows if row["n"] >= 1000]
    if len(long) < 2:
        return ""
    n = [math.log(row["n"]) for row in long]
    one, two = (
        statistics.linear_regression(n, [math.log(per_iteration(row, key)) for row in long]).slope
        for key in ("solve_s", "threads_s")
    )
    first, last = long[0]["n"], long[-1]["n"]
    return (
        f"Time per iteration grows as n^{one:.2f} from {first:,} to {last:,} frames on one thread, and as "
        f"n^{two:.2f} with two (at most 1.1)."
    )


def draw(rows: list[dict[str, float]], path: str, spec: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    n = [r["n"] for r in rows]
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    for axis, values, label in (
        (axes[0], [r["compile_s"] for r in rows], "compile, s"),
        (axes[1], [1e3 * per_iteration(r) for r in rows], "time per iteration, ms"),
        (axes[2], [r["memory_mb"] for r in rows], "memory of the solve, MB"),
    ):
        axis.loglog(n, values, "o-")
        axis.set_xlabel("frames")
        axis.set_title(label)
        axis.grid(True, which="both", alpha=0.3)
    axes[0].set_yscale("linear")
    axes[0].set_ylim(bottom=0)
    figure.suptitle(spec)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
