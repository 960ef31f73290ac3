"""From the solver's result to a complete solution."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from stc.optimizers import DEFAULT
from stc.problem import FrameRange, Problem, VariableRef
from stc.recorded_files import record
from stc.records import dataclass
from stc.solution import ReplayChannel, Solution
from stc.solver import Result
from stc.symbolic.expr import Expr, symbols
from stc.trajectory import Channel, FloatArray
from stc.transcription import Transcription
from stc.transcription.grid import Nodes
from stc.transcription.multipliers import multiplier_blocks
from stc.transcription.recover import Recovery
from stc.transcription.schemes import stencil_reach
from stc.transcription.stated import Stated

__all__ = ["collect", "motion_at"]


def collect(
    transcription: Transcription,
    result: Result,
    constants: Mapping[str, float],
    overrides: Mapping[str, float],
    seconds: Mapping[str, float],
    optimizer: str = DEFAULT,
) -> Solution:
    """The solution with all names: node values, multipliers and replay channels."""
    source, files = transcription.problem.source, transcription.problem.model_files
    return Solution(
        **motion_at(transcription, result.x, constants),
        directory=_folder_of(source.path, Path.cwd()) if source.path else "",
        files=files if files or source.model_file is None else record(Path(source.model_file)),
        constants=constants,
        overrides=overrides,
        status=str(result.status.value),
        message=result.message,
        objective=result.objective,
        violation=result.violation,
        optimality=result.optimality,
        iterations=result.iterations,
        factorizations=result.factorizations,
        strategy=result.strategy,
        optimizer=optimizer,
        seconds=seconds,
        row_multipliers=result.row_multipliers,
        bound_multipliers=result.bound_multipliers,
        multipliers=multiplier_blocks(transcription, result.row_multipliers, result.bound_multipliers),
    )


def motion_at(stated: Stated, x: FloatArray, constants: Mapping[str, float]) -> dict[str, Any]:
    """The attributes of a :class:`Solution` that follow from a decision vector, (N,), by name."""
    problem = stated.problem
    recovery = stated.recovery(x, constants)
    return {
        "name": problem.name,
        "source": problem.source.written,
        "method": problem.method,
        "time": recovery.time,
        "trajectories": recovery.trajectories(),
        "derived": recovery.derived(),
        "parameters": recovery.parameters,
        "x": x,
        "model": problem.model,
        "additions": problem.additions,
        "replay": _replay_channels(problem, recovery),
        **_data_of(problem, recovery),
        "force_frames": _force_frames(stated),
    }


def _data_of(problem: Problem, recovery: Recovery) -> dict[str, Any]:
    """The files of a spec's data, and notes on tables that are used outside of their numbers."""
    if not problem.data:
        return {}
    from stc.data_sets import files_of
    from stc.transcription.outside import used_outside

    return {"data": files_of(problem.data), "outside": used_outside(recovery)}


@lru_cache(maxsize=16)
def _folder_of(path: str, here: Path) -> str:
    """The absolute folder of a file, of which a relative path is from ``here``."""
    return str((here / path).resolve().parent)


def _replay_channels(problem: Problem, recovery: Recovery) -> list[ReplayChannel]:
    channels = []
    for line in problem.replay:
        if line.kind == "set":
            value = recovery.number(line.body)
            if value == line.usual:
                continue
            number = np.full(problem.n + 1, value)
            mid = number[:-1] if problem.method == "hermite-simpson" else None
            channels.append(ReplayChannel(line.kind, line.path, Channel(number, number, mid)))
            continue
        course = recovery.channel(line.body)
        rate = recovery.rate(line.body, 1) if line.kind in ("joint", "compare") else None
        acceleration = recovery.rate(line.body, 2) if line.kind == "joint" else None
        channels.append(ReplayChannel(line.kind, line.path, course, rate, acceleration))
    return channels


def _force_frames(stated: Stated) -> tuple[int, int]:
    """The frames at which the equations of motion hold: all except those that central differences do not reach."""
    if stated.problem.method != "central":
        return 0, stated.problem.n
    found: tuple[int, int] = stated.remembered("frames of motion", _frames_of_motion)
    return found


def _frames_of_motion(stated: Stated) -> tuple[int, int]:
    """The first and the last frame at which the equations of motion hold.

    Central differences do not reach the ends.  An equality on several frames is an equation of motion if it

    - contains a coordinate's second derivative, and no higher one of a coordinate, or comes from a Lagrangian; or
    - contains a force at its own frame alone, so that only this equality determines the force; or
    - contains a coordinate at neighbouring frames, if no equality contains a force.

    Coordinates are what the joint lines of the replay are made of; forces are what its actuators and outer forces
    are made of, and what laws that hold on all frames tie to these.  A force line that is made of accelerations
    itself counts like an equation.  Only ranges that begin or end where derivatives or indices end their reach are
    cut off by it.
    """
    problem, n = stated.problem, stated.problem.n
    lines = [line for line in problem.replay if line.kind in ("actuator", "apply", "contact")]
    joints = [line.body for line in problem.replay if line.kind == "joint"]
    whole = FrameRange(0, n)
    coordinates = _names(stated, joints) if joints else set(problem.variables)
    forces = _names(stated, [line.body for line in lines]) - coordinates
    equations = [r for r in problem.relations if r.is_equality and r.range.first < r.range.last]
    stretches = [_Stretch.of(stated, r.body, r.range) for r in equations]
    laws = [each.names - coordinates for each in stretches if (each.first, each.last) == (0, n)]
    grown = True
    while grown:
        tied = set(forces).union(*(law for law in laws if law & forces))
        forces, grown = tied, tied != forces
    cut = [_Stretch.of(stated, line.body, whole) for line in lines]
    cut += [
        each
        for each, equation in zip(stretches, equations, strict=True)
        if equation.coordinate or each.tells_motion(coordinates, forces)
    ]
    first = max((each.first for each in cut if each.range.first <= each.first), default=0)
    last = min((each.last for each in cut if each.range.last >= each.last), default=n)
    return min(first, n // 2), max(last, n - n // 2)


def _names(stated: Stated, bodies: list[Expr]) -> set[str]:
    """The variables in expressions, with definitions expanded."""
    whole = FrameRange(0, stated.problem.n)
    return set[str]().union(*(_Stretch.of(stated, body, whole).names for body in bodies))


@dataclass(frozen=True, slots=True)
class _Stretch:
    """The names that an expression reads, and the frames ``first..last`` at which they are within the motion.

    With another definition at each end of ``range`` each end is its own.
    """

    range: FrameRange
    keys: frozenset[VariableRef]
    first: int
    last: int

    @classmethod
    def of(cls, stated: Stated, body: Expr, where: FrameRange) -> _Stretch:
        grid, layout = stated.grid, stated.layout
        every = np.arange(grid.n + 1)
        nodes = Nodes(2 * every, np.zeros_like(every))
        found: set[VariableRef] = set()
        ends = []
        for expanded, at in stated.lowering.expand(body, grid.nodes(where)):
            keys = [key for key in symbols(expanded) if isinstance(key, VariableRef)]
            found.update(keys)
            fits = np.ones(len(every), bool)
            for key in keys:
                fits &= layout.reachable(key, nodes, stencil_reach(key.order) if key.order > 1 else 0)
            held = np.flatnonzero(fits)
            if len(held):
                ends.append((at.frame[0], at.frame[-1], int(held[0]), int(held[-1])))
        first = max((low for begin, _, low, _ in ends if begin == where.first), default=0)
        last = min((high for _, end, _, high in ends if end == where.last), default=grid.n)
        return cls(where, frozenset(found), first, last)

    @property
    def names(self) -> set[str]:
        return {key.name for key in self.keys}

    def tells_motion(self, coordinates: set[str], forces: set[str]) -> bool:
        """Whether an equality is an equation of motion; see :func:`_frames_of_motion`."""
        of_coordinates = [key for key in self.keys if key.name in coordinates]
        if max((key.order for key in of_coordinates), default=0) == 2:
            return True
        if not forces:
            return any(key.scale != 0 and (key.scale, key.shift) != (1, 0) for key in of_coordinates)
        elsewhere = {key.name for key in self.keys if key != VariableRef(key.name)}
        return bool((self.names & forces) - elsewhere)
