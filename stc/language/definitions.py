"""Definitions: macros, which are one formula everywhere, and ranged definitions with their pieces.

A definition whose value is the same formula on every frame is a macro: it is replaced by its value wherever
it is used.  One that stands under range headers keeps its name (:class:`stc.problem.DefinitionRef`), since
which piece it means depends on the frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from stc.language import syntax
from stc.language.diagnostics import Diagnostics, shortened
from stc.language.name_table import NameTable
from stc.language.names import dependency_order
from stc.problem import DefinitionPiece
from stc.records import dataclass


@dataclass(slots=True)
class Formula:
    """One statement `name = value;` of a definitions section; ``header`` is None before any range header."""

    name: syntax.Name
    value: syntax.Expression
    header: syntax.RangeHeader | None


@dataclass(slots=True)
class Definitions:
    """All formulas by name, and the names in an order in which each comes after those it uses."""

    formulas: dict[str, list[Formula]]
    order: list[str]
    circular: set[str]

    def unranged(self) -> dict[str, syntax.Expression]:
        """The values of the definitions that are one formula without a header."""
        return {
            name: found[0].value
            for name, found in self.formulas.items()
            if len(found) == 1 and found[0].header is None and name not in self.circular
        }


def collect_definitions(spec: syntax.SpecTree, table: NameTable, diagnostics: Diagnostics) -> Definitions:
    """Collect the formulas of all definitions sections; repeated and circular ones are mistakes."""
    formulas: dict[str, list[Formula]] = {}
    for block in spec.blocks("definitions"):
        for statement in block.statements:
            if not isinstance(statement, syntax.Assignment):
                continue
            name = statement.name
            if table.kind(name.name) != "definition":
                continue
            known = formulas.setdefault(name.name, [])
            plain = [formula for formula in known if formula.header is None]
            if block.header is None and plain:
                line = diagnostics.source.position(plain[0].name.start)[0]
                message = f"`{name.name}` is defined already, on line {line}"
                hint = "put the two under range headers if each holds on some frames"
                diagnostics.error(message, name.start, name.end, hint)
                continue
            known.append(Formula(name, statement.value, block.header))

    def needs(name: str) -> list[str]:
        inside = [other for formula in formulas[name] for other in syntax.names(formula.value)]
        return [other for other in dict.fromkeys(inside) if other in formulas]

    # the step first: the time at another frame (`t[k]`) is made of it
    order, cycles = dependency_order(sorted(formulas, key=lambda name: name != "h"), needs)
    circular: set[str] = set()
    for cycle in cycles:
        if not circular.intersection(cycle):
            name = formulas[cycle[0]][0].name
            chain = " uses ".join(shortened([f"`{each}`" for each in cycle]))
            message = f"the definition `{name.name}` is made of itself"
            diagnostics.error(message, name.start, name.end, chain)
        circular.update(cycle)
    return Definitions(formulas, order, circular)


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive frames on which the same piece of a definition by ranges holds; ``None`` where none does."""

    first: int
    last: int
    piece: DefinitionPiece | None


def runs(pieces: Sequence[DefinitionPiece], first: int, last: int) -> list[Run]:
    """The valid piece for the frames ``first..last``; of overlapping pieces the later one."""
    if first > last:
        return []
    edges = {first, last + 1}
    for piece in pieces:
        for edge in (piece.range.first, piece.range.last + 1):
            if first < edge <= last:
                edges.add(edge)
    cuts = sorted(edges)
    found: list[Run] = []
    for start, stop in pairwise(cuts):
        holding = None
        for piece in pieces:
            if piece.range.first <= start <= piece.range.last:
                holding = piece
        if found and found[-1].piece is holding:
            found[-1] = Run(found[-1].first, stop - 1, holding)
        else:
            found.append(Run(start, stop - 1, holding))
    return found
