"""The stages of reading a spec, as text: tokens, syntax tree, problem.

Syntax is printed in the language itself, one statement a line, with parentheses only where they are needed; reading
the output gives the same tree.
"""

from __future__ import annotations

from collections.abc import Iterator

from stc.errors import Source
from stc.language import syntax
from stc.language.diagnostics import Diagnostics
from stc.language.lexer import tokenize
from stc.language.show_data import described, show_data_statement
from stc.problem import Problem
from stc.symbolic.expr import Expr, reachable, render
from stc.symbolic.render import number_text

#: Expressions with more operations than this (counting shared ones each time) are not written out.
LONGEST_TEXT = 20_000

_INDENT = "  "
_SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(5)


def show_tokens(source: Source) -> str:
    """Every token on a line of its own: line:column, kind, characters."""
    tokens = tokenize(source, Diagnostics(source), repetitions=True)
    lines = []
    for index, kind in enumerate(tokens.kinds):
        line, column = source.position(tokens.starts[index])
        text = tokens.text(index)
        lines.append(f"{line:4d}:{column:<4d} {kind if kind.isalpha() else 'symbol':8s} {text}".rstrip())
    return "\n".join(lines)


def show_expression(node: syntax.Expression) -> str:
    """An expression in the language, with necessary parentheses only."""
    return _text(node, _SUM)


def _text(node: syntax.Expression, needed: int) -> str:
    """The text of a node where its surroundings bind with strength ``needed``."""
    text, strength = _bare(node)
    return text if strength >= needed else f"({text})"


def _bare(node: syntax.Expression) -> tuple[str, int]:
    if isinstance(node, syntax.Number):
        return number_text(node.value), _ATOM
    if isinstance(node, syntax.Name):
        return node.name, _ATOM
    if isinstance(node, syntax.Negate):
        return "-" + _text(node.operand, _SIGN), _SIGN
    if isinstance(node, syntax.Sum):
        first, *others = node.terms
        parts = [_text(first[1], _PRODUCT)]
        parts += [f" {sign} {_text(term, _PRODUCT)}" for sign, term in others]
        return "".join(parts), _SUM
    if isinstance(node, syntax.Product):
        first, *others = node.factors
        parts = [_text(first[1], _SIGN)]
        parts += [f"{operator}{_text(factor, _SIGN)}" for operator, factor in others]
        return "".join(parts), _PRODUCT
    if isinstance(node, syntax.Power):
        return f"{_text(node.base, _ATOM)}^{_text(node.exponent, _SIGN)}", _POWER
    if isinstance(node, syntax.Call):
        return f"{node.function}({', '.join(_text(a, _SUM) for a in node.arguments)})", _ATOM
    if isinstance(node, syntax.Prime):
        return _text(node.operand, _ATOM) + "'" * node.order, _ATOM
    if isinstance(node, syntax.Member):
        fields = "".join(f".{field}" for field in node.fields)
        return f"{_text(node.operand, _ATOM)}{fields}", _ATOM
    if isinstance(node, syntax.Vector):
        return f"({', '.join(_text(item, _SUM) for item in node.items)})", _ATOM
    return f"{_text(node.operand, _ATOM)}[{_text(node.index, _SUM)}]", _ATOM


def show_header(header: syntax.RangeHeader) -> str:
    """The header of a range of frames as text: ``[a, b]:``, or ``[a]:`` for one frame."""
    ends = [header.first] if header.last is None else [header.first, header.last]
    return f"[{', '.join(show_expression(end) for end in ends)}]:"


def show_statement(node: syntax.Statement) -> str:
    """One statement with its ``;`` (a declaration without the separator of its list)."""
    if isinstance(node, syntax.Declaration):
        return node.name.name if node.value is None else f"{node.name.name} = {show_expression(node.value)}"
    if isinstance(node, syntax.Assignment):
        return f"{node.name.name} = {show_expression(node.value)};"
    if isinstance(node, syntax.Relation):
        parts = [show_expression(node.operands[0])]
        for operator, operand in zip(node.operators, node.operands[1:]):
            parts += [operator, show_expression(operand)]
        return " ".join(parts) + ";"
    if isinstance(node, syntax.JumpList):
        return ", ".join(show_expression(quantity) for quantity in node.quantities) + ";"
    if isinstance(node, syntax.MethodChoice):
        return node.name + ";"
    if isinstance(node, syntax.ModelFile):
        words = "".join(
            f" {word} {', '.join(name.name for name in names)}"
            for word, names in (("with", node.additions), ("without", node.without))
            if names
        )
        return f'model = "{node.path}"{words};'
    if isinstance(node, syntax.ContactDeclaration):
        pose = ", ".join(show_expression(part) for part in node.pose)
        options = [n.name if v is None else f"{n.name} = {show_expression(v)}" for n, v in node.options]
        return ", ".join([f"{node.name.name} = {node.kind.name}({pose})", *options]) + ";"
    if isinstance(node, syntax.ContactPlace):
        at = ", ".join(show_expression(place) for place in node.at)
        on = "" if node.on is None else f" on {node.on.name}"
        slides = "" if node.slides is None else f" slides {node.slides.name}"
        return f"{node.name.name}{on} at {at}{slides};" if at else f"{node.name.name}{on}{slides};"
    if isinstance(node, syntax.Pose):
        return _pose(node) + ";"
    if isinstance(node, syntax.PoseDefinition):
        changes = [f", {change.name.name} = {show_expression(change.value)}" for change in node.changes]
        return f"{node.name.name} = {_pose(node.pose)}{''.join(changes)};"
    if not isinstance(node, syntax.Channel):
        return show_data_statement(node, show_expression)
    path = ".".join(part if part.isidentifier() else f'"{part}"' for part in node.path)
    return f"{node.kind} {path} = {show_expression(node.value)};"


def _pose(node: syntax.Pose) -> str:
    text = node.base.name + " mirrored" * node.mirrored
    if node.shift is not None:
        text += f" + {show_expression(node.shift)}"
    if node.angle is not None and node.axis is not None:
        text += f" turned {show_expression(node.angle)} about {show_expression(node.axis)}"
    return text + " grounded" * node.grounded


def show_syntax(tree: syntax.SpecTree) -> str:
    """The syntax tree, as a spec in canonical form."""
    lines: list[str] = []
    for section in tree.sections:
        lines.append(f"{section.kind}:")
        for block in section.blocks:
            indent = _INDENT
            if block.header is not None:
                lines.append(f"{indent}{show_header(block.header)}")
                indent += _INDENT
            elif block.free:
                lines.append(f"{indent}free:")
                indent += _INDENT
            texts = [show_statement(statement) for statement in block.statements]
            if section.kind == "forces":
                texts = [text.replace(" =", ":", 1) for text in texts]
            if section.kind == "model":
                texts = [text.removeprefix("model = ") for text in texts]
            if block.statements and isinstance(block.statements[0], syntax.Declaration):
                valued = any(" = " in text for text in texts)
                texts = (",\n" + indent if valued else ", ").join(texts).splitlines()
                texts = [text.strip() for text in texts]
                texts[-1] += ";"
            lines += [indent + text for text in texts]
    return "\n".join(lines)


def show_problem(problem: Problem) -> str:
    """The problem of a spec after names are resolved: numbers, bounds and expressions, section by section."""
    return "\n".join(_problem_lines(problem))


def _problem_lines(problem: Problem) -> Iterator[str]:
    yield f"{problem.name}: frames 0 to {problem.n}, step {render(problem.step)}, method {problem.method}"
    if problem.constants:
        yield "constants:"
    for name, value in problem.constants.items():
        shaping = "  # shapes the problem" if name in problem.structural else ""
        yield f"{_INDENT}{name} = {number_text(value)}{shaping}"
    if problem.data or problem.tables:
        yield "data:"
    for name, text in described(problem):
        yield f"{_INDENT}{name} = {text}"
    for title, names in (("variables", problem.variables), ("parameters", problem.parameters)):
        if names:
            yield f"{title}:\n{_INDENT}{', '.join(names)}"
    if problem.macros or problem.definitions:
        yield "definitions:"
    for name, body in problem.macros.items():
        yield f"{_INDENT}{name} = {_text_of(body)}"
    for name, pieces in problem.definitions.items():
        for piece in pieces:
            yield f"{_INDENT}{piece.range}: {name} = {_text_of(piece.body)}"
    if problem.jumps:
        yield "jumps:"
    for jump in problem.jumps:
        yield f"{_INDENT}[{jump.frame}]: {jump.name}" + "'" * jump.order
    if problem.guesses:
        yield "guess:"
    for guess in problem.guesses:
        yield f"{_INDENT}{guess.range}: {guess.name} = {render(guess.body)}"
    if problem.relations:
        yield "constraints:"
    for relation in problem.relations:
        yield f"{_INDENT}{relation.range}: {_bounded(relation.body, relation.lower, relation.upper)}"
    if problem.objective:
        yield "objective:"
    for term in problem.objective:
        text = _text_of(term.body)
        where = f"[{term.rows}]" if term.rows else str(term.range)
        yield f"{_INDENT}{where}: " + (f"integral({text})" if term.integral else text)
    if problem.model is not None or problem.replay:
        yield "replay:"
    if problem.model is not None:
        yield f'{_INDENT}model = "{problem.model}"'
    for channel in problem.replay:
        yield f"{_INDENT}{channel.kind} {'.'.join(channel.path)} = {render(channel.body)}"


def _text_of(e: Expr) -> str:
    """The text of an expression; of a very large one (sharing is lost in text) its size."""
    sizes: dict[Expr, int] = {}
    for node in reachable([e]):
        sizes[node] = 1 + sum(sizes[arg] for arg in node.args)
    return render(e) if sizes[e] <= LONGEST_TEXT else f"(an expression of {len(sizes)} distinct parts)"


def _bounded(body: Expr, lower: Expr | None, upper: Expr | None) -> str:
    text = _text_of(body)
    if lower is not None and lower is upper:
        return f"{text} = {render(lower)}"
    if lower is not None and upper is not None:
        return f"{render(lower)} <= {text} <= {render(upper)}"
    if lower is not None:
        return f"{text} >= {render(lower)}"
    return f"{text} <= {render(upper)}" if upper is not None else text
