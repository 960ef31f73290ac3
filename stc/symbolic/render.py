"""Readable infix text of an expression, in the notation of the spec language."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stc.records import dataclass
from stc.symbolic import node as nodes
from stc.symbolic.node import Expr
from stc.symbolic.traverse import postorder

_SUM, _SIGNED, _PRODUCT, _POWER, _ATOM = 1, 2, 3, 4, 5
_NUMBER, _NAME, _OTHER = 0, 1, 2


@dataclass(frozen=True, slots=True)
class _Text:
    """A rendered node: how tightly it binds, and its summands or factors with the kind that sorts them."""

    text: str
    strength: int
    kind: int = _OTHER
    terms: tuple[_Text, ...] = ()
    factors: tuple[_Text, ...] = ()

    def within(self, needed: int) -> str:
        return self.text if self.strength >= needed else f"({self.text})"


def number_text(value: float) -> str:
    """The shortest text that reads back as the value, without a trailing ``.0``."""
    text = repr(value)
    return text[:-2] if text.endswith(".0") else text


def _sum(parts: tuple[_Text, ...]) -> _Text:
    # Operands come in the structural order of their nodes; for the reader, positive ones first, numbers last.
    ordered = sorted(
        parts, key=lambda p: (p.text.startswith("-"), p.kind == _NUMBER, p.text * (p.kind == _NAME))
    )
    text = ordered[0].text
    for part in ordered[1:]:
        text += f" - {part.text[1:]}" if part.text.startswith("-") else f" + {part.text}"
    return _Text(text, _SUM, terms=parts)


def _product(parts: tuple[_Text, ...]) -> _Text:
    ordered = sorted(parts, key=lambda p: (p.kind, p.text * (p.kind == _NAME)))
    return _Text("*".join(p.within(_PRODUCT) for p in ordered), _PRODUCT, factors=parts)


def _number(value: float) -> _Text:
    text = number_text(value)
    return _Text(text, _SIGNED if text.startswith("-") else _ATOM, _NUMBER)


def _compound(op: str, args: list[_Text]) -> _Text:
    a, b = args[0], args[-1]
    if op == "neg":
        return _Text("-" + a.within(_PRODUCT), _SIGNED)
    if op == "add":
        return _sum((*(a.terms or (a,)), *(b.terms or (b,))))
    if op == "sub":
        return _Text(f"{a.text} - {b.within(_PRODUCT)}", _SUM)
    if op == "mul":
        if a is b:
            return _Text(a.within(_ATOM) + "^2", _POWER)
        if a.kind == _NUMBER and a.text.startswith("-"):
            # -3*x: the sign is part of the number and needs no parentheses in front.
            return _Text(f"{a.text}*{b.within(_PRODUCT)}", _SIGNED)
        return _product((*(a.factors or (a,)), *(b.factors or (b,))))
    if op == "div":
        return _Text(f"{a.within(_SIGNED)}/{b.within(_POWER)}", _PRODUCT)
    if op == "pow":
        exponent = b.text if b.kind == _NUMBER else b.within(_POWER)
        return _Text(f"{a.within(_ATOM)}^{exponent}", _POWER)
    return _Text(f"{op}({', '.join(arg.text for arg in args)})", _ATOM)


def _looked_up(node: Expr, done: Mapping[Expr, _Text]) -> _Text:
    """A table with its arguments; a function of time as it is written, without."""
    x, place = node.args
    leaf = place.args[1] if place.op == "at" else place
    if leaf.payload.of_time:
        return done[leaf]
    arguments = [x, *place.args[:1]]
    return _Text(f"{done[leaf].text}({', '.join(done[each].text for each in arguments)})", _ATOM)


def render(e: Expr, name_of: Callable[[Any], str] = str, limit: int = 20_000) -> str:
    """Infix text of ``e``; ``name_of`` turns symbol keys into names.

    ``x*x`` is printed as ``x^2``; names in sums and products are sorted, numbers stand last in sums and first
    in products.  Shared subexpressions are written out wherever they occur, so the text can be far
    longer than the expression: a part whose text exceeds ``limit`` characters is printed as ``...``.
    """
    done: dict[Expr, _Text] = {}
    for node in postorder([e]):
        if node.op == "num":
            done[node] = _number(node.payload)
        elif node.op == "sym":
            done[node] = _Text(name_of(node.payload), _ATOM, _NAME)
        elif node.op == "table":
            done[node] = _Text(str(node.payload), _ATOM, _NAME)
        elif node.op == "at":
            done[node] = done[node.args[0]]
        elif node.op == "look":
            done[node] = _looked_up(node, done)
        else:
            part = _compound(node.op, [done[arg] for arg in node.args])
            done[node] = part if len(part.text) <= limit else _Text("...", _ATOM)
    return done[e].text


#: Levels of an expression whose text is short enough to look at.
_SHALLOW = 12


def _shown(e: Expr) -> str:
    return render(e) if e.order >> nodes._HASH_BITS <= _SHALLOW else f"{e.op} ..."


nodes.shown = _shown
