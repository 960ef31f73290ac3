"""From a Lagrangian to compiled derivatives: seconds to parse, derive and compile, nothing cached.

    python bench/mechanics.py [--quick] [--rounds 3]

The lamp's jump (``luxo_jump``), and chains of rods in a plane whose equations of motion follow from ``lagrangian:``,
with absolute angles and with relative ones, where every equation depends on every joint; velocities are primed
positions, or written out by hand.  Every measurement is a fresh process; the least processor time counts.  Prints a
Markdown table.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time

#: What, and how many seconds it may take.
CASES: tuple[tuple[str, float | None], ...] = (
    ("luxo_jump", 0.5),
    ("12 rods, absolute angles", 2.0),
    ("12 rods, relative angles", 2.0),
    ("20 rods, absolute angles", 10.0),
    ("20 rods, relative angles", 10.0),
    ("20 rods, relative angles, velocities by hand", 10.0),
    ("40 rods, relative angles", None),
)
QUICK = CASES[:5]


def chain(rods: int, relative: bool, by_hand: bool) -> str:
    """A chain hanging from a pivot, a torque on every coordinate, swung up in a second.

    ``by_hand``: the velocities of the rods are written out instead of as time derivatives of their positions.
    """
    every = range(1, rods + 1)

    def each(text: str, separator: str = " ") -> str:
        return separator.join(text.replace("#", str(k)) for k in every)

    lines = [
        "constants: n = 50, T = 1, h = T/n, m = 0.5, l = 0.5, g = 9.81, I = m*l^2/12;",
        f"variables: {each('q#', ', ')}, {each('u#', ', ')};",
        "method: trapezoidal;",
        "definitions:",
    ]
    for k in every:
        angle = f"p{k - 1} + q{k}" if relative and k > 1 else f"q{k}"
        x, z = (f"X{k - 1} +", f"Z{k - 1}") if k > 1 else ("", "")
        lines.append(
            f"  p{k} = {angle};  x{k} = {x} l/2*sin(p{k});  z{k} = {z} - l/2*cos(p{k});  "
            f"X{k} = {x} l*sin(p{k});  Z{k} = {z} - l*cos(p{k});"
        )
        if by_hand:
            turning = f"w{k - 1} + q{k}'" if relative and k > 1 else f"q{k}'"
            x, z = (f"VX{k - 1} +", f"VZ{k - 1} +") if k > 1 else ("", "")
            lines.append(
                f"  w{k} = {turning};  vx{k} = {x} l/2*cos(p{k})*w{k};  vz{k} = {z} l/2*sin(p{k})*w{k};  "
                f"VX{k} = {x} l*cos(p{k})*w{k};  VZ{k} = {z} l*sin(p{k})*w{k};"
            )
        else:
            lines.append(f"  w{k} = p{k}';  vx{k} = x{k}';  vz{k} = z{k}';")
    lines.append("lagrangian:")
    lines += [f"  m/2*(vx{k}^2 + vz{k}^2) + I/2*w{k}^2 - m*g*z{k};" for k in every]
    end = "q1 = pi; " + " ".join(f"q{k}{'' if relative else ' = pi'};" for k in every[1:])
    lines += [
        f"forces: {each('q#: u#;')}",
        "guess: " + " ".join(f"q{k} = pi*t/T;" for k in (every[:1] if relative else every)),
        "constraints:",
        f"  [0]: {each('q#;')} {each(chr(113) + '#' + chr(39) + ';')}",
        f"  [n]: {end} {each(chr(113) + '#' + chr(39) + ';')}",
        f"objective: [0, n]: integral({each('u#^2', ' + ')});",
    ]
    return "\n".join(lines) + "\n"


def text_of(name: str) -> str:
    """The spec, or the bundled name, of a case."""
    rods, _, angles = name.partition(" rods, ")
    return chain(int(rods), angles.startswith("relative"), angles.endswith("by hand")) if angles else name


def measure(name: str) -> dict[str, float]:
    """Seconds of this process's processor time for each stage, and operations per node."""
    import llvmlite.binding  # noqa: F401 -- importing LLVM is no part of compiling

    import stc
    from stc.pipeline import transcribe

    marks = [time.process_time()]
    model = stc.load(text_of(name))
    problem = model.problem()
    marks.append(time.process_time())
    transcription = transcribe(problem)
    marks.append(time.process_time())
    transcription.compile(cache=False)
    marks.append(time.process_time())
    stages = [later - earlier for earlier, later in itertools.pairwise(marks)]
    operations = sum(len(tape.ops) for tape in transcription.tapes)
    return dict(zip(("equations", "derive", "compile"), stages)) | {"operations": operations}


def in_fresh_process(name: str) -> dict[str, float]:
    command = [sys.executable, __file__, "--one", name]
    with tempfile.TemporaryDirectory() as cache:
        environment = {**os.environ, "STC_CACHE_DIR": cache}
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    figures: dict[str, float] = json.loads(run.stdout.splitlines()[-1])
    return figures


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="without the long ones")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one", help="measure this in this process")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one)))
        return
    print(
        "| | operations | parse and equations, s | derive, s | compile, s | together, s | spread | at most |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    stages = ("equations", "derive", "compile")
    for name, limit in QUICK if options.quick else CASES:
        runs = [in_fresh_process(name) for _ in range(options.rounds)]
        totals = [sum(run[stage] for stage in stages) for run in runs]
        best = runs[totals.index(min(totals))]
        cells = [f"{best[stage]:.2f}" for stage in stages]
        spread = (max(totals) - min(totals)) / min(totals)
        at_most = "" if limit is None else f"{limit:g}"
        print(
            f"| {name} | {best['operations']:,} | {' | '.join(cells)} | {min(totals):.2f} | "
            f"{100 * spread:.0f} % | {at_most} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
