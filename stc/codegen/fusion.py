"""Which products of a tape are rounded only together with the sum that they are part of.

Machines multiply and add in one instruction, which takes as long as either.  A compiler that is free to choose where it
does so chooses by what is in registers; decided here, by the tape alone, every way to run it gives the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

from stc.codegen.tape import Tape

__all__ = ["Fused", "find_fused", "reads_of"]


class Fused(NamedTuple):
    """``first * second + other``, the product or the other one negated: one instruction for two operations.

    Attributes:
        product: the number of the operation that multiplies.
        first, second, other: slots.
        negates_product: the operation is ``other - first * second``.
        negates_other: it is ``first * second - other``.
    """

    product: int
    first: int
    second: int
    other: int
    negates_product: bool
    negates_other: bool


def find_fused(tape: Tape) -> dict[int, Fused]:
    """The sums and differences, by the number of the operation, that take in a product that nothing else needs.

    Only operations of an instance; of two such products the first.
    """
    uses = [0] * tape.n_slots
    for _, a, b in tape.ops:
        uses[a] += 1
        if b >= 0:
            uses[b] += 1
    for slot in tape.outputs:
        uses[slot] += 1
    ops, first_op, begin = tape.ops, tape.first_op, tape.n_uniform_ops
    found: dict[int, Fused] = {}
    for number in range(begin, len(ops)):
        op, a, b = ops[number]
        if op != "add" and op != "sub":
            continue
        for slot, other in ((a, b), (b, a)):
            product = slot - first_op
            if product >= begin and uses[slot] == 1 and ops[product][0] == "mul":
                _, first, second = ops[product]
                negates = op == "sub"
                found[number] = Fused(
                    product, first, second, other, negates and slot == b, negates and slot == a
                )
                break
    return found


def reads_of(tape: Tape, fused: dict[int, Fused]) -> list[tuple[int, ...]]:
    """The distinct slots that each per-instance operation reads, with those of a product that it takes in; none for
    that product."""
    absorbed = {one.product for one in fused.values()}
    reads: list[tuple[int, ...]] = []
    for number in range(tape.n_uniform_ops, len(tape.ops)):
        one = fused.get(number)
        _, a, b = tape.ops[number]
        if one is not None:
            reads.append(tuple(dict.fromkeys((one.first, one.second, one.other))))
        elif number in absorbed:
            reads.append(())
        else:
            reads.append((a, b) if b >= 0 and b != a else (a,))
    return reads
