"""The adjustable constants of a spec: names, values, ranges, and comments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.language.syntax import Declaration, Negate, Number
from stc.records import dataclass
from stc.solution import Solution

if TYPE_CHECKING:
    from stc.pipeline import Model


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant that the user may change.

    Attributes:
        name: as the spec has it.
        value: that of the motion that is shown.
        low, high: range of its slider; any number may be typed in.
        note: the comment on its line, where there is one.
        structural: whether frames and ranges depend on it: after a change the program is derived again, which takes
            longer.
    """

    name: str
    value: float
    low: float
    high: float
    note: str
    structural: bool


def constants_of(model: Model, solution: Solution) -> list[Constant]:
    """The constants of a spec that are plain numbers, in the order of the text, structural ones last.

    Constants that the spec computes from others follow those and are left out, unless they were given from outside.

    Args:
        model: the spec.
        solution: one of its motions: the values that it has now.
    """
    structural = model.problem(solution.method, **solution.overrides).structural
    found: list[Constant] = []
    for declaration in _declarations(model):
        name = declaration.name.name
        if not (_is_number(declaration) or name in solution.overrides) or name not in solution.constants:
            continue
        value = solution.constants[name]
        low, high = slider_range(value)
        note = _note(model.text, declaration.end)
        found.append(Constant(name, value, low, high, note, name in structural))
    return sorted(found, key=lambda constant: constant.structural)


def slider_range(value: float) -> tuple[float, float]:
    """A range around a value: from zero to twice the value, or -1 to 1 if it is zero."""
    if value == 0.0:
        return -1.0, 1.0
    return min(0.0, 2.0 * value), max(0.0, 2.0 * value)


def _declarations(model: Model) -> list[Declaration]:
    return [
        statement
        for section in model.tree.sections
        if section.kind == "constants"
        for block in section.blocks
        for statement in block.statements
        if isinstance(statement, Declaration)
    ]


def _is_number(declaration: Declaration) -> bool:
    value = declaration.value
    if isinstance(value, Negate):
        value = value.operand
    return isinstance(value, Number)


def _note(text: str, end: int) -> str:
    """The comment after the character ``end`` on its line; empty if another declaration comes first."""
    line = text[end : text.find("\n", end) if "\n" in text[end:] else len(text)]
    before, hash_, comment = line.partition("#")
    return comment.strip() if hash_ and not before.strip(" ,;\t") else ""
