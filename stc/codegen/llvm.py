"""From tapes to LLVM: one kernel per tape, several instances per vector instruction.

A kernel runs over blocks of :data:`LANES` instances, or over pairs of blocks where vectors are twice as wide
(the last block is then its own partner when the number is odd, and written twice):

    once:       load uniform inputs, do the uniform operations as scalars, spread them over the lanes (stack)
    per block:  gather varying inputs from the workspace by the index table, do the operations, store results

              index[block][input][lane]   (int32)        out[block][output][lane]   (double)

The order of the tape is kept: inputs are gathered at their first use and outputs stored as soon as they are
known, so that few values are alive at once.  The IR needs no optimisation passes: common subexpressions are
shared and constants folded already, and multiply-adds are fused by the back end, which the ``contract`` flags
allow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from stc.codegen.tape import Tape
from stc.codegen.vector import Vector, hexadecimal
from stc.codegen.vector_math import BINARY, UNARY, sine_cosine

#: Instances per block: the unit of the memory layout on every machine.
LANES: Final = 4

_ARITHMETIC: Final = {
    "add": "fadd contract",
    "sub": "fsub contract",
    "mul": "fmul contract",
    "div": "fdiv",
}
_CIRCULAR: Final = ("sin", "cos", "tan")


class _Operations:
    """Emits a tape's operations through a :class:`Vector`, pairing sines and cosines of one argument."""

    def __init__(self, tape: Tape, vector: Vector) -> None:
        self.vector = vector
        wanted: dict[int, set[str]] = {}
        for op, a, _ in tape.ops:
            if op in _CIRCULAR:
                wanted.setdefault(a, set()).add(op)
        self._wanted = wanted
        self._circular: dict[int, tuple[str, str]] = {}

    def emit(self, op: str, slot: int, a: str, b: str) -> str:
        """Result of one operation; ``slot`` identifies the first operand."""
        vector = self.vector
        instruction = _ARITHMETIC.get(op)
        if instruction is not None:
            return vector.let(f"{instruction} {vector.f} {a}, {b}")
        if op == "neg":
            return vector.neg(a)
        if op == "sqrt":
            return vector.call("sqrt", a)
        if op in _CIRCULAR:
            pair = self._circular.get(slot)
            if pair is None:
                wanted = self._wanted[slot]
                pair = sine_cosine(vector, a, wanted != {"cos"}, wanted != {"sin"})
                self._circular[slot] = pair
            return vector.div(*pair) if op == "tan" else pair[op == "cos"]
        if op in UNARY:
            return UNARY[op](vector, a)
        return BINARY[op](vector, a, b)


def _kernel(tape: Tape, symbol: str, width: int, fused: bool) -> str:
    head: list[str] = []
    body: list[str] = []
    scalar = Vector(head, 1, fused, "u")
    vector = Vector(body, width, fused, "v")
    groups = range(width // LANES)
    values: list[str] = [""] * tape.n_slots
    first_varying, first_literal, first_op = tape.n_uniform, tape.first_literal, tape.first_op
    n_uniform_ops = tape.n_uniform_ops

    # ---- once per call
    def shared_scalar(slot: int) -> str:
        if first_literal <= slot < first_op:
            return hexadecimal(tape.constants[slot - first_literal])
        if not values[slot]:
            pointer = scalar.let(f"getelementptr inbounds double, ptr %uniform, i64 {slot}")
            values[slot] = scalar.let(f"load double, ptr {pointer}, align 8")
        return values[slot]

    once = _Operations(tape, scalar)
    for number in range(n_uniform_ops):
        op, a, b = tape.ops[number]
        values[first_op + number] = once.emit(op, a, shared_scalar(a), shared_scalar(b) if b >= 0 else "")

    # ---- what the blocks need of it: spread over the lanes, in memory, to be folded into the operations
    is_shared = [
        slot < first_varying or first_op <= slot < first_op + n_uniform_ops for slot in range(tape.n_slots)
    ]
    places: dict[int, int] = {}
    needed = [slot for _, a, b in tape.ops[n_uniform_ops:] for slot in (a, b) if slot >= 0] + tape.outputs
    for slot in needed:
        if is_shared[slot] and slot not in places:
            places[slot] = len(places)
    for slot, place in places.items():
        first = scalar.let(f"insertelement {vector.f} poison, double {shared_scalar(slot)}, i64 0")
        spread = scalar.let(
            f"shufflevector {vector.f} {first}, {vector.f} poison, <{width} x i32> zeroinitializer"
        )
        pointer = scalar.let(f"getelementptr inbounds {vector.f}, ptr %shared, i64 {place}")
        head.append(f"  store {vector.f} {spread}, ptr {pointer}, align {8 * width}")

    # ---- per block
    size = 8 * width

    def operand(slot: int) -> str:
        value = values[slot]
        if is_shared[slot]:
            pointer = vector.let(f"getelementptr inbounds i8, ptr %shared, i64 {places[slot] * size}")
            return vector.let(f"load {vector.f}, ptr {pointer}, align {size}")
        if value:
            return value
        if slot >= first_literal:
            value = vector.real(tape.constants[slot - first_literal])
        else:
            value = gather(slot - first_varying)
        values[slot] = value
        return value

    def gather(position: int) -> str:
        value = "poison"
        for lane in range(width):
            group, within = divmod(lane, LANES)
            offset = 4 * (position * LANES + within)
            place = vector.let(f"getelementptr inbounds i8, ptr %where{group}, i64 {offset}")
            narrow = vector.let(f"load i32, ptr {place}, align 4")
            wide = vector.let(f"zext i32 {narrow} to i64")
            source = vector.let(f"getelementptr inbounds double, ptr %workspace, i64 {wide}")
            element = vector.let(f"load double, ptr {source}, align 8")
            value = vector.let(f"insertelement {vector.f} {value}, double {element}, i64 {lane}")
        return value

    rows: dict[int, list[int]] = {}
    for row, slot in enumerate(tape.outputs):
        rows.setdefault(slot, []).append(row)

    def store(slot: int, value: str) -> None:
        for group in groups if slot in rows else ():
            part = value
            if len(groups) > 1:
                chosen = ", ".join(f"i32 {group * LANES + lane}" for lane in range(LANES))
                part = vector.let(
                    f"shufflevector {vector.f} {value}, {vector.f} poison, <{LANES} x i32> <{chosen}>"
                )
            for row in rows[slot]:
                offset = 8 * LANES * row
                pointer = vector.let(f"getelementptr inbounds i8, ptr %target{group}, i64 {offset}")
                body.append(f"  store <{LANES} x double> {part}, ptr {pointer}, align 8")

    each = _Operations(tape, vector)
    for number in range(n_uniform_ops, len(tape.ops)):
        op, a, b = tape.ops[number]
        slot = first_op + number
        values[slot] = each.emit(op, a, operand(a), operand(b) if b >= 0 else "")
        store(slot, values[slot])
    for slot in rows:
        if slot < first_op + n_uniform_ops:
            store(slot, operand(slot))

    return "\n".join(
        [
            f"define void @{symbol}(ptr noalias readonly %workspace, ptr noalias readonly %uniform, "
            "ptr noalias readonly %index, ptr noalias %out, i64 %blocks) nounwind {",
            "entry:",
            f"  %shared = alloca [{max(len(places), 1)} x {vector.f}], align {size}",
            "  %any = icmp sgt i64 %blocks, 0",
            "  br i1 %any, label %once, label %done",
            "once:",
            *head,
            "  br label %block",
            "block:",
            "  %number = phi i64 [ 0, %once ], [ %following, %block ]",
            *[line for group in groups for line in _block_pointers(tape, group)],
            *body,
            f"  %following = add i64 %number, {len(groups)}",
            "  %more = icmp slt i64 %following, %blocks",
            "  br i1 %more, label %block, label %done",
            "done:",
            "  ret void",
            "}",
            *_packed(symbol),
            "",
        ]
    )


def _block_pointers(tape: Tape, group: int) -> list[str]:
    """Where the indices and outputs of a block begin; of the last one for a partner that is missing."""
    return [
        f"  %wanted{group} = add i64 %number, {group}",
        f"  %inside{group} = icmp slt i64 %wanted{group}, %blocks",
        f"  %block{group} = select i1 %inside{group}, i64 %wanted{group}, i64 %number",
        f"  %skipped{group} = mul i64 %block{group}, {4 * LANES * tape.n_varying}",
        f"  %where{group} = getelementptr inbounds i8, ptr %index, i64 %skipped{group}",
        f"  %filled{group} = mul i64 %block{group}, {8 * LANES * len(tape.outputs)}",
        f"  %target{group} = getelementptr inbounds i8, ptr %out, i64 %filled{group}",
    ]


def _packed(symbol: str) -> list[str]:
    """An entry for prepared calls: the five arguments come from consecutive 8-byte cells."""
    lines = [f"define void @{symbol}.packed(ptr %cells) nounwind {{"]
    types = ("ptr", "ptr", "ptr", "ptr", "i64")
    for position, type_ in enumerate(types):
        lines.append(f"  %p{position} = getelementptr inbounds i64, ptr %cells, i64 {position}")
        lines.append(f"  %a{position} = load {type_}, ptr %p{position}, align 8")
    arguments = ", ".join(f"{type_} %a{position}" for position, type_ in enumerate(types))
    return [*lines, f"  call void @{symbol}({arguments})", "  ret void", "}"]


def module_ir(tapes: Sequence[Tape], *, fused: bool = True, width: int = LANES) -> str:
    """One LLVM module with kernels ``kernel0``, ``kernel1``, ... and their ``.packed`` entries.

    Args:
        tapes: the programs.
        fused: the machine has fused multiply-add instructions.
        width: doubles per vector, a multiple of :data:`LANES`.
    """
    unused: list[str] = []
    declarations = "".join(Vector(unused, size, fused, "").declarations() for size in (1, width))
    kernels = [_kernel(tape, f"kernel{k}", width, fused) for k, tape in enumerate(tapes)]
    return declarations + "\n" + "\n".join(kernels)
