"""`abs`, `min`, `max`, `sign` and `floor`: their values for known arguments, and replacements for unknown ones.

With constant arguments their value is a number; with `t`, `i` and data as arguments they are ordinary functions.
With an unknown, ``abs(e)`` stands for ``sqrt(e^2)``, ``max(a, b)`` for ``(a + b + sqrt((a - b)^2))/2``. They may stay
in products that are smooth, such as ``v*abs(v)`` and ``max(0, x)^2`` (:mod:`stc.language.smoothing`). Elsewhere they
have no derivative; the message then has the lines that state the same without a kink.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from stc.language import syntax
from stc.language.name_table import DATA_SET
from stc.language.numbers import OF_NUMBERS, count_fits
from stc.problem import CellRef, ConstantRef, IndexRef, TimeRef
from stc.symbolic.expr import Expr, add, call, evaluate, mul, num, pow_, reachable, sub, symbols

if TYPE_CHECKING:
    from stc.language.expressions import ExpressionBuilder


def kinked(builder: ExpressionBuilder, node: syntax.Call, arguments: Sequence[Expr]) -> Expr:
    """A call of one of :data:`KINKED`; mistakes are added in the builder."""
    name = node.function
    if builder.poisoned:
        return num(0.0)
    if not count_fits(name, len(arguments)):
        return builder.fail(node, *_wrong_count(builder, node, len(arguments)))
    keys = [key for argument in arguments for key in symbols(argument)]
    if all(isinstance(key, ConstantRef) for key in keys):
        values = {key: builder.positions.structural_value(key.name) for key in keys}
        if None in values.values():
            builder.poisoned = True
            return num(0.0)
        return num(float(OF_NUMBERS[name](*(float(evaluate(e, values)) for e in arguments))))
    if name in ("sign", "floor"):
        known = all(isinstance(key, ConstantRef | IndexRef | TimeRef) for key in keys)
        return builder.fail(node, *_no_slope(builder, node, known))
    found = arguments[0]
    if name == "abs":
        return _noted(builder, node, found)
    for other in arguments[1:]:
        gap = _noted(builder, node, sub(found, other))
        found = mul(num(0.5), (add if name == "max" else sub)(add(found, other), gap))
    return found


def _noted(builder: ExpressionBuilder, node: syntax.Call, e: Expr) -> Expr:
    """The absolute value of an expression; if it contains an unknown, its kink is recorded."""
    found = call("sqrt", pow_(e, num(2.0)))
    if not all(isinstance(key, ConstantRef | IndexRef | TimeRef | CellRef) for key in symbols(e)):
        builder.kinks[found] = node
    return found


def kinks_in(builder: ExpressionBuilder, e: Expr) -> list[syntax.Call]:
    """The calls from which an expression has kinks; of nested calls the outermost one."""
    if not builder.kinks:
        return []
    found = {(n.start, n.end): n for n in (builder.kinks[e] for e in reachable([e]) if e in builder.kinks)}
    within = {
        (part.start, part.end)
        for node in found.values()
        for argument in node.arguments
        for part in syntax.walk(argument)
    }
    return [node for place, node in found.items() if place not in within]


# ------------------------------------------------------------------------------------------------ what to write


def _text(builder: ExpressionBuilder, node: syntax.Node) -> str:
    return syntax.statement_text(builder.diagnostics.source, node)


def _tight(builder: ExpressionBuilder, node: syntax.Expression) -> str:
    """The text of an operand after a minus."""
    text = _text(builder, node)
    return text if isinstance(node, syntax.Name | syntax.Number | syntax.Call | syntax.Prime) else f"({text})"


def _negative(builder: ExpressionBuilder, node: syntax.Expression) -> str:
    if isinstance(node, syntax.Number) and not node.value:
        return "0"
    return _text(builder, node.operand) if isinstance(node, syntax.Negate) else f"-{_tight(builder, node)}"


def _wrong_count(builder: ExpressionBuilder, node: syntax.Call, given: int) -> tuple[str, str]:
    name = node.function
    if name in ("min", "max") and given == 1:
        new = _free_name(builder, node)
        sign = "<=" if name == "max" else ">="
        argument = _text(builder, node.arguments[0])
        hint = (
            f"for the {'largest' if name == 'max' else 'smallest'} value over the frames write\n"
            f"parameters: {new};\nconstraints: [0, n]: {argument} {sign} {new};\nand `{new}` in place of "
            f"`{_text(builder, node)}`"
        )
        return f"`{name}` takes two arguments or more, not 1", hint
    wanted = "two arguments or more" if name in ("min", "max") else "1 argument"
    return f"`{name}` takes {wanted}, not {given}", ""


def _no_slope(builder: ExpressionBuilder, node: syntax.Call, known: bool) -> tuple[str, str]:
    """The message and hint for a call that jumps; ``known`` if it contains no unknown."""
    text = _text(builder, node)
    argument = node.arguments[0]
    if known:
        hint = (
            "the frames are known at which it jumps: write a value for each stretch of them, as in\n"
            "definitions: [0, n/2]: step = 0; [n/2, n]: step = 1;\n"
            f"and `step` in place of `{text}`"
        )
        return f"`{text}` jumps at some frame, where it has no slope", hint
    if node.function == "floor":
        hint = "solvers that follow slopes find no whole numbers: make it a constant, and solve for each (`--set`)"
        return f"`{text}` jumps from one whole number to the next", hint
    of = _text(builder, argument)
    hint = (
        f"`{_tight(builder, argument)}*abs({of})` is smooth and stands for `{text}*{_tight(builder, argument)}^2`; "
        f"else take\n`tanh({_tight(builder, argument)}/e)` with a small constant `e`, as in "
        f"`constants: e = 0.01;`"
    )
    return f"`{text}` jumps where `{of}` is 0", hint


def _free_name(builder: ExpressionBuilder, node: syntax.Call) -> str:
    """A name for the value of a call that the spec does not use yet."""
    first = next((name for argument in node.arguments for name in syntax.names(argument)), "")
    word = "".join(c if c.isalnum() or c == "_" else "_" for c in first.rpartition(".")[2])
    plain = f"{node.function}_{word}" if word else f"{node.function}imum"
    name, count = plain, 1
    while name in builder.table.entries:
        count += 1
        name = f"{plain}{count}"
    return name


def advice(
    builder: ExpressionBuilder, node: syntax.Call, statement: syntax.Node, section: str, header: str
) -> tuple[str, str]:
    """The message and hint for a call whose kink remains in a statement.

    Args:
        builder: with the spec's text and names.
        node: the call.
        statement: the statement that contains it, directly or in a definition.
        section: section of the statement.
        header: its range header.
    """
    text, name = _text(builder, node), node.function
    if name == "abs":
        where = f"where `{_text(builder, node.arguments[0])}` is 0"
    else:
        where = "where its arguments are equal"
    message = f"`{text}` has a kink {where}, at which it has no slope"
    sides = _sides(node, statement) if section == "constraints" else None
    if sides is not None:
        lines = _relation_lines(builder, node, *sides)
        if lines:
            return message, lines
    if builder.table.kind(header.strip("[]: ")) == DATA_SET:
        return message, _rounded(builder, node)
    new = _free_name(builder, node)
    parts = [_text(builder, argument) for argument in node.arguments]
    negated = _negative(builder, node.arguments[0])
    members = [*parts, negated] if name == "abs" else parts
    weight = 0
    if section == "objective" and isinstance(statement, syntax.Relation):
        weight = _weight(statement.operands[0], node)
    if weight and (weight > 0) == (name != "min"):
        sign = ">=" if weight > 0 else "<="
        rows = " ".join(f"{new} {sign} {part};" for part in members)
        end = f"and `{new}` in place of `{text}`: at the optimum both are equal"
        return message, f"write\nvariables: {new};\nconstraints: {header} {rows}\n{end}"
    rows = _exactly(builder, node, new)
    return (
        message,
        f"write\nvariables: {new};\nconstraints: {header} {rows}\nand `{new}` in place of `{text}`",
    )


def _rounded(builder: ExpressionBuilder, node: syntax.Call) -> str:
    """The hint for rows of a data set, which have no unknowns of their own."""
    parts = [_text(builder, argument) for argument in node.arguments]
    tight = [_tight(builder, argument) for argument in node.arguments]
    shown = f"`sqrt({tight[0]}^2 + e^2)`"
    if node.function != "abs":
        sign = "+" if node.function == "max" else "-"
        shown = f"`({parts[0]} + {tight[1]} {sign} sqrt(({parts[0]} - {tight[1]})^2 + e^2))/2`"
        shown += ", and the same again with each further one" if len(parts) > 2 else ""
    return f"rows of data have no unknowns: round the kink, {shown} with a small constant `e`"


def _exactly(builder: ExpressionBuilder, node: syntax.Call, new: str) -> str:
    """The statement that a name equals a call: one of two inequalities is an equality."""
    one = _tight(builder, node.arguments[0])
    if node.function == "abs":
        return f"0 <= {new} - {one} complements {new} + {one} >= 0;"
    *others, last = node.arguments
    if len(others) > 1:  # of three and more, the last one against the rest
        inner = f"{node.function}({', '.join(_text(builder, each) for each in others)})"
    else:
        inner = one
    other = _tight(builder, last)
    if node.function == "max":
        return f"0 <= {new} - {inner} complements {new} - {other} >= 0;"
    return f"0 <= {inner} - {new} complements {other} - {new} >= 0;"


def _sides(node: syntax.Call, statement: syntax.Node) -> tuple[str, syntax.Expression] | None:
    """The sign and the other side of a relation with a call on one side."""
    if not isinstance(statement, syntax.Relation) or len(statement.operators) != 1:
        return None
    left, right = statement.operands
    sign = statement.operators[0]
    if left == node and node not in list(syntax.walk(right)):
        return sign, right
    if right == node and node not in list(syntax.walk(left)):
        return {"<=": ">=", ">=": "<="}.get(sign, sign), left
    return None


def _relation_lines(
    builder: ExpressionBuilder, node: syntax.Call, sign: str, other: syntax.Expression
) -> str:
    """The replacement for ``call <= other`` and similar; empty if there is no simple one."""
    limit = _text(builder, other)
    parts = [_text(builder, argument) for argument in node.arguments]
    name = node.function
    if sign == "=":
        if isinstance(other, syntax.Name) and len(node.arguments) < 3:
            return f"write `{_exactly(builder, node, limit)}`"
        return ""
    if name == "abs" and sign == "<=":
        return f"write `{_negative(builder, other)} <= {parts[0]} <= {limit};`"
    if (name == "max") == (sign == "<=") and name != "abs":
        rows = " ".join(f"{part} {sign} {limit};" for part in parts)
        return f"write `{rows}`"
    members = [*parts, _negative(builder, node.arguments[0])] if name == "abs" else parts
    rows = " or ".join(f"`{part} {sign} {limit};`" for part in members)
    return f"this leaves a choice to you: state {rows} on the frames where it is to hold"


def _weight(e: syntax.Expression, wanted: syntax.Call) -> int:
    """The sign with which a call enters a sum: 1 or -1, 0 if it is not known."""
    if e == wanted and e.start == wanted.start:
        return 1
    if isinstance(e, syntax.Sum):
        signs = [(1 if sign == "+" else -1) * _weight(term, wanted) for sign, term in e.terms]
        return next((sign for sign in signs if sign), 0)
    if isinstance(e, syntax.Negate):
        return -_weight(e.operand, wanted)
    if isinstance(e, syntax.Call) and e.function == "integral" and len(e.arguments) == 1:
        return _weight(e.arguments[0], wanted)
    if isinstance(e, syntax.Product):
        found = [
            (k, _weight(factor, wanted)) for k, (operator, factor) in enumerate(e.factors) if operator == "*"
        ]
        inside = next(((k, sign) for k, sign in found if sign), None)
        others = [factor for k, (_, factor) in enumerate(e.factors) if inside is not None and k != inside[0]]
        if inside is not None and all(isinstance(other, syntax.Name | syntax.Number) for other in others):
            return inside[1]  # constants with names are weights, which are positive
    return 0
