"""Hints for vectors, lists and conditionals, which the language writes differently."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from stc.language.words import SECTIONS

if TYPE_CHECKING:
    from stc.language.expression_parser import ExpressionParser


def listed(parser: ExpressionParser, opening: int) -> list[str]:
    """The texts between the commas of a bracket at a token, `(`, `[` or `{`; empty if it does not close."""
    items: list[str] = []
    begin = k = opening + 1
    depth = 1
    while parser.kinds[k] not in (";", "end"):
        depth += (parser.kinds[k] in "([{") - (parser.kinds[k] in ")]}")
        if not depth or (depth == 1 and parser.kinds[k] == ","):
            items.append(parser.text[parser.starts[begin] : parser.ends[k - 1]])
            begin = k + 1
        if not depth:
            return items
        k += 1
    return []


def vector_hint(parser: ExpressionParser, name: str) -> str:
    """The hint for ``name[3]`` in a declaration, of which the bracket is the current token."""
    if parser.kind not in ("[", "(", ".."):
        return ""
    if name in SECTIONS:
        return f"a colon is missing after the name of a section: `{name}:`"
    if parser.kind == "..":
        return _range_hint(parser, name)
    items = listed(parser, parser.at)
    count = int(items[0]) if len(items) == 1 and items[0].isdigit() and int(items[0]) else 0
    if not count:
        return f"names are single: `for k in 1..3: {name}{{k}};` declares `{name}1`, `{name}2` and `{name}3`"
    names = (
        ", ".join(f"`{name}{k}`" for k in range(1, count + 1))
        if count <= 3
        else f"`{name}1` to `{name}{count}`"
    )
    return (
        f"write `for k in 1..{count}: {name}{{k}};`, which declares {names}; "
        f"statements repeat likewise: `for k in 1..{count}: {name}{{k}} >= 0;`"
    )


def _range_hint(parser: ExpressionParser, first: str) -> str:
    """The hint for ``q1..q3``, of which the dots are the current token."""
    stem = first.rstrip("0123456789")
    begin, last = first[len(stem) :], parser.token_text(parser.at + 1)
    end = last.removeprefix(stem)
    if not (begin and end.isdigit()):
        return ""
    return f"write `for k in {begin}..{end}: {stem}{{k}};`"


def list_hint(parser: ExpressionParser, name: str) -> str:
    """The hint for ``name = [1, 2, 3]`` or ``name = (1, 2, 3)``; empty if something else follows the `=`."""
    opening = parser.kinds[parser.at + 1]
    items = listed(parser, parser.at + 1) if opening in ("[", "(") else []
    if not items or (opening == "(" and len(items) < 2):
        return ""
    written = ", ".join(f"{name}{number} = {item}" for number, item in enumerate(items, 1))
    return f"write `{written};` and repeat over them: `for k in 1..{len(items)}: ... {name}{{k}} ...;`"


def components_hint(parser: ExpressionParser) -> str:
    """The hint for ``x = [1, 2, 3]``, of which the bracket is the current token."""
    named = parser.at > 1 and parser.kinds[parser.at - 2 : parser.at] == ["name", "="]
    name = parser.token_text(parser.at - 2) if named else "x"
    items = listed(parser, parser.at)
    rows = " ".join(f"{name}{number} = {item};" for number, item in enumerate(items, 1))
    return f"state each component by itself: `{rows}`"


#: What functions of other languages come to in this one, by their arguments.
_SAID_OTHERWISE = {
    **dict.fromkeys(
        ("clip", "clamp", "sat", "saturate"), (3, "limits are statements of their own: `{1} <= {0} <= {2};`")
    ),
    **dict.fromkeys(("relu", "pos", "ramp"), (1, "write `max({0}, 0)`")),
    **dict.fromkeys(
        ("heaviside", "step"),
        (1, "it jumps; smooth is `(1 + tanh({g0}/e))/2` with a small constant `e`"),
    ),
    **dict.fromkeys(("norm", "hypot", "length"), (2, "write `sqrt({g0}^2 + {g1}^2)`")),
    "dot": (2, "products of vectors are written out: `a1*b1 + a2*b2`"),
    "cross": (2, "products of vectors are written out: `a1*b2 - a2*b1`"),
    "mod": (2, "it jumps; of what is known it is `{0} - {g1}*floor({g0}/{g1})`"),
    "ceil": (1, "of what is known it is `-floor(-{g0})`"),
    "round": (1, "of what is known it is `floor({0} + 1/2)`"),
    "trunc": (1, "of what is known it is `floor({0})`, for what is not negative"),
    "fabs": (1, "it is called `abs({0})`"),
    "sgn": (1, "it is called `sign({0})`"),
}


def function_hint(name: str, arguments: list[str]) -> str:
    """The hint for an unknown function, with the texts of its arguments; else empty."""
    wanted, hint = _SAID_OTHERWISE.get(name.lower(), (-1, ""))
    grouped = {f"g{k}": _grouped(argument) for k, argument in enumerate(arguments)}
    return hint.format(*arguments, **grouped) if wanted == len(arguments) else ""


def conditional_hint(parser: ExpressionParser) -> str:
    """The hint for ``if(x >= 0, a, b)`` and similar, of which the word is the current token."""
    at = parser.at
    parts = listed(parser, at + 1) if parser.kinds[at + 1] == "(" else []
    ends = ("<=", ">=", ",", ";", "end")
    relation = next(k for k in range(at + 1, len(parser.kinds)) if parser.kinds[k] in ends)
    if len(parts) != 3 or parser.kinds[relation] not in ("<=", ">="):
        return "statements that hold on some frames only stand under range headers, as in `[0, 10]: u = 1;`"
    _, yes, no = parts
    low = parser.text[parser.starts[at + 2] : parser.ends[relation - 1]]
    high = parts[0][parser.starts[relation + 1] - parser.starts[at + 2] :]
    if parser.kinds[relation] == "<=":
        low, high = high, low
    over = _grouped(low) if high == "0" else f"({low} - {_grouped(high)})"
    step = f"(1 + tanh({over}/e))/2"
    smooth = f"{_grouped(yes)}*{step}" if no == "0" else f"{no} + ({yes} - {_grouped(no)})*{step}"
    return (
        "where frames decide, each formula stands under a range header, as in\n"
        f"definitions: [0, 10]: chosen = {yes}; [11, n]: chosen = {no};\n"
        f"where unknowns do, this has a step and no slope; smooth is\n{smooth}\n"
        "with a small constant `e`, as in `constants: e = 0.01;`"
    )


def _grouped(text: str) -> str:
    """A text with parentheses, unless it is one word or number."""
    return text if re.fullmatch(r"[\w.']+", text) else f"({text})"
