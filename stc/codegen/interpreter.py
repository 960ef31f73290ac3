"""Tapes run as they are: what a problem begins with whose compilation would take longer than its solve.

A tape becomes a list of instructions, and one function, compiled when the package is built, goes through it for up to
:data:`CHUNK` blocks of instances at once, so that to look at an instruction takes less than to follow it.  Values are
in rows, one number for each instance:

    head    once per call: uniform inputs and literals spread over a row, uniform operations
    body    per chunk: runs of varying inputs fetched at the first use of one of them, operations, outputs stored

Sums take in products where compiled kernels do (:mod:`stc.codegen.fusion`), and functions are the same instructions,
so that the results are the same bits: a kernel may be compiled, and take over, whenever that is worth it.  Until then
two to three times as long is spent on evaluations.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache as only_once
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.engine import LANES
from stc.codegen.fixed import FixedModule
from stc.codegen.fusion import find_fused, reads_of
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import CIRCULAR, CLIP, LOOKUPS, OPERATORS, REACHES, READ, Tape
from stc.records import dataclass

__all__ = ["CHUNK", "Code", "assemble", "entry", "interpreter_ir", "module"]

#: Blocks that an instruction is followed for at once: rows of 512 bytes.
CHUNK: Final = 16
ROW: Final = CHUNK * LANES

#: The instructions, by number: those that move values, those of tapes, and those for two of a tape's.
MOVES: Final = ("uniform", "literal", "fetch", "kept", "store")
PAIRS: Final = ("fma", "fms", "fnma", "sincos")
INSTRUCTIONS: Final = (*MOVES, *OPERATORS, *LOOKUPS, *PAIRS)
NUMBER: Final = {name: number for number, name in enumerate(INSTRUCTIONS)}
#: Numbers of an instruction: itself, where its result goes, up to three operands.
WORDS: Final = 5


@dataclass(frozen=True, eq=False)
class Code:
    """A tape's instructions.

    Attributes:
        words: (instructions, WORDS) int32.
        head: how many are followed once per call.
        literals: (k,).
        rows: how many rows they use.
    """

    words: NDArray[np.int32]
    head: int
    literals: NDArray[np.float64]
    rows: int

    def cells(
        self, tape: Tape, runs: Runs, takes_over: NDArray[np.int64], work: NDArray[np.int64]
    ) -> tuple[list[int], Any]:
        """What a prepared call needs besides a kernel's arguments, and what must stay alive meanwhile.

        Args:
            takes_over: (1,), the address of the compiled kernel's entry for prepared calls, or 0.
            work: (1,), counts instructions times blocks.
        """
        rows = aligned_zeros(self.rows * ROW)
        arrays = takes_over, self.words, self.literals, rows, work
        strides = 4 * LANES * runs.count, 8 * LANES * len(tape.outputs), 8 * LANES * runs.kept_width
        addresses = [array.ctypes.data for array in arrays]
        return [*addresses, self.head, len(self.words), *strides], arrays


def assemble(tape: Tape, runs: Runs, fused: bool) -> Code:
    """The instructions of a tape.

    Args:
        fused: the machine has fused multiply-add instructions.
    """
    return _Assembler(tape, runs, fused).code()


class _Assembler:
    """Goes through a tape once, and gives rows to its values as long as they are needed."""

    def __init__(self, tape: Tape, runs: Runs, fused: bool) -> None:
        self.tape, self.runs = tape, runs
        self.fused = find_fused(tape) if fused else {}
        self.words: list[tuple[int, int, int, int, int]] = []
        self.row: dict[int, int] = {}
        self.free: list[int] = []
        self.rows = 0
        self.run_rows: dict[int, int] = {}
        self.kept = runs.kept_rows(tape)
        self.lasting = tape.first_op + tape.n_uniform_ops  # slots below are there all the time, once they are

    def code(self) -> Code:
        tape = self.tape
        begin, first_op = tape.n_uniform_ops, tape.first_op
        reads = reads_of(tape, self.fused)
        self._once_per_call(reads)
        head = len(self.words)
        last: dict[int, int] = {}
        for number, slots in enumerate(reads, begin):
            for slot in slots:
                last[slot] = number
        outputs: dict[int, list[int]] = {}
        for row, slot in enumerate(tape.outputs):
            outputs.setdefault(slot, []).append(row)
        pairs = self._pairs()
        done: set[int] = set()
        for number, slots in enumerate(reads, begin):
            if not slots:
                continue
            rows = [self._operand(slot) for slot in slots]
            slot = first_op + number
            made = [slot]
            for read in slots:
                if last[read] == number and read >= self.lasting and read not in self.kept:
                    self.free.append(self.row.pop(read))
            if slot not in done:
                partner = pairs.get(slot)
                if partner is not None:
                    made.append(partner)
                    done.add(partner)
                results = [self._new_row() for _ in made]
                self._emit(number, dict(zip(slots, rows, strict=True)), results)
                for one, result in zip(made, results, strict=True):
                    self.row[one] = result
                    for output in outputs.get(one, ()):
                        self.words.append((NUMBER["store"], 0, result, output, 0))
                    if one not in last:
                        self.free.append(self.row.pop(one))
        for slot, where in outputs.items():
            if slot < self.lasting:
                for output in where:
                    self.words.append((NUMBER["store"], 0, self._operand(slot), output, 0))
        words = np.array(self.words, dtype=np.int32).reshape(-1, WORDS)
        return Code(words, head, np.array([*tape.constants, 0.0]), self.rows)

    def _once_per_call(self, reads: list[tuple[int, ...]]) -> None:
        tape = self.tape
        varying = range(tape.n_uniform, tape.first_literal)
        needed = {slot for _, a, b in tape.ops[: tape.n_uniform_ops] for slot in (a, b)}
        needed.update(tape.outputs, *reads)
        for slot in range(tape.first_op):
            if slot in needed and slot not in varying:
                uniform = slot < tape.n_uniform
                place = slot if uniform else slot - tape.first_literal
                name = "uniform" if uniform else "literal"
                self.row[slot] = self._new_row()
                self.words.append((NUMBER[name], self.row[slot], place, 0, 0))
        for number in range(tape.n_uniform_ops):
            op, a, b = tape.ops[number]
            slot = tape.first_op + number
            self.row[slot] = self._new_row()
            self.words.append((NUMBER[op], self.row[slot], self.row[a], self.row[b] if b >= 0 else 0, 0))

    def _pairs(self) -> dict[int, int]:
        """Sines and cosines of one angle: the slot of the first and that of the second."""
        found: dict[int, int] = {}
        first: dict[int, int] = {}
        for number in range(self.tape.n_uniform_ops, len(self.tape.ops)):
            op, a, _ = self.tape.ops[number]
            if op in ("sin", "cos"):
                slot = self.tape.first_op + number
                if a in first:
                    found[first[a]] = slot
                else:
                    first[a] = slot
        return found

    def _new_row(self) -> int:
        if self.free:
            return self.free.pop()
        self.rows += 1
        return self.rows - 1

    def _operand(self, slot: int) -> int:
        """The row of a value, fetched where it is an input that has not been used yet."""
        known = self.row.get(slot)
        if known is not None:
            return known
        if slot in self.kept:
            self.row[slot] = row = self._new_row()
            self.words.append((NUMBER["kept"], row, self.kept[slot], 0, 0))
            return row
        place = self.runs.places[slot - self.tape.n_uniform]
        run, within = divmod(place, RUN)
        if run not in self.run_rows:
            self.run_rows[run] = self.rows
            self.rows += RUN
            self.words.append((NUMBER["fetch"], self.run_rows[run], run, 0, 0))
        self.row[slot] = row = self.run_rows[run] + within
        return row

    def _emit(self, number: int, row: dict[int, int], results: list[int]) -> None:
        one = self.fused.get(number)
        if one is not None:
            name = "fnma" if one.negates_product else "fms" if one.negates_other else "fma"
            self.words.append((NUMBER[name], results[0], row[one.first], row[one.second], row[one.other]))
            return
        op, a, b = self.tape.ops[number]
        if len(results) == 2:
            sine, cosine = results if op == "sin" else results[::-1]
            self.words.append((NUMBER["sincos"], sine, row[a], 0, cosine))
            return
        self.words.append((NUMBER[op], results[0], row[a], row[b] if b >= 0 else 0, 0))


# ---- the function that goes through them ------------------------------------------------------------------

_CELLS: Final = (
    ("workspace", "ptr"), ("uniform", "ptr"), ("index", "ptr"), ("out", "ptr"), ("kept", "ptr"), ("blocks", "i64"),
    ("switch", "ptr"), ("code", "ptr"), ("literals", "ptr"), ("rows", "ptr"), ("work", "ptr"), ("head", "i64"),
    ("total", "i64"), ("index.stride", "i64"), ("out.stride", "i64"), ("kept.stride", "i64"),
)  # fmt: skip


def interpreter_ir(fused: bool) -> str:
    """The LLVM module of the function, ``interpret``, which takes the address of a prepared call's cells."""
    from stc.codegen.vector import PREFETCH, Vector

    unused: list[str] = []
    declarations = Vector(unused, LANES, fused, "").declarations()
    lines = ["define void @interpret(ptr %cells) nounwind {", "entry:"]
    for place, (name, type_) in enumerate(_CELLS):
        lines.append(f"  %{name}.at = getelementptr inbounds i64, ptr %cells, i64 {place}")
        lines.append(f"  %{name} = load {type_}, ptr %{name}.at, align 8")
    lines += [
        "  %compiled = load i64, ptr %switch, align 8",
        "  %is.compiled = icmp ne i64 %compiled, 0",
        "  br i1 %is.compiled, label %hand.over, label %count",
        "hand.over:",
        "  %function = inttoptr i64 %compiled to ptr",
        "  call void %function(ptr %cells)",
        "  ret void",
        "count:",
        "  %body = sub i64 %total, %head",
        "  %more.work = mul i64 %body, %blocks",
        "  %before = load i64, ptr %work, align 8",
        "  %after = add i64 %before, %more.work",
        "  store i64 %after, ptr %work, align 8",
        "  br label %pass",
        # The first pass is that of the head, the others are those of a chunk each.
        "pass:",
        "  %block = phi i64 [ 0, %count ], [ %block.next, %pass.end ]",
        "  %is.head = phi i1 [ true, %count ], [ false, %pass.end ]",
        "  %begin = phi i64 [ 0, %count ], [ %head, %pass.end ]",
        "  %end = phi i64 [ %head, %count ], [ %total, %pass.end ]",
        "  %left = sub i64 %blocks, %block",
        f"  %is.part = icmp slt i64 %left, {CHUNK}",
        f"  %size = select i1 %is.part, i64 %left, i64 {CHUNK}",
        "  %index.skipped = mul i64 %block, %index.stride",
        "  %index.here = getelementptr inbounds i8, ptr %index, i64 %index.skipped",
        "  %out.skipped = mul i64 %block, %out.stride",
        "  %out.here = getelementptr inbounds i8, ptr %out, i64 %out.skipped",
        "  %kept.skipped = mul i64 %block, %kept.stride",
        "  %kept.here = getelementptr inbounds i8, ptr %kept, i64 %kept.skipped",
        "  br label %next",
        "next:",
        "  %at = phi i64 [ %begin, %pass ], [ %at.next, %followed ]",
        "  %has.next = icmp slt i64 %at, %end",
        "  br i1 %has.next, label %instruction, label %pass.end",
        "pass.end:",
        f"  %block.after = add i64 %block, {CHUNK}",
        "  %block.next = select i1 %is.head, i64 0, i64 %block.after",
        "  %unfinished = icmp slt i64 %block.next, %blocks",
        "  br i1 %unfinished, label %pass, label %done",
        "done:",
        "  ret void",
        "instruction:",
        f"  %word.at = mul i64 %at, {4 * WORDS}",
        "  %word = getelementptr inbounds i8, ptr %code, i64 %word.at",
    ]
    for k, name in enumerate(("op", "d", "a", "b", "c")):
        lines.append(f"  %{name}.word.at = getelementptr inbounds i32, ptr %word, i64 {k}")
        lines.append(f"  %{name}.word = load i32, ptr %{name}.word.at, align 4")
        if k:
            lines.append(f"  %{name}.number = sext i32 %{name}.word to i64")
            lines.append(f"  %{name}.skipped = mul i64 %{name}.number, {8 * ROW}")
            lines.append(f"  %{name} = getelementptr inbounds i8, ptr %rows, i64 %{name}.skipped")
    lines.append("  switch i32 %op.word, label %followed [")
    lines += [f"    i32 {number}, label %{name}.begin" for number, name in enumerate(INSTRUCTIONS)]
    lines.append("  ]")
    for name in INSTRUCTIONS:
        lines += _instruction(name, fused)
    lines += ["followed:", "  %at.next = add i64 %at, 1", "  br label %next", "}", ""]
    return declarations + PREFETCH + "\n" + "\n".join(lines)


def _instruction(name: str, fused: bool) -> list[str]:
    """The loop that follows one instruction, block by block."""
    from stc.codegen.fetching import fetch
    from stc.codegen.vector import Vector

    lines: list[str] = []
    v = Vector(lines, LANES, fused, f"{name}.")
    size = 8 * LANES
    before: list[str] = []
    ahead = Vector(before, LANES, fused, f"{name}.once.")

    def spread(base: str) -> str:
        pointer = ahead.let(f"getelementptr inbounds double, ptr %{base}, i64 %a.number")
        value = ahead.let(f"load double, ptr {pointer}, align 8")
        first = ahead.let(f"insertelement {v.f} poison, double {value}, i64 0")
        return ahead.let(f"shufflevector {v.f} {first}, {v.f} poison, <{LANES} x i32> zeroinitializer")

    def load(row: str) -> str:
        pointer = v.let(f"getelementptr inbounds i8, ptr %{row}, i64 %{name}.place")
        return v.let(f"load {v.f}, ptr {pointer}, align {size}")

    def store(row: str, value: str, skipped: int = 0) -> None:
        pointer = v.let(f"getelementptr inbounds i8, ptr %{row}, i64 %{name}.place")
        if skipped:
            pointer = v.let(f"getelementptr inbounds i8, ptr {pointer}, i64 {skipped}")
        lines.append(f"  store {v.f} {value}, ptr {pointer}, align {size}")

    def beside(base: str, place: str) -> str:
        """Where a block has a row of outputs."""
        skipped = v.let(f"mul i64 %{name}.k, %{base}.stride")
        pointer = v.let(f"getelementptr inbounds i8, ptr %{base}.here, i64 {skipped}")
        within = v.let(f"mul i64 %{place}.number, {size}")
        return v.let(f"getelementptr inbounds i8, ptr {pointer}, i64 {within}")

    if name == "uniform":
        store("d", spread("uniform"))
    elif name == "literal":
        store("d", spread("literals"))
    elif name == "fetch":
        skipped = v.let(f"mul i64 %{name}.k, %index.stride")
        where = v.let(f"getelementptr inbounds i8, ptr %index.here, i64 {skipped}")
        for k, value in enumerate(fetch(v, [where], v.let(f"mul i64 %a.number, {4 * LANES}"))):
            store("d", value, 8 * ROW * k)
    elif name == "kept":
        store("d", v.let(f"load {v.f}, ptr {beside('kept', 'a')}, align 8"))
    elif name == "store":
        value = load("a")
        lines.append(f"  store {v.f} {value}, ptr {beside('out', 'b')}, align 8")
    else:
        _operate(name, v, load, store)
    return [
        f"{name}.begin:",
        *before,
        f"  br label %{name}.loop",
        f"{name}.loop:",
        f"  %{name}.k = phi i64 [ 0, %{name}.begin ], [ %{name}.next, %{name}.loop ]",
        f"  %{name}.place = mul i64 %{name}.k, {size}",
        *lines,
        f"  %{name}.next = add i64 %{name}.k, 1",
        f"  %{name}.more = icmp slt i64 %{name}.next, %size",
        f"  br i1 %{name}.more, label %{name}.loop, label %followed",
    ]


def _operate(name: str, v: Any, load: Callable[[str], str], store: Callable[..., None]) -> None:
    """One of a tape's operations, or two at once."""
    from stc.codegen.lookups import clip, places, reaches, read
    from stc.codegen.operations import written_out
    from stc.codegen.vector_math import sine_cosine

    a = load("a")
    if name in ("fma", "fms", "fnma"):
        b, c = load("b"), load("c")
        store("d", v.exact_fma(v.neg(a) if name == "fnma" else a, b, v.neg(c) if name == "fms" else c))
    elif name == "sincos":
        sine, cosine = sine_cosine(v, a, True, True)
        store("d", sine)
        store("c", cosine)
    elif name in CIRCULAR:
        sine, cosine = sine_cosine(v, a, name != "cos", name != "sin")
        store("d", v.div(sine, cosine) if name == "tan" else sine or cosine)
    elif name == CLIP:
        store("d", clip(v, a, load("b")))
    elif name == REACHES:
        store("d", reaches(v, a, load("b")))
    elif name == READ:
        store("d", read(v, places(v, v.add(a, load("b")))))
    elif OPERATORS[name] == 1:
        store("d", written_out(v, name, [a]))
    else:
        store("d", written_out(v, name, [a, load("b")]))


def module(fused: bool) -> FixedModule:
    """The function, with products that are rounded together with their sum or without."""
    name = "interpreter" if fused else "interpreter without fused products"
    return FixedModule(name, ("interpret",), partial(interpreter_ir, fused), optimise=True)


@only_once
def entry() -> Callable[..., Any]:
    """The function, for prepared calls."""
    loaded = module(engine.has_fma()).load()
    _loaded.append(loaded)
    return ctypes.CFUNCTYPE(None, ctypes.c_void_p)(loaded.address("interpret"))


_loaded: list[engine.LoadedObject] = []
