"""The text of the spec, line by line, with the multipliers of its statements.

A solution stores multipliers under the text of the statement, or under the name of the variable if the statement
became a bound.  This module finds the lines: constraints are split at their semicolons, and among statements with the
same text the frames of the multipliers decide.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from stc.errors import Source
from stc.records import dataclass, field
from stc.solution import MultiplierBlock, Solution

_SECTION = re.compile(r"^(\w+)\s*:", re.MULTILINE)
_RANGE = re.compile(r"\[([^\[\]]*)\]\s*:")
_NAME = re.compile(r"[A-Za-z_]\w*'*(?!\w)")


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the ``constraints:`` or an entry of the ``forces:``.

    Attributes:
        line: number of its first line, from 1.
        text: its text without comments and superfluous blanks.
        frames: first and last frame where it holds, or None if they are not known.
        names: variables, derivatives and other names in it.
        equality: whether it is an equation.
    """

    line: int
    text: str
    frames: tuple[float, float] | None
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


def listing(solution: Solution, source: Source | None = None) -> list[TextLine]:
    """The whole text, with marks at the first lines of statements that have multipliers.

    Args:
        source: the text with its repetitions written out, which maps them to lines of the spec; None for a spec without
            repetitions.
    """
    lines = [TextLine(k + 1, text) for k, text in enumerate(solution.source.splitlines())]
    statements = list(_statements(source or Source(solution.name, solution.source), solution.constants))
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


def _statements(source: Source, constants: Mapping[str, float]) -> Iterator[Statement]:
    text = re.sub(r"#[^\n]*", lambda m: " " * len(m[0]), source.text)
    heads = list(_SECTION.finditer(text))
    for head, following in zip(heads, [*heads[1:], None]):
        end = len(text) if following is None else following.start()
        if head[1] == "constraints":
            for at, words, frames in _constraints(text, head.end(), end, constants):
                equality = "<" not in words and ">" not in words
                names = frozenset(name for name in _NAME.findall(words) if name not in constants)
                yield Statement(source.position(at)[0], words, frames, names, equality)
        elif head[1] == "forces":
            for part in re.finditer(r"(\w+)\s*:[^;]*;", text[head.end() : end]):
                line = source.position(head.end() + part.start())[0]
                yield Statement(line, f"equation of motion of {part[1]}", None, frozenset(), True)


def _constraints(
    text: str, start: int, end: int, constants: Mapping[str, float]
) -> Iterator[tuple[int, str, tuple[float, float] | None]]:
    """The start, the text and the frames of each statement."""
    frames: tuple[float, float] | None = None
    for part in re.finditer(r"[^;]+", text[start:end]):
        body, at = part[0], start + part.start()
        for head in _RANGE.finditer(part[0]):
            frames = _frames(head[1], constants)
            body, at = part[0][head.end() :], start + part.start() + head.end()
        at += len(body) - len(body.lstrip())
        if body.strip():
            yield at, " ".join(body.split()), frames


def _frames(written: str, constants: Mapping[str, float]) -> tuple[float, float] | None:
    """First and last frame of a range as it is written: ``0``, ``n/2``, ``0, n``."""
    try:
        ends = [_value(part, constants) for part in written.split(",")]
    except (ValueError, SyntaxError, ZeroDivisionError, OverflowError):
        return None
    return (ends[0], ends[-1]) if len(ends) <= 2 else None


def _value(text: str, constants: Mapping[str, float]) -> float:
    """The value of an arithmetic expression of numbers and constants."""
    operations: dict[type[ast.operator], Callable[[float, float], float]] = {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
    }

    def value(node: ast.expr) -> float:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return float(node.value)
        if isinstance(node, ast.Name) and node.id in constants:
            return float(constants[node.id])
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -value(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in operations:
            return float(operations[type(node.op)](value(node.left), value(node.right)))
        raise ValueError(text)

    return value(ast.parse(text.strip(), mode="eval").body)


def _owners(block: MultiplierBlock, statements: list[Statement]) -> Iterator[tuple[Statement, np.ndarray]]:
    """The statements of a block with the nodes that belong to each."""
    if block.kind == "row":
        label = " ".join(block.label.split())
        candidates = [s for s in statements if s.text == label]
    else:
        candidates = [s for s in statements if s.names == {block.label}]
    free = np.ones(len(block.values), dtype=bool)
    # An equation that fixes a value takes precedence over the inequality that goes on through its frame.
    for statement in sorted(candidates, key=lambda s: (not s.equality, s.frames is None)):
        mine = free.copy()
        if statement.frames is not None:
            mine &= (block.nodes >= statement.frames[0] - 1e-9) & (block.nodes <= statement.frames[1] + 1e-9)
        if statement.equality or statement.frames is None:
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
