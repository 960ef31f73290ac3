"""The declared names of a spec, and an order of names by their dependencies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.name_table import DATA_SET, TABLE, Entry, NameTable
from stc.language.words import PATH_WORDS, RESERVED
from stc.symbolic.expr import FUNCTIONS

KINDS = {
    "constants": "constant",
    "variables": "variable",
    "parameters": "parameter",
    "definitions": "definition",
}


def collect_names(
    spec: syntax.SpecTree, diagnostics: Diagnostics, overrides: Mapping[str, float] | None = None
) -> NameTable:
    """The table of all names that the sections of a spec declare, and its model's; conflicts are added as mistakes.

    Args:
        overrides: values given by the caller, possibly for numbers of a model.
    """
    table = NameTable()
    for section in spec.sections:
        kind = KINDS.get(section.kind, "")
        for block in section.blocks:
            for statement in block.statements:
                if isinstance(statement, syntax.DataFile | syntax.DataKeyframes | syntax.DataRows):
                    _declare(table, diagnostics, statement.name, DATA_SET, None)
                elif isinstance(statement, syntax.TableDefinition):
                    _declare(table, diagnostics, statement.name, TABLE, None)
                elif kind and isinstance(statement, syntax.Declaration):
                    _declare(table, diagnostics, statement.name, kind, statement.value)
                elif kind and isinstance(statement, syntax.Assignment):
                    _declare(table, diagnostics, statement.name, kind, None)
    if any(section.kind == "model" for section in spec.sections):
        from stc.language.model.scope import model_of  # which most specs do without

        written = {
            name: value for name, e in table.entries.items() if (value := _literal(e.value)) is not None
        }
        table.model = model_of(spec, {**written, **(overrides or {})}, diagnostics)
        if table.model is not None:
            _check_paths(table, table.model.constants, diagnostics)
            table.model.declare(table)
    elif any("." in name for name in table.entries):
        _check_paths(table, {}, diagnostics)
    return table


def _literal(value: syntax.Expression | None) -> float | None:
    """The value of a number, also with a minus sign; None for other expressions."""
    if isinstance(value, syntax.Negate):
        inner = _literal(value.operand)
        return None if inner is None else -inner
    return value.value if isinstance(value, syntax.Number) else None


def _check_paths(table: NameTable, numbers: Mapping[str, float], diagnostics: Diagnostics) -> None:
    """Add mistakes for declared paths that are not numbers of the model."""
    for name, entry in table.entries.items():
        if "." in name and (entry.kind not in ("constant", "parameter") or name not in numbers):
            hint = (
                did_you_mean(name, numbers)
                or "numbers of the model can be given or, where they are not 0, be parameters: `body.NAME.mass`"
            )
            message = f"`{name}` is not a number of the model that can be a {entry.kind}"
            diagnostics.error(message, entry.start, entry.end, hint)


def _declare(
    table: NameTable, diagnostics: Diagnostics, name: syntax.Name, kind: str, value: syntax.Expression | None
) -> None:
    word = name.name
    if word in RESERVED:
        diagnostics.error(
            f"`{word}` is reserved: {RESERVED[word]}", name.start, name.end, "choose another name"
        )
        return
    if word in FUNCTIONS:
        diagnostics.error(f"`{word}` is a function", name.start, name.end, "choose another name")
        return
    if kind == DATA_SET and word in PATH_WORDS:
        message = f"`{word}` is what paths of a model begin with"
        diagnostics.error(message, name.start, name.end, "choose another name")
        return
    if word == "n" and kind != "constant":
        hint = "declare it under `constants:`"
        diagnostics.error("`n` is the number of the last frame, a constant", name.start, name.end, hint)
        return
    if word == "h" and kind in (DATA_SET, TABLE):
        message = "`h` is the time from one frame to the next"
        diagnostics.error(message, name.start, name.end, "choose another name")
        return
    if word == "h" and kind in ("variable", "parameter"):
        hint = "declare a parameter of another name, such as `T`, and define `h = T/n` under `definitions:`"
        message = f"`h` is the time from one frame to the next; it cannot be a {kind}"
        diagnostics.error(message, name.start, name.end, hint)
        return
    first = table.entries.get(word)
    if first is None:
        table.entries[word] = Entry(word, kind, name.start, name.end, value)
    elif not (kind == first.kind == "definition"):
        line = diagnostics.source.position(first.start)[0]
        message = f"`{word}` is declared already, as a {first.kind} on line {line}"
        hint = "every name stands for one thing"
        place = diagnostics.source.place
        if place(first.start, first.end) == place(name.start, name.end):  # the same word, repeated
            hint = f"it stands within a repetition: end that with `;` before `{word}`, or number it in braces"
        diagnostics.error(message, name.start, name.end, hint)


def dependency_order(
    names: Iterable[str], needs: Callable[[str], Iterable[str]]
) -> tuple[list[str], list[list[str]]]:
    """The names, each after its dependencies, and the cycles that were found.

    A cycle is listed as ``[a, b, ..., a]``; its names still appear in the order.  Depth-first search, without
    recursion, so that a chain of any length is fine.
    """
    order: list[str] = []
    cycles: list[list[str]] = []
    state: dict[str, int] = {}
    for root in names:
        if root in state:
            continue
        path = [root]
        pending = [iter(needs(root))]
        state[root] = 1
        while path:
            for name in pending[-1]:
                if name not in state:
                    state[name] = 1
                    path.append(name)
                    pending.append(iter(needs(name)))
                    break
                if state[name] == 1:
                    cycles.append([*path[path.index(name) :], name])
            else:
                pending.pop()
                done = path.pop()
                state[done] = 2
                order.append(done)
    return order, cycles
