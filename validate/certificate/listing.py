"""The text of the spec, line by line, with the multipliers of its statements.

A solution stores multipliers under the text of the statement, or under the name of the variable if the statement
became a bound.  Among statements with the same text the frames of the multipliers decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stc.records import dataclass, field
from stc.solution import MultiplierBlock, Solution


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the ``constraints:`` or an entry of the ``forces:``.

    Attributes:
        line: number of its first line, from 1.
        text: its text without comments and superfluous blanks.
        frames: first and last frame where it holds.
        names: the variables, derivatives and parameters in it.
        equality: whether it is an equation.
    """

    line: int
    text: str
    frames: tuple[float, float]
    names: frozenset[str]
    equality: bool


@dataclass(frozen=True, slots=True)
class Mark:
    """The multipliers of one statement: the largest in magnitude, its time, and the number of nodes where it is
    active.
    """

    text: str
    value: float
    time: float
    frame: float
    active: int
    nodes: int


@dataclass(slots=True)
class TextLine:
    """One line of the spec."""

    number: int
    text: str
    marks: list[Mark] = field(default_factory=list)


def listing(solution: Solution, statements: Sequence[Statement]) -> list[TextLine]:
    """The whole text, with marks at the first lines of statements that have multipliers."""
    lines = [TextLine(k + 1, text) for k, text in enumerate(solution.source.splitlines())]
    # A barrier leaves every inequality a small multiplier, in inverse proportion to its room; that holds nothing back.
    sizes = [np.abs(block.values).max(initial=0.0) for block in solution.multipliers if block.kind != "link"]
    least = max(1e-9, 1e-7 * max(sizes, default=0.0))
    for block in solution.multipliers:
        if block.kind == "link":
            continue
        for statement, chosen in _owners(block, statements):
            mark = _mark(solution, block, chosen, statement.text, least)
            if mark is not None:
                lines[statement.line - 1].marks.append(mark)
    return lines


def _owners(
    block: MultiplierBlock, statements: Sequence[Statement]
) -> Iterator[tuple[Statement, np.ndarray]]:
    """The statements of a block with the nodes that belong to each."""
    if block.kind == "row":
        candidates = [s for s in statements if s.text == block.label]
    else:
        candidates = [s for s in statements if s.names == {block.label}]
    free = np.ones(len(block.values), dtype=bool)
    # An equation that fixes a value takes precedence over the inequality that goes on through its frame.
    for statement in sorted(candidates, key=lambda s: not s.equality):
        first, last = statement.frames
        mine = free & (block.nodes >= first - 1e-9) & (block.nodes <= last + 1e-9)
        if statement.equality:
            free &= ~mine
        yield statement, np.flatnonzero(mine)


def _mark(
    solution: Solution, block: MultiplierBlock, chosen: np.ndarray, text: str, least: float
) -> Mark | None:
    """The mark for the chosen nodes of a block; multipliers smaller than ``least`` count as zero."""
    if not len(chosen):
        return None
    values = block.values[chosen]
    at = int(np.argmax(np.abs(values)))
    frame = float(block.nodes[chosen[at]])
    time = float(np.interp(frame, np.arange(solution.n + 1), solution.time))
    active = int(np.count_nonzero(np.abs(values) > least))
    return Mark(text, float(values[at]), time, frame, active, len(values))
