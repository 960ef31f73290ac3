"""Where the values of a straight-line kernel live: in registers, or in memory until they are needed again.

A kernel is a few long runs of instructions in which every use of every value is known.  When registers run
short, the value whose next use is farthest away moves to memory (Belady, IBM Systems Journal 5, 1966), and
comes back as an operand of the instruction that needs it.  Doing this here and not in LLVM, whose register
allocator was made for unknown futures, makes compilation four times faster and linear in the length.
"""

from __future__ import annotations

from collections.abc import Callable

from stc.codegen.tape import Tape
from stc.codegen.vector import Vector

_NEVER = 1 << 60


class Residency:
    """Hands out operands by slot and keeps the number of values alive in registers below a capacity.

    Args:
        tape: the program; its per-instance part is meant.
        vector: receives the instructions that move values.
        capacity: how many values may stay in registers between two operations.
        shared: slot -> place of the values that lie in memory from the start, in ``%shared``.
        load: emits the code that loads a varying input; returns the register.
    """

    def __init__(
        self,
        tape: Tape,
        vector: Vector,
        capacity: int,
        shared: dict[int, int],
        load: Callable[[int], str],
    ) -> None:
        self._vector = vector
        self._capacity = capacity
        self._shared = shared
        self._outside = range(tape.n_uniform, tape.first_literal)
        self._load_outside = load
        self._uses = _uses(tape)
        self._registers: dict[int, str] = {}  # slot -> register
        self._next_use: dict[int, int] = {}  # slot -> operation, for slots in registers
        self._homes: dict[int, int] = {}  # slot -> place in memory, for slots that have been there
        self._free: list[int] = []
        self.places = 0  # size of ``%homes``, in vectors

    def operand(self, slot: int, pinned: tuple[int, ...] = ()) -> str:
        """A register that holds the value, or a load for this one use; ``pinned`` slots are not moved away."""
        place = self._shared.get(slot)
        if place is not None:
            return self._vector.load("%shared", place)
        register = self._registers.get(slot)
        if register is not None:
            return register
        if slot in self._outside:
            register = self._load_outside(slot)
        else:
            register = self._vector.load("%homes", self._homes[slot])
        uses = self._uses[slot]
        later = uses[-2] if len(uses) > 1 else _NEVER
        if later < max(self._next_use.values(), default=_NEVER):  # worth a register; else it is for once
            self.hold(slot, register, pinned)
        return register

    def hold(self, slot: int, register: str, pinned: tuple[int, ...] = ()) -> None:
        """A value has arrived in a register; unless nobody needs it, it stays as long as it deserves."""
        uses = self._uses[slot]
        if not uses:
            return
        self._registers[slot] = register
        self._next_use[slot] = uses[-1]
        while len(self._registers) > self._capacity:
            self._evict((*pinned, slot))

    def _evict(self, pinned: tuple[int, ...]) -> None:
        next_use = self._next_use
        victim = max(next_use, key=next_use.__getitem__)
        if victim in pinned:
            victim = max((slot for slot in next_use if slot not in pinned), key=next_use.__getitem__)
        self._move_out(victim)

    def vacate(self) -> None:
        """Move everything to memory: a call is to follow, and calls lose what is in registers."""
        for slot in list(self._registers):
            self._move_out(slot)

    def _move_out(self, victim: int) -> None:
        register = self._registers.pop(victim)
        del self._next_use[victim]
        if victim in self._homes or victim in self._outside:
            return  # it is there already
        if self._free:
            place = self._free.pop()
        else:
            place = self.places
            self.places += 1
        self._homes[victim] = place
        self._vector.store(register, "%homes", place)

    def used(self, slot: int) -> None:
        """The operation being emitted has read the value."""
        uses = self._uses[slot]
        if uses:
            uses.pop()
        if uses:
            if slot in self._next_use:
                self._next_use[slot] = uses[-1]
            return
        self._registers.pop(slot, None)
        self._next_use.pop(slot, None)
        home = self._homes.pop(slot, None)
        if home is not None:
            self._free.append(home)


def _uses(tape: Tape) -> list[list[int]]:
    """Per slot, the numbers of the per-instance operations that read it, the first one last."""
    uses: list[list[int]] = [[] for _ in range(tape.n_slots)]
    for number, slots in reversed(list(tape.reads())):
        for slot in slots:
            uses[slot].append(number)
    return uses
