"""From a tape to LLVM: several instances per vector instruction.

A kernel runs over blocks of :data:`LANES` instances, or over pairs of blocks where vectors are twice as wide
(the last block is then its own partner when the number is odd, and written twice):

    once:       spread uniform inputs and literals over the lanes, do the uniform operations
    per block:  have varying inputs fetched from the workspace, do the operations, store results

              out[block][output][lane]   (double)

and what another kernel has found:  kept[block][output][lane]  (double)

The order of the tape is kept, and outputs are stored as soon as they are known, so that few values are alive at once;
:mod:`stc.codegen.residency` decides which of them stay in registers.  The IR needs no optimisation passes: common
subexpressions are shared, and constants folded already.  Its machine code is the same wherever it
lies in memory: numbers and functions are reached through the one argument (``tape_call`` of ``stc/core/calls.h``).
"""

from __future__ import annotations

from typing import Final

from stc.codegen.engine import LANES
from stc.codegen.operations import Operations
from stc.codegen.residency import Residency
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import CIRCULAR, Tape
from stc.codegen.vector import Vector
from stc.symbolic.tables import READ

#: Operations per basic block.
_PART: Final = 128

#: Bytes of memory that come together.
_LINE: Final = 64

#: Kernels with fewer runs of inputs have those of several vectors fetched by one call.
_FETCHED: Final = 16

#: What the argument begins with.
_ARGUMENTS: Final = ("workspace", "uniform", "index", "out", "kept", "literals", "functions")


class _Kernel:
    """Emits one kernel."""

    def __init__(self, tape: Tape, runs: Runs, width: int, registers: int) -> None:
        self.tape = tape
        self.runs = runs
        self.width = width
        self.groups = range(width // LANES)
        self.head: list[str] = []
        self.body: list[str] = []
        self.vector = Vector(self.body, width, len(tape.constants), "v")
        self.shared = self._once_per_call()
        self.kept = runs.kept_rows(tape)
        # Four registers are for what goes on inside one operation.
        self.residency = Residency(tape, self.vector, max(registers - 4, 4), self.shared, self._load_input)
        self.last_part = "compute"
        self._per_block()

    def _once_per_call(self) -> dict[int, int]:
        """Uniform operations; what the blocks need of them, and literals, spread over the lanes in memory.

        Returns:
            slot -> place in ``%shared``
        """
        tape = self.tape
        vector = Vector(self.head, self.width, len(tape.constants), "u")
        values: dict[int, str] = {}

        def value_of(slot: int) -> str:
            if slot not in values:
                literal = slot - tape.first_literal
                given = ("%literals", literal) if literal >= 0 else ("%uniform", slot)
                values[slot] = vector.spread(*given)
            return values[slot]

        once = Operations(tape, vector)
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
            vector.store(value_of(slot), "%shared", place)
        return places

    def _load_input(self, slot: int) -> str:
        """A varying input, or what another kernel has found, of one block or of two beside each other."""
        vector = self.vector
        if slot not in self.kept:
            return vector.load("%inputs", self.runs.places[slot - self.tape.n_uniform])
        parts = []
        for group in self.groups:
            pointer = vector.pointer(f"%source{group}", 8 * LANES * self.kept[slot])
            parts.append(vector.let(f"load <{LANES} x double>, ptr {pointer}, align 8"))
        return (
            parts[0]
            if len(parts) == 1
            else vector.shuffled(f"<{LANES} x double>", parts[0], parts[1], range(self.width))
        )

    def _store(self, rows: list[int], value: str) -> None:
        """Write a value to rows of the output blocks."""
        vector = self.vector
        for group in self.groups:
            part = value
            if len(self.groups) > 1:
                part = vector.shuffled(vector.f, value, "poison", range(group * LANES, (group + 1) * LANES))
            for row in rows:
                offset = 8 * LANES * row
                pointer = vector.pointer(f"%target{group}", offset)
                self.body.append(f"  store <{LANES} x double> {part}, ptr {pointer}, align 8")
                if offset % _LINE == 0:
                    # The next block's part of a large buffer is not near; to wait for it takes longer than all else.
                    ahead = offset + 8 * self.width * len(self.tape.outputs)
                    pointer = vector.let(f"getelementptr i8, ptr %target{group}, i64 {ahead}")
                    self.body.append(f"  call void @llvm.prefetch.p0(ptr {pointer}, i32 0, i32 3, i32 1)")

    def _per_block(self) -> None:
        tape, residency = self.tape, self.residency
        rows: dict[int, list[int]] = {}
        for row, slot in enumerate(tape.outputs):
            rows.setdefault(slot, []).append(row)
        each = Operations(tape, self.vector)
        slot_of = {
            (op, a): tape.first_op + k for k, (op, a, _) in enumerate(tape.ops) if op in ("sin", "cos")
        }
        read_by = {(a, b): tape.first_op + k for k, (op, a, b) in enumerate(tape.ops) if op == READ}
        known: set[int] = set()
        for number, reads in tape.reads():
            op, a, b = tape.ops[number]
            slot = tape.first_op + number
            made: list[tuple[int, str]] = []
            if slot not in known:
                first = residency.operand(a, reads)
                second = "" if b < 0 else first if b == a else residency.operand(b, reads)
                for read in reads:
                    residency.used(read)
                called = each.calls(op, a)
                if called:
                    residency.vacate()
                if op == READ:
                    for literal, number_read in each.read(a, first, b).items():
                        made.append((read_by[a, literal], number_read))
                    known.update(partner for partner, _ in made)
                else:
                    made.append((slot, each.emit(op, a, first, second, b)))
                # What is there as well is a value like others from now on.
                if called and op in CIRCULAR:
                    for other, value in zip(("sin", "cos"), each.circular(a, first), strict=True):
                        partner = slot_of.get((other, a), -1)
                        if partner > slot:
                            made.append((partner, value))
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
        """The module's IR."""
        f, size = self.vector.f, self.vector.size
        memory = {
            "shared": len(self.shared),
            "fetched": RUN * self.runs.count * self._vectors,
            "homes": self.residency.places,
            "from": 4,  # two operands, and as much beyond as functions of wider vectors reach
            "to": 4,
        }
        lines = [
            self.vector.declarations()
            + "declare void @llvm.prefetch.p0(ptr, i32 immarg, i32 immarg, i32 immarg)",
            "define void @kernel(ptr %call) nounwind {",
            "entry:",
            *(f"  %{name} = alloca [{max(count, 1)} x {f}], align {size}" for name, count in memory.items()),
        ]
        for place, name in enumerate((*_ARGUMENTS, "blocks")):
            lines.append(f"  %at.{name} = getelementptr inbounds i8, ptr %call, i64 {8 * place}")
            lines.append(f"  %{name} = load {'i64' if name == 'blocks' else 'ptr'}, ptr %at.{name}, align 8")
        return "\n".join(
            [
                *lines,
                "  %any = icmp sgt i64 %blocks, 0",
                "  br i1 %any, label %once, label %done",
                "once:",
                *self.head,
                "  br label %block",
                "block:",
                f"  %number = phi i64 [ 0, %once ], [ %following, %{self.last_part} ]",
                *[line for group in self.groups for line in self._block_pointers(group)],
                *self._fetching(),
                "compute:",
                *self.body,
                f"  %following = add i64 %number, {len(self.groups)}",
                "  %more = icmp slt i64 %following, %blocks",
                "  br i1 %more, label %block, label %done",
                "done:",
                "  ret void",
                "}",
                "",
            ]
        )

    @property
    def _vectors(self) -> int:
        """The inputs of so many vectors are fetched together: a power of two."""
        return 1 << max((_FETCHED // max(self.runs.count, 1)).bit_length() - 1, 0)

    def _fetching(self) -> list[str]:
        """Where inputs are; they are fetched for the first of some vectors."""
        if not self.runs.count:
            return ["  br label %compute"]
        lines: list[str] = []
        vector = Vector(lines, self.width, 0, "f")
        number = vector.let(f"udiv i64 %number, {len(self.groups)}")
        within = vector.let(f"and i64 {number}, {self._vectors - 1}")
        skipped = vector.let(f"mul i64 {within}, {vector.size * RUN * self.runs.count}")
        lines.append(f"  %inputs = getelementptr inbounds i8, ptr %fetched, i64 {skipped}")
        due = vector.let(f"icmp eq i64 {within}, 0")
        lines += [f"  br i1 {due}, label %fetch, label %compute", "fetch:"]
        counts = f"i64 {len(self.groups)}, i64 {self._vectors}"
        vector.call("fetch", f"ptr %call, i64 %number, ptr %fetched, {counts}")
        return [*lines, "  br label %compute"]

    def _block_pointers(self, group: int) -> list[str]:
        """Where the outputs of a block begin; of the last one for a partner that is missing."""
        return [
            f"  %wanted{group} = add i64 %number, {group}",
            f"  %inside{group} = icmp slt i64 %wanted{group}, %blocks",
            f"  %block{group} = select i1 %inside{group}, i64 %wanted{group}, i64 %number",
            f"  %filled{group} = mul i64 %block{group}, {8 * LANES * len(self.tape.outputs)}",
            f"  %target{group} = getelementptr inbounds i8, ptr %out, i64 %filled{group}",
            f"  %found{group} = mul i64 %block{group}, {8 * LANES * self.runs.kept_width}",
            f"  %source{group} = getelementptr inbounds i8, ptr %kept, i64 %found{group}",
        ]


def kernel_ir(tape: Tape, runs: Runs, *, width: int = LANES, registers: int = 16) -> str:
    """An LLVM module with one function, ``kernel``.

    Args:
        tape: the program.
        runs: where its varying inputs are.
        width: doubles per vector, :data:`LANES` or twice as many.
        registers: how many such vectors the machine's registers hold.
    """
    return _Kernel(tape, runs, width, registers).text()
