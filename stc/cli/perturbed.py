"""The command ``stc validate --robustness``: many replays of a motion with small perturbations."""

from __future__ import annotations

import sys

from stc.cli import console, jobs, record
from stc.cli.options import SolveOptions
from stc.cli.statuses import BAD, GOOD
from stc.errors import UsageError


def run(
    target: str,
    options: SolveOptions,
    *,
    force: bool,
    samples: int | None,
    seed: int | None,
    workers: int | None,
    as_json: bool,
) -> int:
    """Replay the motion and show the envelope; good when the unperturbed replay is not lost.

    Raises:
        UsageError: a motion that cannot be replayed with perturbations, or a negative seed.
    """
    from stc.studies.perturbed import robustness
    from stc.validate import limits

    seed = seed or 0
    if seed < 0:
        raise UsageError(f"--seed must not be negative, but is {seed}")
    outcome, motion = jobs.to_show(target, options, as_json)
    jobs.require_optimal(outcome.solution, "replayed", force)
    samples = limits.PERTURBED_SAMPLES if samples is None else samples
    found = robustness(motion, samples, seed, force=force, workers=workers or 1)
    good = not found.message
    if as_json:
        facts = {**record.blank("ok" if good else "failed", found.message), "name": found.spec}
        record.write({**facts, "robustness": found.to_dict()})
    else:
        console.rich_console(width=None if sys.stdout.isatty() else console.WIDE).print(found)
    return GOOD if good else BAD
