"""How cost grows with the number of frames: compile time, time per iteration, memory.

    python bench/scaling.py [SPEC] [--frames 50,200,1000,5000,20000] [--plot scaling.png]

Each frame count runs in a process of its own, twice: once with an empty object cache (for the compile time) and
once with the cache it left (for the rest).  Prints a Markdown table; with ``--plot`` also draws it (matplotlib).
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


def measure(spec: str, n: int) -> dict[str, float]:
    """Solves once and reports what it took, in this process."""
    import stc
    from stc.solver import minimize

    problem, transcription = stc.load(spec).transcription(n=n)
    begin = time.process_time()
    transcription.compile()
    compiled = time.process_time() - begin
    bound = transcription.bind(problem.constants)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    best = float("inf")
    for _ in range(3):
        begin = time.process_time()
        result = minimize(bound)
        best = min(best, time.process_time() - begin)
    return {
        "n": n,
        "status": result.status.value,
        "variables": bound.n,
        "compile_s": compiled,
        "iterations": result.iterations,
        "solve_s": best,
        "us_per_iteration_and_frame": 1e6 * best / max(result.iterations, 1) / (n + 1),
        "memory_mb": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024,
    }


def in_fresh_process(spec: str, n: int, cache: str) -> dict[str, float]:
    environment = {**os.environ, "STC_CACHE_DIR": cache, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment["STC_THREADS"] = "1"
    command = [sys.executable, __file__, spec, "--one", str(n)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    return json.loads(run.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("spec", nargs="?", default="cart_pole_swing_up")
    parser.add_argument("--frames", default="50,200,1000,5000,20000")
    parser.add_argument("--plot")
    parser.add_argument("--one", type=int)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(measure(args.spec, args.one)))
        return
    rows = []
    print("| n | variables | compile, s | iterations | solve, s | us per iteration and frame | memory, MB |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for n in map(int, args.frames.split(",")):
        with tempfile.TemporaryDirectory() as cache:
            cold = in_fresh_process(args.spec, n, cache)
            warm = in_fresh_process(args.spec, n, cache)
        row = {**warm, "compile_s": cold["compile_s"]}
        rows.append(row)
        print(
            f"| {n} | {row['variables']} | {row['compile_s']:.2f} | {row['iterations']} | {row['solve_s']:.4f} "
            f"| {row['us_per_iteration_and_frame']:.2f} | {row['memory_mb']:.1f} |",
            flush=True,
        )
    print(f"\n{args.spec}; processor time, the least of three solves. {exponent(rows)}")
    if args.plot:
        draw(rows, args.plot, args.spec)


def exponent(rows: list[dict[str, float]]) -> str:
    """Between which powers of n the time per iteration grows, from 1000 frames on."""
    long = [(r["n"], r["solve_s"] / max(r["iterations"], 1)) for r in rows if r["n"] >= 1000]
    if len(long) < 2:
        return ""
    (first, fast), (last, slow) = long[0], long[-1]
    power = math.log(slow / fast) / math.log(last / first)
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
