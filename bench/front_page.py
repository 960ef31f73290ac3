"""Measures the lamp's jump and writes the table of README.md.

python bench/front_page.py           measure, and write the table
python bench/front_page.py --print   the page stays as it is
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import stc
from stc.certification import certify
from stc.validate.contact import contact_metrics
from stc.validate.metrics import Metric
from stc.validate.replay import replay, stepping_for
from stc.validate.tracking import proportional
from stc.validate.verdict import open_setup

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

PAGE = Path(__file__).resolve().parent.parent / "README.md"

#: The motion, and all masses and inertias times this in the last tracked replay.
MOTION, HEAVIER = "luxo_jump", 1.01


@dataclass(frozen=True)
class Tracked:
    """A replay with feedback: errors (base: share of its travel, joints: rad) and shares of the feedback in torques."""

    base: float
    joints: float
    worst: float
    whole: float


@dataclass(frozen=True)
class Figures:
    """The figures of the table: errors of the base as shares of its travel, errors of joints in rad."""

    base: float
    joints: float
    end_base: float
    end_joints: float
    tracked: Tracked
    heavier: Tracked
    equations: float
    residual: float
    external: float
    order: float


def table(figures: Figures) -> str:
    """The figures as they stand in the page."""
    rows = [
        ("the torques alone", figures.base, figures.joints, "none"),
        ("the torques alone, at the end", figures.end_base, figures.end_joints, "none"),
        ("with the controller", figures.tracked.base, figures.tracked.joints, _shares(figures.tracked)),
        (
            f"with the controller, all masses {100 * (HEAVIER - 1):.0f} % wrong",
            figures.heavier.base,
            figures.heavier.joints,
            _shares(figures.heavier),
        ),
    ]
    lines = [
        f"| {name} | {_short(base)} | {_short(joints)} | {share} |" for name, base, joints, share in rows
    ]
    rest = (
        f"The equations of motion of the spec and of MuJoCo differ by {figures.equations:.0e}, and the forces of the "
        f"solution\nfrom those that MuJoCo computes for its accelerations by {figures.residual:.0e}, as shares of the "
        "largest. If the solved contact forces act in place\nof the floor, no joint is ever more than "
        f"{_short(figures.external)} rad off, and this error falls with the step h like h^{figures.order:.1f}."
    )
    head = "| replay | error of the base | of the joints, rad | controller's share of the torque, worst motor (all) |"
    return "\n".join([head, "| --- | --- | --- | --- |", *lines, "", rest])


def _short(value: float) -> str:
    """Two digits, without the zero that Python puts before a small exponent."""
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def _shares(tracked: Tracked) -> str:
    return f"{100 * tracked.worst:.2g} % ({100 * tracked.whole:.2g} %)"


def _errors(metrics: Sequence[Metric], name: str, motors: Sequence[str]) -> tuple[float, float]:
    """Of the base, and the root of the mean square of the joints with a motor."""
    found = {metric.subject: metric.value for metric in metrics if metric.name == name}
    squares = [found[f"joint {motor}"] ** 2 for motor in motors]
    return found["base"], math.sqrt(sum(squares) / len(squares))


def _largest(metrics: Sequence[Metric], name: str, unit: str | None = None) -> float:
    return max(metric.value for metric in metrics if metric.name == name and unit in (None, metric.unit))


def measure() -> Figures:
    """Solve the motion, and judge it as ``stc validate --equations`` does."""
    solution = stc.load(MOTION).solve()
    certificate = certify(solution, equations=True)
    metrics = certificate.metrics
    motors = [line.name for line in solution.replay if line.kind == "actuator"]
    tracked = certificate.replays.tracked
    assert tracked is not None

    setup = open_setup(solution)
    law = proportional(setup)
    setup.compiled.body_mass *= HEAVIER
    setup.compiled.body_inertia *= HEAVIER
    other = replay(setup, stepping_for(setup).time_step, feedback=law)
    name = "tracked error on the ground, RMS"
    shares = [
        (float(max(one.feedback / one.total)), float(one.feedback.sum() / one.total.sum()))
        for one in (tracked, other)
    ]

    external = "external drift, largest"
    coarse = certify(stc.load(MOTION).solve(k=1)).metrics
    fine = certify(stc.load(MOTION).solve(k=2)).metrics
    return Figures(
        *_errors(metrics, "open-loop error on the ground, RMS", motors),
        *_errors(metrics, "open-loop error on the ground, at the end", motors),
        Tracked(*_errors(metrics, name, motors), *shares[0]),
        Tracked(*_errors(contact_metrics("tracked", setup, other), name, motors), *shares[1]),
        _largest(metrics, "equations of motion"),
        _largest(metrics, "inverse-dynamics residual"),
        _largest(metrics, external, "rad"),
        math.log2(_largest(coarse, external, "rad") / _largest(fine, external, "rad")),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--print", action="store_true", dest="dry", help="leave README.md as it is")
    options = parser.parse_args()
    text = table(measure())
    print(text)
    if not options.dry:
        put("measured", text, PAGE)


if __name__ == "__main__":
    main()
