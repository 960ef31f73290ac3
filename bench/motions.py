"""Solves the motions of the lamp, the segment and the robots, replays them, and writes the tables of docs/motions.md.

python bench/motions.py                     all; some minutes
python bench/motions.py luxo_jump --print   some, and the page stays as it is
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import stc
from stc.solution import Solution
from stc.transcription.operations import count_operations
from stc.validate.contact import contact_metrics
from stc.validate.metrics import Metric
from stc.validate.replay import Replay, replay, stepping_for
from stc.validate.report import Report
from stc.validate.setup import Setup
from stc.validate.tracking import proportional
from stc.validate.verdict import open_setup, validate

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

PAGE = Path(__file__).resolve().parent.parent / "docs" / "motions.md"

#: All masses and inertias times this.
HEAVIER = 1.01

GROUND = [
    "luxo_jump",
    "luxo_hurdle",
    "luxo_step_up",
    "luxo_step_down",
    "luxo_heavy",
    "luxo_moon",
    "luxo_two_jumps",
    "luxo_backflip",
]
ROBOTS = (
    "arm_swing",
    "falling_cat",
    "high_bar",
    "lamp_turn",
    "quadruped_backflip",
    "quadruped_box_jump",
    "quadruped_hop",
    "quadruped_trot",
    "humanoid_jump",
    "humanoid_step",
)
OTHERS = ("luxo_poses", "luxo_three_poses", "segment_to_pose", "segment_flip", "segment_swing")


def values(report: Report, name: str) -> list[float]:
    """What was measured under a name, one number per subject."""
    return [metric.value for metric in report.metrics if metric.name == name]


def by_subject(metrics: Sequence[Metric], name: str, solution: Solution) -> dict[str, float]:
    """What was measured under a name: of the base, and the root of the mean square of the joints with a motor."""
    found = {metric.subject: metric.value for metric in metrics if metric.name == name}
    # The lamp's motors are called after their joints.
    squares = [found[f"joint {line.name}"] ** 2 for line in solution.replay if line.kind == "actuator"]
    return {"base": found["base"], "joints": float(sum(squares) / len(squares)) ** 0.5}


def worst_share(motion: Replay) -> float:
    """The largest share that feedback has in a motor's torque: integrals of absolute values."""
    return float(max(motion.feedback / motion.total))


def heavier(solution: Solution) -> tuple[Setup, Replay]:
    """The tracked replay with bodies heavier than those that the motion was solved for."""
    setup = open_setup(solution)
    law = proportional(setup)
    setup.compiled.body_mass *= HEAVIER
    setup.compiled.body_inertia *= HEAVIER
    return setup, replay(setup, stepping_for(setup).time_step, feedback=law)


def effort(solution: Solution) -> str:
    return f"{solution.n} | {solution.iterations} | {solution.seconds['solve']:.1f}"


def on_the_ground(name: str) -> tuple[str, str]:
    """The motion's line in the table, and in that of the heavier bodies."""
    solution = stc.load(name).solve()
    report = validate(solution)
    tracked = by_subject(report.metrics, "tracked error on the ground, RMS", solution)
    loose = by_subject(report.metrics, "open-loop error on the ground, RMS", solution)
    line = (
        f"| `{name}` | {effort(solution)} | {loose['base']:.1e}, {loose['joints']:.1e} rad "
        f"| {tracked['base']:.1e} | {tracked['joints']:.1e} rad "
        f"| {100 * max(values(report, 'feedback share')):.2g} % "
        f"| {max(values(report, 'inverse-dynamics residual')):.0e} |"
    )
    setup, motion = heavier(solution)
    found = contact_metrics("tracked", setup, motion)
    errors = by_subject(found, "tracked error on the ground, RMS", solution)
    share, whole = worst_share(motion), float(motion.feedback.sum() / motion.total.sum())
    return line, (
        f"| `{name}` | {errors['base']:.1e} | {errors['joints']:.1e} rad "
        f"| {100 * share:.2g} % | {100 * whole:.2g} % |"
    )


def in_the_air(name: str) -> str:
    solution = stc.load(name).solve()
    report = validate(solution)
    return (
        f"| `{name}` | {effort(solution)} | {max(values(report, 'open-loop drift, largest')):.1e} "
        f"| {max(values(report, 'tracked drift, largest')):.1e} "
        f"| {100 * max(values(report, 'feedback share')):.2g} % "
        f"| {max(values(report, 'inverse-dynamics residual')):.0e} |"
    )


def of_model(solution: Solution) -> str:
    """The line of a motion of a model: how far the tracked replay is from it, and what it fails."""
    report = validate(solution)
    grounded = any(line.kind == "contact" for line in solution.replay)
    name = "tracked error on the ground, RMS" if grounded else "tracked drift, largest"
    found = {metric.subject: metric.value for metric in report.metrics if metric.name == name}
    joints = max(value for subject, value in found.items() if subject != "base")
    base = f"{found['base']:.1e}" if "base" in found else "-"
    failed = sorted({metric.name for metric in report.metrics if metric.verdict == "fail"})
    return (
        f"| `{solution.name}` | {solution.n} | {len(solution.x)} | {solution.iterations} "
        f"| {values(report, 'growth of small errors')[0]:.1e} | {base} | {joints:.1e} "
        f"| {100 * max(values(report, 'feedback share')):.2g} % | {values(report, 'energy balance')[0]:.1e} "
        f"| {'; '.join(failed) or 'passed'} |"
    )


def operations(name: str) -> str:
    """What derivatives cost: the chain rule by every unknown of the motion, and what is left to compute."""
    counts = count_operations(stc.load(name).transcription()[1])
    cells = [f"{count.naive_all:.1e} | {count.shared:.1e}" for count in counts.values()]
    least = min(count.vanished(count.naive_all) for count in counts.values())
    return f"| `{name}` | {' | '.join(cells)} | {100 * (1 - least):.1g} % |"


def tables(names: Sequence[str]) -> str:
    lines = [on_the_ground(name) for name in names if name in GROUND]
    parts = [
        [
            "| motion | frames | iterations | s | open loop: base, joints | tracked: base | joints "
            "| share of the feedback, worst motor | residual |",
            "|" + " --- |" * 9,
            *[line for line, _ in lines],
        ],
        [f"Tracked, all masses and inertias {HEAVIER - 1:+.0%}:"],
        [
            "| motion | base | joints | share of the feedback, worst motor | share of the feedback, all motors |",
            "| --- | --- | --- | --- | --- |",
            *[heavy for _, heavy in lines],
        ],
        ["Motions without a moving base on the ground:"],
        [
            "| motion | frames | iterations | s | open-loop drift | tracked drift "
            "| share of the feedback, worst motor | residual |",
            "|" + " --- |" * 8,
            *[in_the_air(name) for name in names if name in OTHERS],
        ],
        [
            "Motions of models: base as a share of its travel, and the worst joint; RMS errors for motions on the "
            "ground, largest errors for others:"
        ],
        [
            "| motion | frames | unknowns | iterations | growth of errors | tracked: base | joints "
            "| share of the feedback, worst motor | energy balance | verdict |",
            "|" + " --- |" * 10,
            *[of_model(stc.load(name).solve()) for name in names if name in ROBOTS],
        ],
        ["Arithmetic operations for the derivatives over the whole motion (`stc show SPEC --stage ops`):"],
        [
            "| motion | Jacobian: naive trees | simplified and shared | Hessian: naive trees "
            "| simplified and shared | remaining, at most |",
            "|" + " --- |" * 6,
            *[operations(name) for name in names if name not in ROBOTS],
        ],
    ]
    busy = f"Times are those of the solve alone, on {os.cpu_count()} cores under a load of {os.getloadavg()[0]:.1f}."
    return "\n\n".join([*("\n".join(part) for part in parts), busy])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="MOTION", help="all by default")
    parser.add_argument("--print", action="store_true", dest="dry", help="leave docs/motions.md as it is")
    options = parser.parse_args()
    if unknown := set(options.names) - {*GROUND, *OTHERS, *ROBOTS}:
        parser.error(f"unknown motion {', '.join(sorted(unknown))}")
    text = tables(options.names or [*GROUND, *OTHERS, *ROBOTS])
    print(text)
    if not (options.dry or options.names):
        put("measured", text, PAGE)


if __name__ == "__main__":
    main()
