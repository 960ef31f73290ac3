"""Frames of statements: coverage of ranged definitions, and statements at jumps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from stc.language.definitions import runs
from stc.problem import DefinitionPiece, DefinitionRef, FrameRange, Jump, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, substitute, sym, symbols


@dataclass(frozen=True, slots=True)
class Gap:
    """Frames ``first..last`` on which the definition ``name`` has no piece."""

    name: str
    first: int
    last: int

    def __str__(self) -> str:
        return f"frame {self.first}" if self.first == self.last else f"frames {self.first} to {self.last}"


class Frames:
    """Answers questions about frames for one problem."""

    def __init__(
        self, n: int, central: bool, pieces: Mapping[str, Sequence[DefinitionPiece]], jumps: Sequence[Jump]
    ) -> None:
        self.n = n
        self.central = central
        self.pieces = pieces
        self.jump_frames = sorted({jump.frame for jump in jumps})

    def fitting(self, e: Expr, first: int, last: int) -> tuple[int, int]:
        """The part of ``first..last`` on which the derivatives and indices of ``e`` stay within the motion.

        This is the clipping of the language; whether a fraction of ``i`` is a whole number is not checked.
        """
        for key in symbols(e):
            if not isinstance(key, VariableRef):
                continue
            reach = (key.order + 1) // 2 if self.central and key.order > 1 else 0
            low, high = reach - key.shift, self.n - reach - key.shift
            if key.scale > 0:
                first, last = max(first, math.ceil(low / key.scale)), min(last, math.floor(high / key.scale))
            elif key.scale < 0:
                first, last = max(first, math.ceil(high / key.scale)), min(last, math.floor(low / key.scale))
            elif low > 0 or high < 0:
                return 0, -1
        return first, last

    def gap(self, e: Expr, first: int, last: int) -> Gap | None:
        """The first interval within ``first..last`` on which the expression ``e`` uses a definition that has no value
        there; None if there is none.
        """
        seen: set[tuple[str, int, int]] = set()
        waiting = [(e, first, last)]
        while waiting:
            body, low, high = waiting.pop()
            low, high = self.fitting(body, low, high)
            for key in symbols(body):
                if not isinstance(key, DefinitionRef) or low > high or (key.name, low, high) in seen:
                    continue
                seen.add((key.name, low, high))
                for run in runs(self.pieces[key.name], low, high):
                    if run.piece is not None:
                        waiting.append((run.piece.body, run.first, run.last))
                    elif not (key.name == "h" and run.first == run.last == self.n):
                        # no step follows the last frame: there `h` means the step before it
                        return Gap(key.name, run.first, run.last)
        return None

    def meets_jump(self, key: VariableRef | DefinitionRef, where: FrameRange) -> bool:
        """Whether the symbol is read at a frame that jumps when its statement stands on ``where``."""
        if isinstance(key, DefinitionRef):
            return any(where.first <= frame <= where.last for frame in self.jump_frames)
        if key.scale == 0:
            return key.shift in self.jump_frames
        return any(where.first <= (frame - key.shift) / key.scale <= where.last for frame in self.jump_frames)

    def without_idle_sides(self, e: Expr, where: FrameRange) -> Expr:
        """``e`` without ``before`` and ``after`` around quantities that do not jump."""
        idle = [
            key
            for key in symbols(e)
            if isinstance(key, VariableRef | DefinitionRef) and key.side and not self.meets_jump(key, where)
        ]
        return substitute(e, {key: sym(replace(key, side="")) for key in idle}) if idle else e
