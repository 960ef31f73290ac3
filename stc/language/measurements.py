"""Terms of the objective that are summed over the rows of a data set: their valid contents."""

from __future__ import annotations

from stc.data_sets import TIME
from stc.language import syntax
from stc.language.context import Context
from stc.language.recorded import references
from stc.language.turned import bare
from stc.problem import CellRef, ConstantRef, DefinitionRef, IndexRef, TimeRef, VariableRef
from stc.symbolic.expr import Expr, symbols


def stands_on_rows(context: Context, e: Expr, integral: bool, rows: str, node: syntax.Node) -> bool:
    """Whether a term has a value on each row of the data set ``rows``; mistakes are added."""
    found = _mistake(context, e, integral, rows)
    if found is not None:
        context.error(node, *found)
    context.table.entries[rows].used = True
    if found is None and context.data is not None and rows in context.data.sets:
        for key in bare(e):
            if isinstance(key, CellRef):
                context.data.warn_of_leaps(key.data, key.column, node.start, node.end)
    return found is None and context.data is not None and rows in context.data.sets


def _mistake(context: Context, e: Expr, integral: bool, rows: str) -> tuple[str, str] | None:
    """The message and hint for an invalid term."""
    if integral:
        return (
            "an integral is over time, not over rows",
            "leave `integral` out: the term is summed over the rows",
        )
    moves = False
    for key in symbols(e):
        if isinstance(key, IndexRef):
            return "rows have no index `i`", f"name what you need as a column of `{rows}`"
        if isinstance(key, DefinitionRef):
            hint = "write its formula out, or define it without a range header"
            return f"`{key.name}` has range headers, and rows stand on no frame", hint
        if isinstance(key, VariableRef) and (key.side or (key.scale, key.shift) != (1, 0)) and key.scale != 0:
            return (
                f"`{key}` belongs to a frame, and rows stand between them",
                f"write `{key.name}`, at the time of the row",
            )
        moves = moves or isinstance(key, TimeRef) or (isinstance(key, VariableRef) and key.scale != 0)
    again = [ref.name for ref in references(e, context.builder.pieces) if ref.name.startswith(f"{rows}.")]
    if again:
        hint = f"write what the definition says under `[{rows}]:` itself, where `{again[0]}` is the number of the row"
        return f"a definition reads `{again[0]}` as a function of time", hint
    data = None if context.data is None else context.data.sets.get(rows)
    if moves and data is not None and (data.time is None or data.time.shape != (data.rows,)):
        return f"`{rows}` has no column `{TIME}`, which is needed here", f"add a column `{TIME}`, in seconds"
    return None


def placing_rows(context: Context, step: Expr) -> frozenset[str]:
    """The constants that determine the step of each row."""
    bodies = [step, *(piece.body for piece in context.builder.pieces.get("h", ()))]
    names = {key.name for body in bodies for key in symbols(body) if isinstance(key, ConstantRef)}
    return frozenset(each for name in names for each in context.constants.made_from(name))
