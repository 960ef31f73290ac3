"""From the solver's result to a solution that a stranger can use."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from stc.problem import Problem
from stc.solution import ReplayChannel, Solution
from stc.solver import Result
from stc.solver.optimizers import DEFAULT
from stc.trajectory import Channel
from stc.transcription import Transcription
from stc.transcription.multipliers import multiplier_blocks
from stc.transcription.recover import Recovery
from stc.transcription.schemes import stencil_reach
from stc.transcription.statements import highest_orders

__all__ = ["collect"]


def collect(
    transcription: Transcription,
    result: Result,
    constants: Mapping[str, float],
    overrides: Mapping[str, float],
    seconds: Mapping[str, float],
    optimizer: str = DEFAULT,
) -> Solution:
    """The solution that a stranger can use: node values, multipliers and replay channels by name."""
    problem = transcription.problem
    recovery = transcription.recovery(result.x, constants)
    source = problem.source
    return Solution(
        name=problem.name,
        source=source.text,
        directory=_folder_of(source.path, Path.cwd()) if source.path else "",
        constants=constants,
        overrides=overrides,
        method=problem.method,
        time=recovery.time,
        trajectories=recovery.trajectories(),
        parameters=recovery.parameters,
        status=str(result.status.value),
        message=result.message,
        objective=result.objective,
        violation=result.violation,
        optimality=result.optimality,
        iterations=result.iterations,
        factorizations=result.factorizations,
        optimizer=optimizer,
        seconds=seconds,
        x=result.x,
        row_multipliers=result.row_multipliers,
        bound_multipliers=result.bound_multipliers,
        multipliers=multiplier_blocks(transcription, result.row_multipliers, result.bound_multipliers),
        model=problem.model,
        replay=_replay_channels(problem, recovery),
        force_frames=_force_frames(problem),
    )


@lru_cache(maxsize=16)
def _folder_of(path: str, here: Path) -> str:
    """The absolute folder of a file, of which a relative path is from ``here``."""
    return str((here / path).resolve().parent)


def _replay_channels(problem: Problem, recovery: Recovery) -> list[ReplayChannel]:
    channels = []
    for line in problem.replay:
        if line.kind == "set":
            number = np.full(problem.n + 1, recovery.number(line.body))
            mid = number[:-1] if problem.method == "hermite-simpson" else None
            channels.append(ReplayChannel(line.kind, line.path, Channel(number, number, mid)))
            continue
        value = recovery.channel(line.body)
        rate = recovery.rate(line.body, 1) if line.kind in ("joint", "compare") else None
        acceleration = recovery.rate(line.body, 2) if line.kind == "joint" else None
        channels.append(ReplayChannel(line.kind, line.path, value, rate, acceleration))
    return channels


def _force_frames(problem: Problem) -> tuple[int, int]:
    """The frames at which central differences leave no statement out."""
    highest = 0
    if problem.method == "central":
        highest = max(highest_orders(problem, [r.body for r in problem.relations]).values(), default=0)
    reach = min(stencil_reach(highest), problem.n // 2) if highest > 1 else 0
    return reach, problem.n - reach
