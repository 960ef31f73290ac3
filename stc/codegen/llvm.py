"""From tapes to LLVM: one kernel per tape, several instances per vector instruction.

A kernel runs over blocks of :data:`LANES` instances, or over pairs of blocks where vectors are twice as wide
(the last block is then its own partner when the number is odd, and written twice):

    once:       load uniform inputs, do the uniform operations as scalars, spread them over the lanes (stack)
    per block:  fetch runs of varying inputs from the workspace by the index table, do the operations, store results

              index[block][run][lane]   (int32)          out[block][output][lane]   (double)

                     and what another kernel has found:  kept[block][output][lane]  (double)

The order of the tape is kept: inputs are fetched at the first use of their run and outputs stored as soon as they
are known, so that few values are alive at once; :mod:`stc.codegen.residency` decides which of them stay in
registers.  The IR needs no optimisation passes: common subexpressions are shared, constants folded and multiply-adds
fused already.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from stc.codegen.engine import LANES
from stc.codegen.fetching import fetch
from stc.codegen.fusion import find_fused, reads_of
from stc.codegen.operations import WRITTEN_OUT, MathFunctions, Operations, function_length
from stc.codegen.residency import Residency
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import CIRCULAR, TOGETHER, Tape
from stc.codegen.vector import PREFETCH, Vector, hexadecimal, prefetch
from stc.symbolic.tables import READ

#: Operations per basic block.
_PART: Final = 128

#: Bytes of memory that come together.
_LINE: Final = 64

#: Up to so many runs of varying inputs are fetched where the first of them is needed.  Written out for more, that
#: would be half of a kernel's code, and of the time to compile it; a loop takes longer to run.
_WRITTEN_OUT: Final = 32


class _Kernel:
    """Emits one kernel."""

    def __init__(
        self,
        tape: Tape,
        runs: Runs,
        symbol: str,
        width: int,
        registers: int,
        fused: bool,
        functions: MathFunctions,
    ) -> None:
        self.tape = tape
        self.runs = runs
        self.functions = functions
        self.symbol = symbol
        self.width = width
        self.groups = range(width // LANES)
        self._indices = [f"%where{group}" for group in self.groups]
        self.head: list[str] = []
        self.body: list[str] = []
        self.scalar = Vector(self.head, 1, fused, "u")
        self.vector = Vector(self.body, width, fused, "v")
        self.shared = self._once_per_call()
        self.inputs = self._listed_inputs()
        self.kept = runs.kept_rows(tape)
        self.fused = find_fused(tape) if fused else {}
        # four registers are for what goes on inside one operation
        self.residency = Residency(
            tape,
            self.fused,
            self.vector,
            max(registers - 4, TOGETHER + 2),
            self.shared,
            self.inputs.keys() | self.kept.keys(),
            self._load_input,
            self._fetch_run,
        )
        self.last_part = "compute"
        self._per_block()

    def _once_per_call(self) -> dict[int, int]:
        """Uniform operations; what the blocks need of them, and literals, spread over the lanes in memory.

        Returns:
            slot -> place in ``%shared``
        """
        tape, scalar, vector = self.tape, self.scalar, self.vector
        values: dict[int, str] = {}

        def value_of(slot: int) -> str:
            if tape.first_literal <= slot < tape.first_op:
                return hexadecimal(tape.constants[slot - tape.first_literal])
            if slot not in values:
                pointer = scalar.let(f"getelementptr inbounds double, ptr %uniform, i64 {slot}")
                values[slot] = scalar.let(f"load double, ptr {pointer}, align 8")
            return values[slot]

        once = Operations(tape, scalar, self.functions)
        for number in range(tape.n_uniform_ops):
            op, a, b = tape.ops[number]
            result = once.emit(op, a, value_of(a), value_of(b) if b >= 0 else "", b)
            values[tape.first_op + number] = result

        varying_inputs = range(tape.n_uniform, tape.first_literal)
        end = tape.first_op + tape.n_uniform_ops
        needed = [slot for _, a, b in tape.ops[tape.n_uniform_ops :] for slot in (a, b) if slot >= 0]
        places: dict[int, int] = {}
        for slot in (*needed, *tape.outputs):
            if slot < end and slot not in varying_inputs and slot not in places:
                places[slot] = len(places)
        for slot, place in places.items():
            first = scalar.let(f"insertelement {vector.f} poison, double {value_of(slot)}, i64 0")
            spread = scalar.let(
                f"shufflevector {vector.f} {first}, {vector.f} poison, <{self.width} x i32> zeroinitializer"
            )
            pointer = scalar.let(f"getelementptr inbounds {vector.f}, ptr %shared, i64 {place}")
            self.head.append(f"  store {vector.f} {spread}, ptr {pointer}, align {8 * self.width}")
        return places

    def _listed_inputs(self) -> dict[int, int]:
        """The varying inputs that a loop fetches, where their runs are many: slot -> place in ``%inputs``."""
        if self.runs.count <= _WRITTEN_OUT:
            return {}
        first = self.tape.n_uniform
        return {first + v: place for v, place in enumerate(self.runs.places) if place >= 0}

    def _fetch_run(self, slot: int) -> dict[int, str]:
        """Fetches the run that a varying input belongs to; the registers of all in it."""
        run = self.runs.places[slot - self.tape.n_uniform] // RUN
        members = fetch(self.vector, self._indices, 4 * LANES * run)
        return {
            self.tape.n_uniform + v: members[place % RUN]
            for v, place in enumerate(self.runs.places)
            if place // RUN == run
        }

    def _load_input(self, slot: int) -> str:
        """A listed input, or one that another kernel has found, of one block or of two beside each other."""
        vector, size = self.vector, 8 * self.width
        if slot in self.inputs:
            pointer = vector.let(f"getelementptr inbounds i8, ptr %inputs, i64 {size * self.inputs[slot]}")
            return vector.let(f"load {vector.f}, ptr {pointer}, align {size}")
        offset = 8 * LANES * self.kept[slot]
        parts = []
        for group in self.groups:
            pointer = vector.let(f"getelementptr inbounds i8, ptr %source{group}, i64 {offset}")
            parts.append(vector.let(f"load <{LANES} x double>, ptr {pointer}, align 8"))
        if len(parts) == 1:
            return parts[0]
        chosen = ", ".join(f"i32 {lane}" for lane in range(self.width))
        both = ", ".join(f"<{LANES} x double> {part}" for part in parts)
        return vector.let(f"shufflevector {both}, <{self.width} x i32> <{chosen}>")

    def _fetch_loop(self) -> list[str]:
        """Fetches the listed inputs before anything else of a block."""
        if not self.inputs:
            return ["  br label %compute"]
        lines = ["  br label %fetch", "fetch:", "  %run = phi i64 [ 0, %block ], [ %next, %fetch ]"]
        vector = Vector(lines, self.width, False, "g")
        members = fetch(vector, self._indices, vector.let(f"mul i64 %run, {4 * LANES}"))
        target = vector.let(f"getelementptr inbounds [{RUN} x {vector.f}], ptr %inputs, i64 %run")
        for k, value in enumerate(members):
            pointer = vector.let(f"getelementptr inbounds {vector.f}, ptr {target}, i64 {k}")
            lines.append(f"  store {vector.f} {value}, ptr {pointer}, align {8 * self.width}")
        return [
            *lines,
            "  %next = add i64 %run, 1",
            f"  %unfinished = icmp slt i64 %next, {self.runs.count}",
            "  br i1 %unfinished, label %fetch, label %compute",
        ]

    def _store(self, rows: list[int], value: str) -> None:
        """Write a value to rows of the output blocks."""
        for group in self.groups:
            part = value
            if len(self.groups) > 1:
                chosen = ", ".join(f"i32 {group * LANES + lane}" for lane in range(LANES))
                part = self.vector.let(
                    f"shufflevector {self.vector.f} {value}, {self.vector.f} poison, <{LANES} x i32> <{chosen}>"
                )
            for row in rows:
                offset = 8 * LANES * row
                pointer = self.vector.let(f"getelementptr inbounds i8, ptr %target{group}, i64 {offset}")
                self.body.append(f"  store <{LANES} x double> {part}, ptr {pointer}, align 8")
                if offset % _LINE == 0:
                    # The next block's part of a large buffer is not near; to wait for it takes longer than all else.
                    ahead = offset + 8 * self.width * len(self.tape.outputs)
                    pointer = self.vector.let(f"getelementptr i8, ptr %target{group}, i64 {ahead}")
                    self.body.append(f"  {prefetch(pointer)}")

    def _per_block(self) -> None:
        tape, residency = self.tape, self.residency
        rows: dict[int, list[int]] = {}
        for row, slot in enumerate(tape.outputs):
            rows.setdefault(slot, []).append(row)
        each = Operations(tape, self.vector, self.functions)
        slot_of = {
            (op, a): tape.first_op + k for k, (op, a, _) in enumerate(tape.ops) if op in ("sin", "cos")
        }
        read_by = {(a, b): tape.first_op + k for k, (op, a, b) in enumerate(tape.ops) if op == READ}
        known: set[int] = set()
        # Angles whose sines and cosines are written out, but not yet.
        angles = dict.fromkeys(a for op, a, _ in tape.ops[tape.n_uniform_ops :] if op in CIRCULAR)
        if self.functions.called:
            angles.clear()
        for number, reads in enumerate(reads_of(tape, self.fused), tape.n_uniform_ops):
            op, a, b = tape.ops[number]
            slot = tape.first_op + number
            made: list[tuple[int, str]] = []
            if number in self.fused:
                register = {read: residency.operand(read, reads) for read in reads}
                one = self.fused[number]
                for read in reads:
                    residency.used(read)
                terms = (register[part] for part in (one.first, one.second, one.other))
                made.append((slot, each.emit_fused(one, *terms)))
            elif slot not in known and reads:
                first = residency.operand(a, reads)
                second = "" if b < 0 else first if b == a else residency.operand(b, reads)
                for read in reads:
                    residency.used(read)
                if each.calls(op, a):
                    residency.vacate()
                there = [a] if op in CIRCULAR else []
                if there and a in angles:
                    # Others that are there already go along: a processor has little else to do meanwhile.
                    del angles[a]
                    beside = [angle for angle in angles if angle < slot][: TOGETHER - 1]
                    registers = [first]
                    for angle in beside:
                        del angles[angle]
                        there.append(angle)
                        registers.append(residency.operand(angle, tuple(there)))
                    if beside:
                        each.circular_together(there, registers)
                if op == READ:
                    for literal, number_read in each.read(a, first, b).items():
                        made.append((read_by[a, literal], number_read))
                    known.update(partner for partner, _ in made)
                else:
                    made.append((slot, each.emit(op, a, first, second, b)))
                # What is there as well is a value like others from now on.
                for angle in there:
                    for other in ("sin", "cos"):
                        partner = slot_of.get((other, angle), -1)
                        if partner > slot:
                            made.append((partner, each.circular(angle, first)[other == "cos"]))
                            known.add(partner)
            else:
                for read in reads:
                    residency.used(read)
            for result, its_register in made:
                if result in rows:
                    self._store(rows[result], its_register)
                residency.hold(result, its_register)
            if number % _PART == _PART - 1:
                self._new_part(number)
        for slot, where in rows.items():
            if slot < tape.first_op + tape.n_uniform_ops:
                self._store(where, residency.operand(slot))

    def _new_part(self, number: int) -> None:
        """Cut the run of instructions: the cost of LLVM's instruction selection grows faster than its length."""
        self.last_part = f"part{number}"
        self.body.append(f"  br label %{self.last_part}")
        self.body.append(f"{self.last_part}:")

    def text(self) -> str:
        """The kernel's IR, with its entry for prepared calls."""
        vector, size = self.vector, 8 * self.width
        listed = RUN * self.runs.count if self.inputs else 0
        return "\n".join(
            [
                f"define void @{self.symbol}(ptr noalias readonly %workspace, ptr noalias readonly %uniform, "
                "ptr noalias readonly %index, ptr noalias %out, ptr noalias readonly %kept, "
                "i64 %blocks) nounwind {",
                "entry:",
                f"  %shared = alloca [{max(len(self.shared), 1)} x {vector.f}], align {size}",
                f"  %inputs = alloca [{max(listed, 1)} x {vector.f}], align {size}",
                f"  %homes = alloca [{max(self.residency.places, 1)} x {vector.f}], align {size}",
                "  %any = icmp sgt i64 %blocks, 0",
                "  br i1 %any, label %once, label %done",
                "once:",
                *self.head,
                "  br label %block",
                "block:",
                f"  %number = phi i64 [ 0, %once ], [ %following, %{self.last_part} ]",
                *[line for group in self.groups for line in _block_pointers(self.tape, self.runs, group)],
                *self._fetch_loop(),
                "compute:",
                *self.body,
                f"  %following = add i64 %number, {len(self.groups)}",
                "  %more = icmp slt i64 %following, %blocks",
                "  br i1 %more, label %block, label %done",
                "done:",
                "  ret void",
                "}",
                *_packed(self.symbol),
                "",
            ]
        )


def _block_pointers(tape: Tape, runs: Runs, group: int) -> list[str]:
    """Where the indices and outputs of a block begin; of the last one for a partner that is missing."""
    return [
        f"  %wanted{group} = add i64 %number, {group}",
        f"  %inside{group} = icmp slt i64 %wanted{group}, %blocks",
        f"  %block{group} = select i1 %inside{group}, i64 %wanted{group}, i64 %number",
        f"  %skipped{group} = mul i64 %block{group}, {4 * LANES * runs.count}",
        f"  %where{group} = getelementptr inbounds i8, ptr %index, i64 %skipped{group}",
        f"  %filled{group} = mul i64 %block{group}, {8 * LANES * len(tape.outputs)}",
        f"  %target{group} = getelementptr inbounds i8, ptr %out, i64 %filled{group}",
        f"  %found{group} = mul i64 %block{group}, {8 * LANES * runs.kept_width}",
        f"  %source{group} = getelementptr inbounds i8, ptr %kept, i64 %found{group}",
    ]


def _packed(symbol: str) -> list[str]:
    """An entry for prepared calls: the six arguments come from consecutive 8-byte cells."""
    lines = [f"define void @{symbol}.packed(ptr %cells) nounwind {{"]
    types = ("ptr", "ptr", "ptr", "ptr", "ptr", "i64")
    for position, type_ in enumerate(types):
        lines.append(f"  %p{position} = getelementptr inbounds i64, ptr %cells, i64 {position}")
        lines.append(f"  %a{position} = load {type_}, ptr %p{position}, align 8")
    arguments = ", ".join(f"{type_} %a{position}" for position, type_ in enumerate(types))
    return [*lines, f"  call void @{symbol}({arguments})", "  ret void", "}"]


def module_ir(
    tapes: Sequence[Tape],
    runs: Sequence[Runs],
    *,
    width: int = LANES,
    registers: int = 16,
    fused: bool = True,
) -> str:
    """One LLVM module with kernels ``kernel0``, ``kernel1``, ... and their ``.packed`` entries.

    Args:
        tapes: the programs.
        runs: where the varying inputs of each are.
        width: doubles per vector, :data:`LANES` or twice as many.
        registers: how many such vectors the machine's registers hold.
        fused: the machine has fused multiply-add instructions.
    """
    unused: list[str] = []
    declarations = "".join(Vector(unused, size, fused, "").declarations() for size in (1, width))
    functions = MathFunctions(fused, called=function_length(tapes) > WRITTEN_OUT)
    kernels = [
        _Kernel(tape, of_tape, f"kernel{k}", width, registers, fused, functions).text()
        for k, (tape, of_tape) in enumerate(zip(tapes, runs, strict=True))
    ]
    return declarations + PREFETCH + "\n" + functions.text() + "\n" + "\n".join(kernels)
