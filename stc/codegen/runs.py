"""Which varying inputs of a tape lie beside each other in the workspace, so that kernels fetch them together.

To fetch one number for each lane takes more instructions than anything that is done with it.  But what a tape reads
are mostly neighbours, in the same order whatever the instance: the unknowns of a frame, the multipliers of its rows,
the data of a node.  So a kernel reads :data:`RUN` doubles at once for each lane, and transposes what it has read, in a
quarter of the instructions.  An input without neighbours is a run of its own.

Where neighbours are apart at a few instances, as on both sides of a jump, a copy of them is kept at the end of the
workspace, where they are together.

What another kernel has found for the same instances needs none of this: it lies in blocks of lanes already.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stc.codegen.tape import Tape
from stc.records import dataclass

#: How many doubles are read at once: up to so many, less one, after the last that is wanted.
RUN: Final = 4

#: Inputs that are together at all instances but one in so many are a run.
_APART: Final = 4

#: Instances that tell where inputs mostly are.
_SAMPLE: Final = 9

_Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of a tape's varying inputs.

    Attributes:
        places: per varying input ``RUN * run + place within the run``, -1 where it is not fetched.
        count: number of runs.
        kept: inputs that follow those of ``places`` are outputs of another kernel for the same instances: of this
            one and the next ones.
        kept_width: how many outputs that kernel has, 0 where there is none.
    """

    places: tuple[int, ...]
    count: int
    kept: int = 0
    kept_width: int = 0

    @classmethod
    def alone(cls, n_varying: int) -> Runs:
        """The runs of inputs of which no two are fetched together: one run for each."""
        return cls(tuple(range(0, RUN * n_varying, RUN)), n_varying)

    def digest(self) -> str:
        """The content, as text."""
        return f"{RUN} {self.count} {' '.join(map(str, self.places))} kept {self.kept} {self.kept_width}"

    def kept_rows(self, tape: Tape) -> dict[int, int]:
        """For each input slot that holds an output of the values kernel: the number of that output."""
        own = len(self.places)
        return {tape.n_uniform + v: self.kept + v - own for v in range(own, tape.n_varying)}


class Copies:
    """The runs that are copied to the end of the workspace, from ``start`` on, each once."""

    def __init__(self, start: int) -> None:
        self._start = start
        self._places: dict[tuple[int, ...], int] = {}

    @property
    def end(self) -> int:
        """The position in the workspace after the last copy."""
        return self._start + RUN * len(self._places)

    def place(self, run: tuple[int, ...]) -> int:
        """The position of the copy of a run, which is given by the positions of its numbers, -1 for none."""
        return self._places.setdefault(run, self.end)

    def tables(self, runs: Iterable[tuple[int, ...]]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """The positions of what is copied for these runs, and where to. (k,) each."""
        pairs = [
            (position, self._places[run] + k)
            for run in dict.fromkeys(runs)
            for k, position in enumerate(run)
            if position >= 0
        ]
        table = np.array(pairs, np.int32).reshape(-1, 2).T
        return np.ascontiguousarray(table[0]), np.ascontiguousarray(table[1])


class Found(NamedTuple):
    """Runs, where each of them begins for each instance, (runs, k), and those that are copied."""

    runs: Runs
    starts: _Ints
    copied: list[tuple[int, ...]]


class _Run:
    """A run under construction.

    Attributes:
        begin: where its first input is relative to others, at most instances.
        members: by place within the run, the position of an input for each instance.
        apart: instances where they are not together.
    """

    def __init__(self, begin: int, first: _Ints) -> None:
        self.begin = begin
        self.members = {0: first}
        self.apart = np.zeros(len(first), bool)

    def takes(self, within: int, positions: _Ints) -> bool:
        """Whether an input belongs to the run, which it has joined then."""
        if within in self.members:
            return np.array_equal(positions, self.members[within])
        apart = self.apart | (positions != self.members[0] + within)
        if np.count_nonzero(apart) * _APART > len(apart):
            return False
        self.members[within], self.apart = positions, apart
        return True

    def at(self, instance: int) -> tuple[int, ...]:
        """The positions of what is in it, -1 for none."""
        return tuple(int(self.members[k][instance]) if k in self.members else -1 for k in range(RUN))


def find_runs(tape: Tape, positions: _Ints, copies: Copies, kept: tuple[int, int] = (0, 0)) -> Found:
    """Runs of the inputs that a tape uses.

    Args:
        tape: whose inputs they are.
        positions: (inputs, k) where each is in the workspace, for each instance.
        copies: receives what is to be copied.
        kept: where inputs after these are among another kernel's outputs, and how many outputs that has.
    """
    wanted = [v for v in used_inputs(tape) if v < len(positions)]
    size = positions.shape[1]
    if size == 0 or not wanted:
        return Found(Runs((-1,) * len(positions), 0, *kept), np.zeros((0, size), np.int64), [])
    sample = positions[wanted][:, np.linspace(0, size - 1, _SAMPLE).astype(np.int64)]
    mostly = np.sort(sample - sample[:1], axis=1)[:, _SAMPLE // 2]
    found: list[_Run] = []
    places = [-1] * len(positions)
    for k in np.argsort(mostly, kind="stable").tolist():
        v, begin = wanted[k], int(mostly[k])
        for number in range(max(len(found) - RUN, 0), len(found)):
            within = begin - found[number].begin
            if within < RUN and found[number].takes(within, positions[v]):
                break
        else:
            number, within = len(found), 0
            found.append(_Run(begin, positions[v]))
        places[v] = RUN * number + within
    starts = np.array([run.members[0] for run in found])
    copied = []
    for run, at in zip(found, starts, strict=True):
        for instance in np.flatnonzero(run.apart).tolist():
            copied.append(run.at(instance))
            at[instance] = copies.place(copied[-1])
    return Found(Runs(tuple(places), len(found), *kept), starts, copied)


def used_inputs(tape: Tape) -> list[int]:
    """The varying inputs that a tape reads or passes on, in order."""
    read: set[int] = set(tape.outputs)
    for _, a, b in tape.ops[tape.n_uniform_ops :]:
        read.add(a)
        read.add(b)
    return [v for v in range(tape.n_varying) if tape.n_uniform + v in read]
