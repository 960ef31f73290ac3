"""Interprets tapes, for problems that would take longer to compile than to solve.

A tape becomes a list of instructions, which one function of the core (``stc/core/tapes.c``) executes for up to
:data:`CHUNK` blocks of instances at once.  This module writes the instructions: it assigns values to rows, which are
reused, and fetches varying inputs at the first use of one of their run.

Operations and functions are the same instructions as in compiled kernels, so the results have the same bits.  A
compiled kernel may therefore take over at any time.  Until then evaluations take two to three times as long.
"""

from __future__ import annotations

from array import array
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen.engine import LANES, function_numbers
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import Tape
from stc.records import dataclass

__all__ = ["CHUNK", "Instructions", "assemble"]

#: Blocks that an instruction is followed for at once: rows of 512 bytes.
CHUNK: Final = 16
ROW: Final = CHUNK * LANES

#: Numbers of an instruction: itself, where its result goes, up to three operands.
WORDS: Final = 5


@dataclass(frozen=True, eq=False)
class Instructions:
    """A tape's instructions.

    Attributes:
        words: (instructions, WORDS) int32.
        head: how many are followed once per call.
        rows: how many rows they use.
    """

    words: NDArray[np.int32]
    head: int
    rows: int

    def cells(self, takes_over: NDArray[np.int64], work: NDArray[np.int64]) -> tuple[list[int], Any]:
        """What a prepared call needs besides what machine code needs (``tape_call``), and what must stay alive.

        Args:
            takes_over: (1,), the address of machine code for the same, or 0.
            work: (1,), counts instructions times blocks.
        """
        arrays = takes_over, self.words, aligned_zeros(self.rows * ROW), work
        return [*(array.ctypes.data for array in arrays), self.head, len(self.words)], arrays


def assemble(tape: Tape, runs: Runs) -> Instructions:
    """The instructions of a tape."""
    return _Assembler(tape, runs).code()


class _Assembler:
    """Goes through a tape once, and gives rows to its values as long as they are needed.

    Long tapes have a million operations and more, so that the loop over them is written out in one function.
    """

    def __init__(self, tape: Tape, runs: Runs) -> None:
        self.tape, self.runs = tape, runs
        self.number = function_numbers()
        self.words = array("i")
        self.row = [-1] * tape.n_slots
        self.free: list[int] = []
        self.rows = 0
        self.run_rows: dict[int, int] = {}
        self.kept = runs.kept_rows(tape)
        self.lasting = tape.first_op + tape.n_uniform_ops  # slots below are there all the time, once they are

    def code(self) -> Instructions:
        tape, row, free, kept, lasting = self.tape, self.row, self.free, self.kept, self.lasting
        first_op, ops, write = tape.first_op, tape.ops, self.words.extend
        reads = list(tape.reads())
        self._once_per_call(reads)
        head = len(self.words) // WORDS
        last = [-1] * tape.n_slots
        for number, slots in reads:
            for slot in slots:
                last[slot] = number
        outputs: dict[int, list[int]] = {}
        for output, slot in enumerate(tape.outputs):
            outputs.setdefault(slot, []).append(output)
        pairs = self._pairs()
        done: set[int] = set()
        codes, store = self.number, self.number["store"]
        for number, slots in reads:
            for slot in slots:
                if row[slot] < 0:
                    self._fetch(slot)
            # The operands' rows, before they are given away to the results.
            op, a, b = ops[number]
            operands = row[a], row[b] if b >= 0 else 0, 0
            for slot in slots:
                if last[slot] == number and slot >= lasting and slot not in kept:
                    free.append(row[slot])
                    row[slot] = -1
            slot = first_op + number
            if slot in done:
                continue
            result = free.pop() if free else self._new_row()
            made: tuple[tuple[int, int], ...] = ((slot, result),)
            partner = pairs.get(slot)
            if partner is not None:
                second = free.pop() if free else self._new_row()
                made = (slot, result), (partner, second)
                done.add(partner)
                sine, cosine = (result, second) if op == "sin" else (second, result)
                write((codes["sincos"], sine, operands[0], 0, cosine))
            else:
                write((codes[op], result, *operands))
            for slot, result in made:
                if slot in outputs:
                    for output in outputs[slot]:
                        write((store, 0, result, output, 0))
                if last[slot] < 0:
                    free.append(result)
                else:
                    row[slot] = result
        for slot, where in outputs.items():
            if slot < lasting:
                if row[slot] < 0:
                    self._fetch(slot)
                for output in where:
                    write((store, 0, row[slot], output, 0))
        words = np.array(self.words, dtype=np.int32).reshape(-1, WORDS)
        return Instructions(words, head, self.rows)

    def _once_per_call(self, reads: list[tuple[int, tuple[int, ...]]]) -> None:
        tape, row, write = self.tape, self.row, self.words.extend
        varying = range(tape.n_uniform, tape.first_literal)
        needed = {slot for _, a, b in tape.ops[: tape.n_uniform_ops] for slot in (a, b)}
        needed.update(tape.outputs, *(slots for _, slots in reads))
        for slot in range(tape.first_op):
            if slot in needed and slot not in varying:
                uniform = slot < tape.n_uniform
                place = slot if uniform else slot - tape.first_literal
                name = "uniform" if uniform else "literal"
                row[slot] = self._new_row()
                write((self.number[name], row[slot], place, 0, 0))
        for number in range(tape.n_uniform_ops):
            op, a, b = tape.ops[number]
            slot = tape.first_op + number
            row[slot] = self._new_row()
            write((self.number[op], row[slot], row[a], row[b] if b >= 0 else 0, 0))

    def _pairs(self) -> dict[int, int]:
        """Sines and cosines of one angle: the slot of the first and that of the second."""
        found: dict[int, int] = {}
        first: dict[int, int] = {}
        for number in range(self.tape.n_uniform_ops, len(self.tape.ops)):
            op, a, _ = self.tape.ops[number]
            if op == "sin" or op == "cos":
                slot = self.tape.first_op + number
                if a in first:
                    found[first[a]] = slot
                else:
                    first[a] = slot
        return found

    def _new_row(self) -> int:
        """A row that nothing has been in yet."""
        self.rows += 1
        return self.rows - 1

    def _fetch(self, slot: int) -> None:
        """Give a row to an input that has not been used yet."""
        if slot in self.kept:
            self.row[slot] = row = self.free.pop() if self.free else self._new_row()
            self.words.extend((self.number["kept"], row, self.kept[slot], 0, 0))
            return
        place = self.runs.places[slot - self.tape.n_uniform]
        run, within = divmod(place, RUN)
        if run not in self.run_rows:
            self.run_rows[run] = self.rows
            self.rows += RUN
            self.words.extend((self.number["fetch"], self.run_rows[run], run, 0, 0))
        self.row[slot] = self.run_rows[run] + within
