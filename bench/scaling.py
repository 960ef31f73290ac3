"""How cost grows with the number of frames: time to set up and to compile, time per iteration, memory.

    python bench/scaling.py [SPEC] [--frames 50,1000,10000,100000] [--plot scaling.png]

Each frame count runs in a process of its own, twice: once with an empty object cache (for the compile time) and
once with the cache it left (for the rest).  Prints a Markdown table and the power of the number of frames that the
time per iteration grows with, fitted from 1000 frames on; with ``--plot`` also draws it (matplotlib).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

#: From so many frames on, a solve is repeated once only.
MANY = 50_000


def compile_time(spec: str, n: int) -> dict[str, float]:
    """What compiling takes, in this process."""
    import stc

    _, transcription = stc.load(spec).transcription(n=n)
    begin = time.process_time()
    transcription.compile()
    return {"compile_s": time.process_time() - begin}


def measure(spec: str, n: int) -> dict[str, float]:
    """What everything but compiling takes, in this process."""
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
    best = float("inf")
    for _ in range(3 if n < MANY else 2):
        begin = time.process_time()
        result = minimize(bound)
        best = min(best, time.process_time() - begin)
    return {
        "n": n,
        "status": result.status.value,
        "variables": bound.n,
        "setup_s": setup,
        "evaluate_ns_per_frame": 1e9 * evaluate / (n + 1),
        "iterations": result.iterations,
        "solve_s": best,
        "us_per_iteration_and_frame": 1e6 * best / max(result.iterations, 1) / (n + 1),
        "memory_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
    }


def _timed(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def in_fresh_process(spec: str, n: int, cache: str, what: str) -> dict[str, float]:
    environment = {**os.environ, "STC_CACHE_DIR": cache, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
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
    parser.add_argument("--what", default="rest", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps((compile_time if args.what == "compile" else measure)(args.spec, args.one)))
        return
    rows = []
    print(
        "| n | variables | compile, s | set up, s | iterations | solve, s | us per iteration and frame "
        "| evaluate, ns per frame | memory, MB |"
    )
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for n in map(int, args.frames.split(",")):
        with tempfile.TemporaryDirectory() as cache:
            row = in_fresh_process(args.spec, n, cache, "compile")
            row.update(in_fresh_process(args.spec, n, cache, "rest"))
        rows.append(row)
        print(
            f"| {n:,} | {row['variables']:,} | {row['compile_s']:.2f} | {row['setup_s']:.2f} "
            f"| {row['iterations']} | {row['solve_s']:.4g} | {row['us_per_iteration_and_frame']:.2f} "
            f"| {row['evaluate_ns_per_frame']:.0f} | {row['memory_mb']:.0f} |",
            flush=True,
        )
    print(
        f"\n{args.spec}; processor time of one thread, the least of three solves (two from {MANY:,} frames on). "
        f"*Set up* is from text to nonlinear program without compiling; *evaluate* is functions and all derivatives "
        f"once; *memory* is the solve's own. {exponent(rows)}"
    )
    if args.plot:
        draw(rows, args.plot, args.spec)


def exponent(rows: list[dict[str, float]]) -> str:
    """The power of n that the time per iteration grows with from 1000 frames on: least squares of the logarithms."""
    long = [row for row in rows if row["n"] >= 1000]
    if len(long) < 2:
        return ""
    x = [math.log(row["n"]) for row in long]
    y = [math.log(row["solve_s"] / max(row["iterations"], 1)) for row in long]
    middle, level = sum(x) / len(x), sum(y) / len(y)
    power = sum((a - middle) * (b - level) for a, b in zip(x, y)) / sum((a - middle) ** 2 for a in x)
    first, last = long[0]["n"], long[-1]["n"]
    return f"Time per iteration grows as n^{power:.2f} from {first:,} to {last:,} frames (at most 1.1)."


def draw(rows: list[dict[str, float]], path: str, spec: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    n = [r["n"] for r in rows]
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    per_iteration = [1e3 * r["solve_s"] / max(r["iterations"], 1) for r in rows]
    for axis, values, label in (
        (axes[0], [r["compile_s"] for r in rows], "compile, s"),
        (axes[1], per_iteration, "time per iteration, ms"),
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
