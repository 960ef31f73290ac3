"""Other ways to solve complementary pairs, on the same problems from the same starts.

    python bench/complementarity_methods.py [--starts 5] [--only ball,block] [--write]

Each pair ``0 <= a complements b >= 0`` is written otherwise, with a constant that a few solves bring down, each from
the one before:

- ``penalty``: as it is, by the method of this solver; ``lifted penalty``: with variables for both sides;
- ``Scholtes``: ``a*b <= t`` (Scholtes 2001); ``lifted Scholtes``: the same of variables for both sides;
- ``Fischer-Burmeister``: ``a + b = sqrt(a^2 + b^2 + 2*t)`` (Facchinei, Jiang and Qi 1999);
- ``Kadrani``: ``(a - t)*(b - t) <= 0`` with ``a, b >= -t`` (Kadrani, Dussault and Benchakroun 2009).

A start counts as solved where the last status is optimal and no smaller side is above 2e-5, relative to max(1, the
larger one).  ``--write`` puts the table into docs/complementarity.md.
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import replace
from pathlib import Path
from statistics import geometric_mean, median

import numpy as np
from complementarity import NOISE, PAGE, PROBLEMS

import stc
from stc.solver import Options, Result, Start
from stc.solver.sqp import minimize
from stc.transcription import Transcription

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

NAMES = "ball,block,pushbox,twowalls,hopper,outrata31,outrata32,bilevel2,scholtes1,dempe,sl1"
PAIR = re.compile(r"0 <= ([^;]*?) complements ([^;]*?) >= 0;")
DOWN = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
SLOWER = (0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
WAYS: dict[str, tuple[str, tuple[float, ...]]] = {
    "penalty": ("0 <= {a} complements {b} >= 0;", (0.0,)),
    "lifted penalty": ("{u} = {a}; {v} = {b}; 0 <= {u} complements {v} >= 0;", (0.0,)),
    "Scholtes": ("{a} >= 0; {b} >= 0; {a}*{b} <= down;", DOWN),
    "lifted Scholtes": ("{u} = {a}; {v} = {b}; {u} >= 0; {v} >= 0; {u}*{v} <= down;", DOWN),
    "Fischer-Burmeister": ("{a} + {b} = sqrt({a}^2 + {b}^2 + 2*down);", DOWN),
    "Kadrani": ("{a} >= -down; {b} >= -down; ({a} - down)*({b} - down) <= 0;", SLOWER),
}
MOST, EACH = 1500, 300


def written(text: str, way: str) -> str:
    """The spec with its pairs written in another way."""
    added: list[str] = []

    def one(found: re.Match[str]) -> str:
        names = {"u": f"side_{len(added)}", "v": f"side_{len(added) + 1}"}
        if "{u}" in WAYS[way][0]:
            added.extend(names.values())
        return WAYS[way][0].format(a=f"({found[1]})", b=f"({found[2]})", **names)

    text = PAIR.sub(one, text).replace("constants:", "constants: down = 0.1,", 1)
    section = "variables:" if "variables:" in text else "parameters:"
    return text.replace(section, " ".join([section, *(f"{name}," for name in added)]), 1)


def brought_down(
    transcription: Transcription, x0: np.ndarray, steps: tuple[float, ...]
) -> tuple[int, Result]:
    """All solves, each from the one before: their iterations, and the last one's result."""
    spent, start = 0, Start(x0)
    for value in steps:
        program = transcription.bind({**transcription.problem.constants, "down": value})
        warm = start.row_multipliers is not None
        limits = Options(max_iterations=MOST)
        if len(steps) > 1:
            limits = replace(limits, max_iterations=EACH, retries=0, warm_start=warm, trusting=False)
        result = minimize(program, limits, start=start)
        spent += result.iterations
        start = Start(result.x)
        if result.success:
            start = Start(result.x, result.row_multipliers, result.bound_multipliers)
        if spent > MOST:
            break
    return spent, result


def residual(model: stc.Model, spec: str, transcription: Transcription, x: np.ndarray) -> float:
    """The largest smaller side of a point, as the spec's own program sees it."""
    problem, own = model.transcription()
    program = own.bind(problem.constants)
    places = {transcription.layout.describe(k): k for k in range(len(x))}
    there = np.array([x[places[own.layout.describe(k)]] for k in range(program.n)])
    return program.pairs.residual(program, there)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--starts", type=int, default=5)
    parser.add_argument("--only", default=NAMES)
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    names = asked.only.split(",")
    table = "\n| | solved | iterations | " + " | ".join(names) + " |\n" + "| --- " * (len(names) + 3) + "|\n"
    for way, (_, steps) in WAYS.items():
        solved, medians = 0, []
        for name in names:
            path = next(PROBLEMS.glob(f"*/{name}.stc"))
            spec = path.read_text()
            model, other = stc.load(spec), stc.load(written(spec, way))
            problem, transcription = other.compiled(None, {}, at_once=True)
            program = transcription.bind(problem.constants)
            spent = []
            for seed in range(asked.starts):
                noise = np.random.default_rng(seed).uniform(-1.0, 1.0, program.n) * NOISE[path.parent.name]
                x0 = np.clip(program.x0 + (noise if seed else 0.0), program.x_lower, program.x_upper)
                iterations, result = brought_down(transcription, x0, steps)
                spent.append(iterations)
                solved += result.success and residual(model, spec, transcription, result.x) <= 2e-5
            medians.append(median(spent))
        line = f"| {way} | {solved} of {len(names) * asked.starts} | {geometric_mean(medians):.3g} | "
        line += " | ".join(f"{one:g}" for one in medians) + " |"
        print(line, flush=True)
        table += line + "\n"
    if asked.write:
        put("methods", table, Path(PAGE))


if __name__ == "__main__":
    main()
