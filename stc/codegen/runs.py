"""Which varying inputs of a tape lie beside each other in the workspace, so that kernels fetch them together.

To fetch one number for each lane takes more instructions than anything that is done with it.  But what a tape reads
are mostly neighbours, in the same order whatever the instance: the unknowns of a frame, the multipliers of its rows,
the data of a node.  So a kernel reads :data:`RUN` doubles at once for each lane, and transposes what it has read, in a
quarter of the instructions.  An input without neighbours is a run of its own.

What another kernel has found for the same instances needs none of this: it lies in blocks of lanes already.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from stc.codegen.tape import Tape
from stc.records import dataclass

#: How many doubles are read at once: up to so many, less one, after the last that is wanted.
RUN: Final = 4

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


def find_runs(tape: Tape, positions: _Ints, kept: tuple[int, int] = (0, 0)) -> tuple[Runs, _Ints]:
    """Runs of the inputs that a tape uses, and where each of them begins for each instance, (runs, k).

    Args:
        tape: whose inputs they are.
        positions: (inputs, k) where each is in the workspace, for each instance.
        kept: where inputs after these are among another kernel's outputs, and how many outputs that has.
    """
    size = positions.shape[1]
    wanted = [v for v in used_inputs(tape) if v < len(positions)] if size else []
    starts: list[_Ints] = []
    places = [-1] * len(positions)
    for v in sorted(wanted, key=lambda v: int(positions[v, size // 2])):
        for number in range(max(len(starts) - RUN, 0), len(starts)):
            within = int(positions[v, 0] - starts[number][0])
            if 0 <= within < RUN and np.array_equal(positions[v], starts[number] + within):
                break
        else:
            number, within = len(starts), 0
            starts.append(positions[v])
        places[v] = RUN * number + within
    return Runs(tuple(places), len(starts), *kept), np.array(starts).reshape(len(starts), size)


def used_inputs(tape: Tape) -> list[int]:
    """The varying inputs that a tape reads or passes on, in order."""
    read: set[int] = set(tape.outputs)
    for _, a, b in tape.ops[tape.n_uniform_ops :]:
        read.add(a)
        read.add(b)
    return [v for v in range(tape.n_varying) if tape.n_uniform + v in read]
