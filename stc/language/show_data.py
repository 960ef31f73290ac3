"""Data as text: its statements in canonical form, and the content of data sets and tables."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.data_sets import DataSet
from stc.language import syntax
from stc.language.data_parser import KEYFRAMES, UNWRAP
from stc.language.diagnostics import shortened
from stc.problem import Problem
from stc.symbolic.tables import TableRef

__all__ = ["described", "show_data_statement"]

_OUTSIDE = {
    "extend": "straight on outside",
    "hold": "the last value outside",
    "error": "no value outside",
}


def show_data_statement(
    node: syntax.DataFile
    | syntax.DataKeyframes
    | syntax.DataRows
    | syntax.TableDefinition
    | syntax.GuessFrom,
    show: Callable[[syntax.Expression], str],
) -> str:
    """One statement with its ``;``; ``show`` gives the text of an expression."""
    if isinstance(node, syntax.GuessFrom):
        return f"{node.name.name};"
    if isinstance(node, syntax.DataFile):
        turned = [
            (column.name, "" if turn is None else f" = {show(turn)}") for column, turn in node.unwrapped
        ]
        options = [f", {UNWRAP} {column}{written}" for column, written in turned]
        return f'{node.name.name} = "{node.path}"{"".join(options)};'
    if isinstance(node, syntax.DataKeyframes):
        return f"{node.name.name} = {KEYFRAMES};"
    columns = ", ".join(column.name for column in node.columns)
    if isinstance(node, syntax.TableDefinition):
        options = [f", {n.name}" if v is None else f", {n.name} = {v.name}" for n, v in node.options]
        return f"{node.name.name} = table({columns}){''.join(options)};"
    rows = [f"({', '.join(show(cell) for cell in row)})" for row in node.rows]
    return f"{node.name.name} = ({columns}): {', '.join(rows)};"


def described(problem: Problem) -> list[tuple[str, str]]:
    """The name and content of every data set and table of a problem."""
    sets = [(name, _set(data)) for name, data in problem.data.items()]
    return [*sets, *((name, _table(ref)) for name, ref in problem.tables.items())]


def _set(data: DataSet) -> str:
    where = f"`{data.where}`, " if data.where else ""
    columns = []
    for name, values in data.columns.items():
        known = values[np.isfinite(values)]
        text = name + (f" {values.shape[0]} by {values.shape[1]}" if values.ndim > 1 else "")
        text += f" {known.min():.6g} to {known.max():.6g}" if known.size else ""
        gaps = values.size - known.size
        columns.append(text + (f" ({gaps} empty)" if gaps else "" if known.size else " (empty)"))
    return f"{where}{data.rows} row{'s' if data.rows != 1 else ''}: {', '.join(shortened(columns))}"


def _table(ref: TableRef) -> str:
    table = ref.table
    axes = [f"{len(axis.x)} places from {axis.x[0]:.6g} to {axis.x[-1]:.6g}" for axis in table.axes]
    return f"{table.kind}, {' by '.join(axes)}, {_OUTSIDE[table.outside]}"
