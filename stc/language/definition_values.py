"""The values of definitions, and of the step ``h``, which has rules of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stc.arrays import distinct
from stc.errors import Span
from stc.language import syntax
from stc.language.context import Context
from stc.language.definitions import runs
from stc.problem import (
    ConstantRef,
    DefinitionPiece,
    DefinitionRef,
    FrameRange,
    IndexRef,
    ParameterRef,
    TimeRef,
    VariableRef,
)
from stc.symbolic.expr import ONE, Expr, evaluate, sym, symbols

#: Of more steps than this, evenly spaced ones are checked.
MOST_STEPS = 100_000


def define(context: Context, holds_integral: Callable[[syntax.Expression], bool]) -> None:
    """Fill the builder's macros and pieces, each definition after those that it uses.

    Definitions with an integral are only recorded: the objective expands them itself.
    """
    builder = context.builder
    for name in context.definitions.order:
        formulas = context.definitions.formulas[name]
        only = formulas[0]
        if name in context.definitions.circular:
            continue
        if len(formulas) == 1 and only.header is None and holds_integral(only.value):
            builder.integral_definitions.add(name)
            continue
        pieces: list[DefinitionPiece] = []
        sound = True
        for formula in formulas:
            builder.poisoned = False
            body = builder.build(formula.value)
            where = context.everywhere if formula.header is None else context.positions.frames(formula.header)
            if builder.poisoned or where is None:
                sound = False
            else:
                pieces.append(DefinitionPiece(body, where, context.span(formula.name)))
        if not sound:
            continue
        if len(pieces) == 1 and (pieces[0].range.first, pieces[0].range.last) == (0, context.n):
            builder.macros[name] = pieces[0].body
        else:
            builder.pieces[name] = [
                replace(piece, body=context.smooth(piece.body, piece.range, formula.value))
                for piece, formula in zip(pieces, formulas, strict=True)
            ]
    builder.poisoned = False


def work_out_step(context: Context) -> Expr:
    """``h``, checked: made of constants, parameters and ``i``, defined for every step, positive."""
    builder = context.builder
    kind = context.table.kind("h")
    pieces: list[DefinitionPiece] = []
    if kind == "definition":
        formulas = context.definitions.formulas["h"]
        node: syntax.Node = formulas[0].name
        steps = FrameRange(0, max(context.n - 1, 0))
        if "h" in builder.macros:
            parts = context.by_piece(builder.macros["h"], steps, node)
            pieces = [DefinitionPiece(body, where, context.span(node)) for where, body in parts]
            if any(isinstance(k, DefinitionRef) for k in symbols(builder.macros["h"])):
                # one formula of definitions that differ between frames: so does the step
                builder.rename_as_pieces("h", pieces)
        elif "h" in builder.pieces:
            pieces = builder.pieces["h"]
            written_out: list[DefinitionPiece] = []
            for piece in pieces:
                parts = context.by_piece(piece.body, piece.range, node)
                written_out += [DefinitionPiece(body, where, piece.span) for where, body in parts]
            pieces = builder.pieces["h"] = written_out
        step = builder.macros.get("h", sym(DefinitionRef("h")))
    elif kind == "constant" or "h" in context.constants.values:
        step = sym(ConstantRef("h"))
        entry = context.table.entries.get("h")
        start, end = (entry.start, entry.end) if entry is not None else (0, 0)
        node = syntax.Node(start, end)
        pieces = [DefinitionPiece(step, context.everywhere, Span(context.source, start, end))]
    else:
        return ONE
    builder.step = step
    context.time_is_fixed = not any(
        isinstance(k, ParameterRef | DefinitionRef) for piece in pieces for k in symbols(piece.body)
    )
    if pieces and context.constants.n is not None:
        _check_steps(context, pieces, node)
    return step


def _check_steps(context: Context, pieces: list[DefinitionPiece], node: syntax.Node) -> None:
    for piece in pieces:
        for key in symbols(piece.body):
            if isinstance(key, VariableRef | TimeRef | DefinitionRef):
                message = f"the step `h` cannot depend on `{key}`"
                at = syntax.Node(piece.span.start, piece.span.end)
                context.error(at, message, "it is made of constants, parameters and `i`")
                return
    for run in runs(pieces, 0, context.n - 1) if context.n > 0 else []:
        if run.piece is None:
            last = (
                f"after frames {run.first} to {run.last}"
                if run.first != run.last
                else f"after frame {run.first}"
            )
            if context.tell_of_stray("h", f"it is needed {last}"):
                continue
            hint = "`h` at frame i is the step from i to i + 1, needed for i = 0 to n - 1"
            context.error(node, f"`h` is not defined for the step {last}", hint)
            continue
        body = run.piece.body
        if not all(isinstance(key, ConstantRef | IndexRef) for key in symbols(body)):
            continue
        frames = distinct(np.linspace(run.first, run.last, min(run.last - run.first + 1, MOST_STEPS)).round())
        values: dict[object, object] = {}
        for key in symbols(body):
            value = context.constants.values.get(key.name) if isinstance(key, ConstantRef) else None
            if isinstance(key, ConstantRef) and value is None:
                return
            values[key] = frames if value is None else value
        steps = np.broadcast_to(evaluate(body, values), frames.shape)
        wrong = np.flatnonzero(~((steps > 0) & np.isfinite(steps)))
        if len(wrong):
            at = syntax.Node(run.piece.span.start, run.piece.span.end)
            frame = int(frames[wrong[0]])
            where = (
                ""
                if symbols(body) and all(isinstance(k, ConstantRef) for k in symbols(body))
                else f" at frame {frame}"
            )
            context.error(at, f"the step `h` is {float(steps[wrong[0]]):g}{where}", "it has to be positive")
