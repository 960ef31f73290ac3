"""Solves of the bundled robots' motions, each from its own file and from perturbed ones: found, iterations, time.

    python -m bench robots                              all, with 20 perturbed ones each
    python bench/robots.py [quadruped_hop ...] [--each 20] [--seed 1] [--time-limit 60] [--list]

A perturbed motion has the mass of every body, with its inertia, and every duration, distance and speed of the spec
times a random number between 0.9 and 1.1.  Each is solved from its own guess.  Processor time of the solve alone.

    python bench/robots.py quadruped_hop --again        solved again from its solution, after one change at a time

There the masses are changed, or one duration, distance or speed, in turn.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "STC_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402 (threads are counted when NumPy is imported)
import time  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import dataclass  # noqa: E402

import numpy as np  # noqa: E402

import stc  # noqa: E402

ROBOTS = (
    "quadruped_hop",
    "quadruped_trot",
    "quadruped_box_jump",
    "quadruped_backflip",
    "humanoid_jump",
    "humanoid_step",
    "arm_swing",
    "falling_cat",
    "high_bar",
    "lamp_turn",
)
#: The constants of these specs that are durations, distances or speeds of the motion.
OF_THE_MOTION = ("T", "T1", "T2", "T3", "D", "v", "turn", "P", "top")
#: How much a number changes, at most.
MOST = 0.1


@dataclass(frozen=True, slots=True)
class Ending:
    """How one solve ended; ``seconds`` of processor time."""

    status: str
    objective: float
    iterations: int
    seconds: float


def constants_of(model: stc.Model) -> dict[str, float]:
    """The constants of a motion's spec without those that number its frames."""
    problem = model.problem()
    return {name: value for name, value in problem.constants.items() if name not in problem.structural}


def perturbed(constants: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Other values of the masses, durations and distances among a problem's constants."""
    found = {}
    for name, value in constants.items():
        if name in OF_THE_MOTION:
            found[name] = value * rng.uniform(1 - MOST, 1 + MOST)
        elif name.startswith("body.") and name.endswith(".mass"):
            factor = rng.uniform(1 - MOST, 1 + MOST)
            body = name.removesuffix("mass")
            same = [other for other in constants if other == name or other.startswith(f"{body}inertia.")]
            found.update({other: constants[other] * factor for other in same})
    return found


def in_turn(constants: dict[str, float], k: int, rng: np.random.Generator) -> dict[str, float]:
    """One change, the k-th: other masses, or another value of one of the motion's constants, in turn."""
    found = perturbed(constants, rng)
    of_motion = [name for name in found if name in OF_THE_MOTION]
    masses = [name for name in found if name not in OF_THE_MOTION]
    kinds = [[name] for name in of_motion] + ([masses] if masses else [])
    return {name: found[name] for name in kinds[k % len(kinds)]}


def solve(
    model: stc.Model, constants: dict[str, float], time_limit: float, earlier: stc.Solution | None = None
) -> tuple[stc.Solution, float]:
    """One solve from the spec's own guess or an earlier solution, and its processor time in seconds; everything is
    derived and compiled before.
    """
    model.prepare(**constants)
    begin = time.process_time()
    solution = model.solve(
        constants=constants,
        warm_start=earlier,
        callback=lambda _: time.process_time() - begin > time_limit,
    )
    return solution, time.process_time() - begin


def ending(solution: stc.Solution, seconds: float) -> Ending:
    """How a solve ended."""
    return Ending(solution.status, solution.objective, solution.iterations, seconds)


def again(model: stc.Model, name: str, options: argparse.Namespace) -> None:
    """Solve a motion anew from its solution after each change; a line for each, and medians."""
    constants = constants_of(model)
    own = solve(model, {}, options.time_limit)[0]
    found = []
    for k in range(options.each):
        given = in_turn(constants, k, np.random.default_rng([options.seed, k]))
        found.append(ending(*solve(model, given, options.time_limit, own)))
        if options.list:
            changed = next(
                (f"{c} {constants[c]:g} to {given[c]:.4g}" for c in given if len(given) == 1), "masses"
            )
            print(f"{name}, {changed}: {found[-1]}", flush=True)
    times = [e.seconds for e in found]
    optimal = sum(e.status == "optimal" for e in found)
    spread = f"{np.median(times):.3f} ({min(times):.3f} to {max(times):.3f})"
    iterations = int(np.median([e.iterations for e in found]))
    print(f"| {name} | {optimal} of {len(found)} | {iterations} | {spread} |", flush=True)


def line(name: str, own: Ending, others: Sequence[Ending]) -> str:
    """A row of the table."""
    found = [ending for ending in others if ending.status == "optimal"]
    iterations = sorted(ending.iterations for ending in found)
    every = [own, *others]
    per_iteration = 1000 * sum(e.seconds for e in every) / max(1, sum(e.iterations for e in every))
    spread = f"{int(np.median(iterations))} ({iterations[0]} to {iterations[-1]})" if found else ""
    start = f"{own.iterations}" if own.status == "optimal" else own.status
    return f"| {name} | {start} | {len(found)} of {len(others)} | {spread} | {per_iteration:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="MOTION", help="all by default")
    parser.add_argument("--each", type=int, default=20, help="perturbed ones of each motion")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--time-limit", type=float, default=60.0, help="seconds of processor time, for each solve"
    )
    parser.add_argument("--again", action="store_true", help="from the solution, after one change at a time")
    parser.add_argument("--list", action="store_true", help="also a line for every solve")
    options = parser.parse_args()
    if unknown := set(options.names) - set(ROBOTS):
        parser.error(f"unknown motion {', '.join(sorted(unknown))}")
    warnings.simplefilter("ignore")  # of specs: what is not used
    if options.again:
        print("| motion | changed: found | iterations | s of processor time, median (from to) |")
        print("| --- | ---: | ---: | ---: |")
        for name in options.names or ROBOTS:
            again(stc.load(name), name, options)
        return
    print("| motion | iterations | perturbed: found | iterations, median (from to) | ms an iteration |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name in options.names or ROBOTS:
        model = stc.load(name)
        constants = constants_of(model)
        endings = []
        for k in range(options.each + 1):
            given = perturbed(constants, np.random.default_rng([options.seed, k])) if k else {}
            endings.append(ending(*solve(model, given, options.time_limit)))
            if options.list:
                print(name, k, endings[-1], flush=True)
        print(line(name, endings[0], endings[1:]), flush=True)


if __name__ == "__main__":
    main()
