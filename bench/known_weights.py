"""How well `stc explain-motion` finds known weights in noisy recordings: the table of docs/explain_motion.md.

python bench/known_weights.py           measure, and write the table
python bench/known_weights.py --print   the page stays as it is
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

import stc
from stc import models
from stc.explaining import Explanation, explain

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explain_motion.md"
RATE = 83.0
NAMES = ("joint.cart", "joint.pole")
#: Weight of the squared accelerations beside that of the effort, which is 1.
WEIGHT = 0.02
SPEC = f"""
constants: n = 60, T = 2, h = T/n, W = {WEIGHT};
model: "cart_pole.xml";
constraints:
  [0]: keyframe.reference; rest;
  [n]: joint.cart = 0.8; joint.pole = pi; rest;
guess: joint.cart = 0.8*t/T; joint.pole = pi*t/T;
objective: [0, n]: integral(effort); integral(W*joint.*''^2);
"""
NOISES = (0.0, 1e-4, 5e-4, 2e-3, 1e-2)
SEEDS = (1, 2, 3, 4)


def found(made: stc.Solution, noise: float, seed: int) -> tuple[float, float, Explanation]:
    """The weight that is found (0 if the term is left out), the RMS distance of the motion, and the explanation."""
    times = np.append(np.arange(0.0, made.duration - 0.5 / RATE, 1.0 / RATE), made.duration)
    at, random = made.at(times), np.random.default_rng(seed)
    columns = [times, *(at[name] + noise * random.standard_normal(len(times)) for name in NAMES)]
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "recorded.csv")
        header = ",".join(("time", *NAMES))
        np.savetxt(table, np.column_stack(columns), delimiter=",", header=header, comments="")
        explained = explain(table, models.locate("cart_pole.xml"), folder=folder)
    written = re.search(r"integral\(([\d.e+-]+)\*joint\.\*''\^2\)", explained.text)
    effort = re.search(r"integral\((?:([\d.e+-]+)\*)?effort\)", explained.text)
    weight = float(written[1]) if written else 0.0
    weight = weight / float(effort[1] or 1.0) if effort else np.inf
    there = explained.solution.at(times)
    distance = np.sqrt(np.mean([(there[name] - at[name]) ** 2 for name in NAMES]))
    return weight, float(distance), explained


def row(made: stc.Solution, noise: float, true: dict[str, float]) -> str:
    """The row of the table for one noise, over all seeds; without noise, the true shares are what is found."""
    trials = [found(made, noise, seed) for seed in (SEEDS if noise else SEEDS[:1])]
    if not noise:
        true.update(trials[0][2].shares)
    errors = [abs(weight / WEIGHT - 1.0) for weight, _, _ in trials]
    terms = " or ".join(sorted({", ".join(sorted(one.shares)) for *_, one in trials}))
    share = " | ".join(f"{float(f'{100.0 * one:.2g}'):g} %" for one in (np.median(errors), max(errors)))
    bounds = np.array([one.ranges["acceleration"] for *_, one in trials])
    likely = f"{100.0 * np.min(bounds[:, 0]):.2g} to {100.0 * np.max(bounds[:, 1]):.2g} %"
    missed = max(
        max(low - true.get(name, 0.0), true.get(name, 0.0) - high, 0.0)
        for *_, one in trials
        for name, (low, high) in one.ranges.items()
    )
    away = max(distance for _, distance, _ in trials)
    return f"| {noise:g} | {share} | {likely} | {100.0 * missed:.1g} % | {away:.1e} | {terms} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--print", action="store_true", dest="dry", help="leave docs/explain_motion.md as it is"
    )
    options = parser.parse_args()
    made = stc.load(SPEC).solve()
    lines = [
        "| noise, m and rad | error of the weight, median | largest | likely share of the accelerations "
        "| a true share is outside of its range by, at most | largest distance, RMS | terms |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    true: dict[str, float] = {}
    print("\n".join(lines))
    for noise in NOISES:
        lines.append(row(made, noise, true))
        print(lines[-1], flush=True)
    if not options.dry:
        put("measured", "\n".join(lines), PAGE)


if __name__ == "__main__":
    main()
