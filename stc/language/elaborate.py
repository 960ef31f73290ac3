"""A syntax tree and the numbers given from outside make a problem.

The sections are worked through in the order in which they need each other, whatever their order in the file:
names, constants, method, jumps, definitions, then constraints, objective, guesses and replay lines.  A
mistake is noted and work goes on; at the end all mistakes are raised together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from stc.errors import Span, SpecError, UsageError
from stc.language import checks, syntax
from stc.language.constants import Constants
from stc.language.definitions import collect_definitions, runs
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.expressions import ExpressionBuilder
from stc.language.frames import Frames
from stc.language.names import collect_names
from stc.language.positions import Positions
from stc.language.statements import Objective, Relations, statement_text
from stc.language.words import METHODS, RESERVED
from stc.problem import (
    ConstantRef,
    DefinitionPiece,
    DefinitionRef,
    FrameRange,
    Guess,
    IndexRef,
    Jump,
    ObjectiveTerm,
    ParameterRef,
    Problem,
    Relation,
    ReplayChannel,
    TimeRef,
    VariableRef,
)
from stc.symbolic.expr import ONE, ZERO, Expr, evaluate, substitute, sym, symbols


def elaborate(
    tree: syntax.SpecTree, overrides: Mapping[str, float] | None = None, method: str | None = None
) -> Problem:
    """The problem that a spec states.

    Args:
        tree: what :func:`stc.language.parser.parse` gave.
        overrides: values of constants by name; they win over the file's.
        method: ``central``, ``trapezoidal`` or ``hermite-simpson``; wins over the file's.

    Raises:
        SpecError: with every mistake in what the text means.
        UsageError: an override or the method names nothing that exists.
    """
    diagnostics = Diagnostics(tree.source)
    problem = elaborate_with_recovery(tree, overrides or {}, method, diagnostics)
    if problem is None or diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    return problem


def elaborate_with_recovery(
    tree: syntax.SpecTree, overrides: Mapping[str, float], method: str | None, diagnostics: Diagnostics
) -> Problem | None:
    """As :func:`elaborate`, but mistakes are added to ``diagnostics``; None where they leave no problem."""
    if method is not None and method not in METHODS:
        raise UsageError(
            f"there is no method `{method}`",
            did_you_mean(method, METHODS) or f"methods are {', '.join(METHODS)}",
        )
    return _Elaborator(tree, overrides, method, diagnostics).problem()


class _Elaborator:
    def __init__(
        self,
        tree: syntax.SpecTree,
        overrides: Mapping[str, float],
        method: str | None,
        diagnostics: Diagnostics,
    ) -> None:
        self.tree = tree
        self.source = tree.source
        self.diagnostics = diagnostics
        self.table = collect_names(tree, diagnostics)
        self.constants = Constants(self.table, overrides, diagnostics, tree.damaged)
        self.definitions = collect_definitions(tree, self.table, diagnostics)
        formulas = self.definitions.unranged()
        self.positions = Positions(self.table, self.constants, formulas, diagnostics)
        self.builder = ExpressionBuilder(self.table, self.constants, self.positions, diagnostics)
        self.n = self.constants.n if self.constants.n is not None else 0
        self.everywhere = FrameRange(0, self.n)
        self.method = self._method(method)
        self.relations = Relations(self.builder, self.is_fixed)
        self.objective = Objective(self.builder, formulas)
        self.time_is_fixed = True
        self.frames = Frames(self.n, self.method == "central", self.builder.pieces, ())
        self._fixed: dict[Expr, bool] = {}

    def problem(self) -> Problem | None:
        jumps = self._jumps()
        self.frames = Frames(self.n, self.method == "central", self.builder.pieces, jumps)
        self._definitions()
        step = self._step()
        relations = self._constraints()
        objective = self._objective()
        guesses = self._guesses()
        model, replay = self._replay()
        if self.diagnostics.error_count:
            return None
        problem = Problem(
            name=PurePath(self.source.name).stem or self.source.name,
            source=self.source,
            constants={name: value for name, value in self.constants.values.items() if value is not None},
            structural=frozenset(self.positions.structural | self.constants.made_from("n")),
            n=self.n,
            method=self.method,
            variables=self.table.of_kind("variable"),
            parameters=self.table.of_kind("parameter"),
            step=step,
            definitions=self.builder.pieces,
            relations=relations,
            objective=objective,
            guesses=guesses,
            jumps=jumps,
            model=model,
            replay=replay,
            macros=self.builder.macros,
        )
        checks.warn(problem, self.table, self.builder.first_use, self.diagnostics)
        problem.warnings = self.diagnostics.warnings()
        return problem

    # ----------------------------------------------------------------- helpers

    def span(self, node: syntax.Node) -> Span:
        return Span(self.source, node.start, node.end)

    def error(self, node: syntax.Node, message: str, hint: str = "") -> None:
        self.diagnostics.error(message, node.start, node.end, hint)

    def range(self, block: syntax.Block) -> FrameRange | None:
        """The frames of a block; None after a mistake in its header."""
        return self.everywhere if block.header is None else self.positions.frames(block.header)

    def is_fixed(self, e: Expr) -> bool:
        """Whether an expression is made of constants, ``i`` and a ``t`` that no unknown changes."""
        found = self._fixed.get(e)
        if found is None:
            known = (ConstantRef, IndexRef, TimeRef) if self.time_is_fixed else (ConstantRef, IndexRef)
            found = self._fixed[e] = all(isinstance(key, known) for key in symbols(e))
        return found

    def settled(self, e: Expr, where: FrameRange, node: syntax.Node) -> Expr:
        """``e`` without sides that mean nothing; definitions in it are checked to hold on its frames."""
        gap = self.frames.gap(e, where.first, where.last)
        if gap is not None:
            at = next(
                (
                    part
                    for operand in _expressions(node)
                    for part in syntax.walk(operand)
                    if isinstance(part, syntax.Name) and part.name == gap.name
                ),
                node,
            )
            pieces = self.builder.pieces[gap.name]
            hint = f"it is defined on {', '.join(str(piece.range) for piece in pieces)}"
            self.error(at, f"`{gap.name}` is used on {gap}, where no definition of it holds", hint)
        plain = self.frames.without_idle_sides(e, where)
        if plain is not e:
            message = "`before` and `after` mean the plain value here: nothing jumps on these frames"
            hint = "list what jumps under `jumps:`, with the frame in a range header"
            self.diagnostics.warning(message, node.start, node.end, hint)
        return plain

    # ---------------------------------------------------------- method and jumps

    def _method(self, given: str | None) -> str:
        chosen: syntax.MethodChoice | None = None
        for block in self.tree.blocks("method"):
            for statement in block.statements:
                if not isinstance(statement, syntax.MethodChoice):
                    continue
                if statement.name not in METHODS:
                    hint = did_you_mean(statement.name, METHODS) or f"methods are {', '.join(METHODS)}"
                    self.error(statement, f"there is no method `{statement.name}`", hint)
                elif chosen is None:
                    chosen = statement
                elif chosen.name != statement.name:
                    line = self.source.position(chosen.start)[0]
                    self.error(
                        statement,
                        f"the method is `{chosen.name}` already, on line {line}",
                        "keep one of them",
                    )
        return given or (chosen.name if chosen is not None else "central")

    def _jumps(self) -> list[Jump]:
        found: dict[tuple[int, str, int], Jump] = {}
        for block in self.tree.blocks("jumps"):
            where = self.range(block)
            for statement in block.statements:
                if not isinstance(statement, syntax.JumpList):
                    continue
                if block.header is None:
                    hint = "put the frame into a range header before it, as in `[20]: tau;`"
                    self.error(statement, "a jump needs a frame", hint)
                elif self.method == "central":
                    hint = "choose `method: trapezoidal;` or `method: hermite-simpson;`"
                    self.error(block.header, "the method `central` knows no jumps", hint)
                for quantity in statement.quantities:
                    named = self._jump_quantity(quantity)
                    if named is None or where is None or block.header is None:
                        continue
                    for frame in range(where.first, where.last + 1):
                        found.setdefault((frame, *named), Jump(frame, *named, self.span(quantity)))
        return sorted(found.values(), key=lambda jump: (jump.frame, jump.span.start))

    def _jump_quantity(self, node: syntax.Expression) -> tuple[str, int] | None:
        operand, order = (node.operand, node.order) if isinstance(node, syntax.Prime) else (node, 0)
        if isinstance(operand, syntax.Name):
            name = operand.name
            kind = self.table.kind(name)
            if kind == "variable":
                return name, order
            if name in self.tree.damaged:
                return None
            if kind is None and name not in RESERVED:
                hint = did_you_mean(name, self.table.of_kind("variable")) or "declare it under `variables:`"
                self.error(operand, f"`{name}` is not declared", hint)
                return None
            what = f"the {kind} `{name}`" if kind else f"`{name}`"
            self.error(node, f"{what} cannot jump", "only variables and their derivatives can")
            return None
        hint = "list variables and their derivatives, as in `x', tau`; the frame stands in the range header"
        self.error(node, "this cannot jump", hint)
        return None

    # -------------------------------------------------------------- definitions

    def _definitions(self) -> None:
        builder = self.builder
        for name in self.definitions.order:
            formulas = self.definitions.formulas[name]
            only = formulas[0]
            if name in self.definitions.circular:
                continue
            if len(formulas) == 1 and only.header is None and self.objective.holds_integral(only.value):
                builder.integral_definitions.add(name)
                continue
            pieces: list[DefinitionPiece] = []
            sound = True
            for formula in formulas:
                builder.poisoned = False
                body = builder.build(formula.value)
                where = self.everywhere if formula.header is None else self.positions.frames(formula.header)
                if builder.poisoned or where is None:
                    sound = False
                else:
                    pieces.append(DefinitionPiece(body, where, self.span(formula.name)))
            if not sound:
                continue
            if len(pieces) == 1 and (pieces[0].range.first, pieces[0].range.last) == (0, self.n):
                builder.macros[name] = pieces[0].body
            else:
                builder.pieces[name] = pieces
        builder.poisoned = False

    def by_piece(self, e: Expr, where: FrameRange, node: syntax.Node) -> list[tuple[FrameRange, Expr]]:
        """``e`` with ranged definitions written out, per part of the range on which it is one formula."""
        key = next((k for k in symbols(e) if isinstance(k, DefinitionRef)), None)
        if key is None:
            return [(where, e)]
        found: list[tuple[FrameRange, Expr]] = []
        for run in runs(self.builder.pieces[key.name], where.first, where.last):
            if run.piece is None:
                self.settled(e, FrameRange(run.first, run.last), node)
                continue
            body = substitute(e, {key: self.builder.derivative(run.piece.body, key.order)})
            found += self.by_piece(body, replace(where, first=run.first, last=run.last), node)
        return found

    def _step(self) -> Expr:
        """``h``, checked: made of constants, parameters and ``i``, there for every step, positive."""
        builder = self.builder
        kind = self.table.kind("h")
        pieces: list[DefinitionPiece] = []
        if kind == "definition":
            formulas = self.definitions.formulas["h"]
            node: syntax.Node = formulas[0].name
            if "h" in builder.macros:
                pieces = [DefinitionPiece(builder.macros["h"], self.everywhere, self.span(node))]
            elif "h" in builder.pieces:
                pieces = builder.pieces["h"]
                written_out: list[DefinitionPiece] = []
                for piece in pieces:
                    parts = self.by_piece(piece.body, piece.range, node)
                    written_out += [DefinitionPiece(body, where, piece.span) for where, body in parts]
                pieces = builder.pieces["h"] = written_out
            step = builder.macros.get("h", sym(DefinitionRef("h")))
        elif kind == "constant" or "h" in self.constants.values:
            step = sym(ConstantRef("h"))
            entry = self.table.entries.get("h")
            start, end = (entry.start, entry.end) if entry is not None else (0, 0)
            node = syntax.Node(start, end)
            pieces = [DefinitionPiece(step, self.everywhere, Span(self.source, start, end))]
        else:
            return ONE
        builder.step = step
        self.time_is_fixed = not any(
            isinstance(k, ParameterRef | DefinitionRef) for piece in pieces for k in symbols(piece.body)
        )
        if pieces and self.constants.n is not None:
            self._check_steps(pieces, node)
        return step

    def _check_steps(self, pieces: list[DefinitionPiece], node: syntax.Node) -> None:
        for piece in pieces:
            for key in symbols(piece.body):
                if isinstance(key, VariableRef | TimeRef | DefinitionRef):
                    message = f"the step `h` cannot depend on `{key}`"
                    at = syntax.Node(piece.span.start, piece.span.end)
                    self.error(at, message, "it is made of constants, parameters and `i`")
                    return
        for run in runs(pieces, 0, self.n - 1) if self.n > 0 else []:
            if run.piece is None:
                last = (
                    f"after frames {run.first} to {run.last}"
                    if run.first != run.last
                    else f"after frame {run.first}"
                )
                hint = "`h` at frame i is the step from i to i + 1, needed for i = 0 to n - 1"
                self.error(node, f"`h` is not defined for the step {last}", hint)
                continue
            body = run.piece.body
            if not all(isinstance(key, ConstantRef | IndexRef) for key in symbols(body)):
                continue
            values: dict[object, object] = {}
            for key in symbols(body):
                value = self.constants.values.get(key.name) if isinstance(key, ConstantRef) else None
                if isinstance(key, ConstantRef) and value is None:
                    return
                values[key] = np.arange(run.first, run.last + 1.0) if value is None else value
            steps = np.broadcast_to(evaluate(body, values), (run.last - run.first + 1,))
            wrong = np.flatnonzero(~((steps > 0) & np.isfinite(steps)))
            if len(wrong):
                at = syntax.Node(run.piece.span.start, run.piece.span.end)
                frame = run.first + int(wrong[0])
                where = (
                    ""
                    if symbols(body) and all(isinstance(k, ConstantRef) for k in symbols(body))
                    else f" at frame {frame}"
                )
                self.error(at, f"the step `h` is {float(steps[wrong[0]]):g}{where}", "it has to be positive")

    # ----------------------------------------------- constraints and objective

    def _constraints(self) -> list[Relation]:
        found: list[Relation] = []
        for block in self.tree.blocks("constraints"):
            where = self.range(block)
            for statement in block.statements:
                if not isinstance(statement, syntax.Relation):
                    continue
                self.builder.poisoned = False
                bounded = self.relations.split(statement)
                if self.builder.poisoned or where is None:
                    continue
                text = statement_text(self.source, statement)
                for part in bounded:
                    body = self.settled(part.body, where, statement)
                    found.append(Relation(body, part.lower, part.upper, where, self.span(statement), text))
                    if self.is_fixed(body):
                        message = "this constraint holds no unknown"
                        self.diagnostics.warning(
                            message, statement.start, statement.end, "it is true or false as it is"
                        )
        return found

    def _objective(self) -> list[ObjectiveTerm]:
        found: list[ObjectiveTerm] = []
        for block in self.tree.blocks("objective"):
            where = self.range(block)
            for statement in block.statements:
                if not isinstance(statement, syntax.Relation):
                    continue
                self.builder.poisoned = False
                if statement.operators:
                    hint = "relations belong under `constraints:`; an equation is penalised as `(a - b)^2`"
                    self.builder.fail(statement, "an objective is an expression, not a relation", hint)
                    for operand in statement.operands:
                        self.builder.build(operand)
                    continue
                summands = self.objective.split(statement.operands[0])
                if self.builder.poisoned or where is None:
                    continue
                text = statement_text(self.source, statement)
                for part in summands:
                    body = self.settled(part.body, where, statement)
                    found.append(ObjectiveTerm(body, part.integral, where, self.span(statement), text))
        return found

    # ------------------------------------------------------- guesses and replay

    def _guesses(self) -> list[Guess]:
        found: list[Guess] = []
        for block in self.tree.blocks("guess"):
            where = self.range(block)
            for statement in block.statements:
                if not isinstance(statement, syntax.Assignment):
                    continue
                self.builder.poisoned = False
                body = self.builder.build(statement.value)
                name = statement.name.name
                kind = self.table.kind(name)
                if kind not in ("variable", "parameter"):
                    self._no_guess_for(statement.name, kind)
                    continue
                if self.builder.poisoned or where is None:
                    continue
                for part, value in self.by_piece(body, where, statement):
                    if self._guess_is_known(statement, kind, value):
                        found.append(Guess(name, value, part, self.span(statement)))
        return found

    def _no_guess_for(self, name: syntax.Name, kind: str | None) -> None:
        word = name.name
        if word in self.tree.damaged:
            return
        if kind is None and word not in RESERVED and word not in ("n", "h"):
            unknowns = [*self.table.of_kind("variable"), *self.table.of_kind("parameter")]
            hint = did_you_mean(word, unknowns) or "declare it under `variables:` or `parameters:`"
            self.error(name, f"`{word}` is not declared", hint)
            return
        what = f"`{word}` is a {kind}" if kind else f"`{word}` is {RESERVED.get(word, 'no unknown')}"
        hint = {
            "constant": "give it its value under `constants:`",
            "definition": "guess the variables that it is made of",
        }.get(kind or "", "")
        self.error(name, f"{what}; only variables and parameters are guessed", hint)

    def _guess_is_known(self, statement: syntax.Assignment, kind: str, value: Expr) -> bool:
        for key in symbols(value):
            if kind == "parameter" and not isinstance(key, ConstantRef):
                self.error(
                    statement, f"the guess of a parameter cannot use `{key}`", "it is made of constants"
                )
                return False
            # a guess may use the starting value of a parameter, as in `x = v*i*T/n`
            if isinstance(key, VariableRef):
                self.error(statement, f"a guess cannot use `{key}`", "it is made of constants, `t` and `i`")
                return False
        return True

    def _replay(self) -> tuple[str | None, list[ReplayChannel]]:
        model: syntax.ModelFile | None = None
        channels: dict[tuple[str, ...], ReplayChannel] = {}
        for block in self.tree.blocks("replay"):
            for statement in block.statements:
                if isinstance(statement, syntax.ModelFile):
                    if model is not None and model.path != statement.path:
                        line = self.source.position(model.start)[0]
                        self.error(statement, f'the model is "{model.path}" already, on line {line}')
                    model = model or statement
                elif isinstance(statement, syntax.Channel):
                    channel = self._channel(statement)
                    if channel is None:
                        continue
                    known = channels.get((channel.kind, *channel.path))
                    if known is not None:
                        line, path = known.span.line, ".".join(channel.path)
                        message = f"`{channel.kind} {path}` stands already on line {line}"
                        self.error(statement, message, "each may be tied to one expression")
                    else:
                        channels[(channel.kind, *channel.path)] = channel
        if channels and model is None and not self.diagnostics.error_count:
            first = next(iter(channels.values())).span
            self.diagnostics.error(
                "the replay has no model", first.start, first.end, 'add `model = "file.xml";`'
            )
        return (model.path if model is not None else None), list(channels.values())

    def _channel(self, statement: syntax.Channel) -> ReplayChannel | None:
        self.builder.poisoned = False
        body = self.builder.build(statement.value)
        if statement.kind in ("compare", "set") and len(statement.path) < 2:
            shape = "body.ball.mass" if statement.kind == "set" else "body.ball.x"
            hint = f"a path has a kind, a name and a field, as in `{statement.kind} {shape} = ...;`"
            self.error(statement, f"the path of `{statement.kind}` is too short", hint)
            return None
        if self.builder.poisoned:
            return None
        if statement.kind == "set":
            for key in symbols(body):
                if not isinstance(key, ConstantRef):
                    hint = "only constants can set fields of the model"
                    self.error(statement, f"`set` cannot use `{key}`", hint)
                    return None
        where = FrameRange(0, 0) if statement.kind == "joint" else self.everywhere
        body = self.settled(body, where, statement) if statement.kind != "set" else body
        return ReplayChannel(statement.kind, statement.path, body, self.span(statement))


def _expressions(node: syntax.Node) -> list[syntax.Expression]:
    """The expressions of a statement."""
    if isinstance(node, syntax.Relation):
        return node.operands
    if isinstance(node, syntax.Assignment | syntax.Channel):
        return [node.value]
    return []


__all__ = ["ZERO", "elaborate", "elaborate_with_recovery"]
