"""Perturbed replays, each kind of perturbation a task of its own that any process can carry out."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import replace

from stc.records import dataclass
from stc.solution import Solution
from stc.validate import limits
from stc.validate.robustness import KINDS, Robustness
from stc.validate.robustness import robustness as replayed
from stc.validate.verdict import open_setup
from stc.workers import Workers

__all__ = ["robustness"]


def robustness(
    motion: Solution | str | os.PathLike[str],
    samples: int = limits.PERTURBED_SAMPLES,
    seed: int = 0,
    kinds: Sequence[str] = tuple(KINDS),
    *,
    force: bool = False,
    workers: int | None = 1,
) -> Robustness:
    """As :func:`stc.validate.robustness.robustness`, on several processes or a cluster.

    What comes out is the same however many there are: each kind has random numbers of its own.

    Args:
        motion: a solution, or the path of a saved one.
        samples, seed, kinds: as there.
        force: whether one is replayed that is not optimal.
        workers: number of processes; None for one per processor, or what ``joblib.parallel_config`` says.  MuJoCo
            already shares the replays of a kind among the processors of a machine.

    Raises:
        UsageError, ModelError, NotOptimalError: as there and as :func:`stc.validate.verdict.open_setup`.
        WorkerError: worker processes were lost again and again.
    """
    begin = time.perf_counter()
    with Workers(workers) as side_by_side:
        tasks = [_Task(motion, samples, seed, kind, force) for kind in kinds]
        found = list(side_by_side.in_order(_replayed, tasks))
    envelopes = [envelope for one in found for envelope in one.envelopes]
    return replace(found[0], envelopes=envelopes, seconds=time.perf_counter() - begin)


@dataclass(frozen=True, slots=True)
class _Task:
    motion: Solution | str | os.PathLike[str]
    samples: int
    seed: int
    kind: str
    force: bool


def _replayed(task: _Task) -> Robustness:
    return replayed(open_setup(task.motion, force=task.force), task.samples, task.seed, [task.kind])
