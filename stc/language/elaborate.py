"""From a syntax tree and the constants given by the caller to a problem.

The sections are processed in the order of their dependencies, whatever their order in the file: names, constants,
method, jumps, definitions, then constraints, objective, guesses and replay lines.  A mistake is added and processing
continues; at the end all mistakes are raised together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import PurePath
from typing import TYPE_CHECKING

from stc.errors import Span, SpecError
from stc.language import checks, syntax
from stc.language.context import Context
from stc.language.definition_values import define, work_out_step
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.expressions import TIME
from stc.language.mechanics import equations_of_motion, forces_on_coordinates
from stc.language.model.stars import is_starred
from stc.language.name_table import DATA_SET
from stc.language.statements import Objective, Relations
from stc.language.words import RESERVED
from stc.problem import (
    ConstantRef,
    FrameRange,
    Guess,
    Jump,
    ObjectiveTerm,
    ParameterRef,
    Problem,
    Relation,
    ReplayChannel,
    VariableRef,
)
from stc.recorded_files import RecordedFile
from stc.symbolic.expr import Expr, evaluate, looked_up, symbols
from stc.trajectory import METHODS, require_method

if TYPE_CHECKING:
    from stc.language.model.assembly import ModelStatements

#: Kinds of replay line whose path has several parts, each with an example.
_LONG_PATHS = {
    "apply": "body.ball.fx",
    "contact": "body.ball.fz",
    "compare": "body.ball.x",
    "set": "body.ball.mass",
}


def elaborate(
    tree: syntax.SpecTree, overrides: Mapping[str, float] | None = None, method: str | None = None
) -> Problem:
    """The problem that a spec states.

    Args:
        tree: the result of :func:`stc.language.parser.parse`.
        overrides: values of constants by name; they replace the file's.
        method: ``central``, ``trapezoidal``, ``hermite-simpson`` or ``stepping``; wins over the file's.

    Raises:
        SpecError: with all semantic mistakes in the text.
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
    """As :func:`elaborate`, but mistakes are added to ``diagnostics``; None if they leave no problem."""
    return elaborator(tree, overrides, method, diagnostics).problem()


def elaborator(
    tree: syntax.SpecTree, overrides: Mapping[str, float], method: str | None, diagnostics: Diagnostics
) -> Elaborator:
    """The elaborator of a syntax tree.

    It knows the names of the spec and the values of its constants from the start, and makes the problem when asked to.
    """
    if method is not None:
        require_method(method)
    has_model = any(section.kind == "model" for section in tree.sections)
    if not has_model and any(section.kind == "contact" for section in tree.sections):
        from stc.language.contact import without_contacts

        tree = without_contacts(tree, overrides, diagnostics)
    return Elaborator(tree, overrides, method, diagnostics)


class Elaborator(Context):
    """A context that works through all sections."""

    def __init__(
        self,
        tree: syntax.SpecTree,
        overrides: Mapping[str, float],
        method: str | None,
        diagnostics: Diagnostics,
    ) -> None:
        super().__init__(tree, overrides, diagnostics)
        self.model_statements: ModelStatements | None = None
        if self.model is not None:
            from stc.language.model.assembly import ModelStatements

            self.model_statements = ModelStatements(self, self.model)
        self.method = self._method(method)
        self.relations = Relations(self.builder, self.is_fixed)
        self.objective = Objective(self.builder, self.definitions.unranged())

    def problem(self) -> Problem | None:
        jumps = self._jumps()
        self.set_motion(self.method, jumps)
        define(self, self.objective.holds_integral)
        step = work_out_step(self)
        if self.model_statements is not None:
            self.model_statements.complete()
        equations = equations_of_motion(self)
        stated = self._constraints()
        relations = [*equations, *stated]
        objective = self._objective()
        guesses = self._guesses()
        model_file, replay = self._replay()
        if self.model_statements is not None and not self.diagnostics.error_count:
            relations = [*self.model_statements.relations(forces_on_coordinates(self)), *relations]
            objective = [*objective, *self.model_statements.objective()]
            guesses = [*self.model_statements.guesses(stated), *guesses]
        if self.diagnostics.error_count:
            return None
        corrections = [] if self.model_statements is None else self.model_statements.standing.corrections()
        fixtures = [] if self.model_statements is None else self.model_statements.fixtures()
        if self.model is not None:
            from stc.language.model.numbers import Putting, given_numbers, guesses_of_numbers

            if given := given_numbers(self, self.model, replay):
                put = Putting(given)
                put.definitions(self.builder.pieces)
                relations, corrections = put.relations(relations), put.corrections(corrections)
                fixtures = put.fixtures(fixtures)
                objective = [replace(term, body=put(term.body)) for term in objective]
                replay = [replace(channel, body=put(channel.body)) for channel in replay]
                guesses = [*guesses_of_numbers(self, self.model), *guesses]
        if self.model_statements is not None and not self.diagnostics.error_count:
            self.model_statements.warn_of_poses(relations)
        if self.diagnostics.error_count:
            return None
        problem = Problem(
            name=PurePath(self.source.name).stem.strip("<>") or "spec",
            source=self.source,
            constants={name: value for name, value in self.constants.values.items() if value is not None},
            structural=frozenset(
                self.positions.structural
                | self.constants.made_from("n")
                | self._shaping()
                | (set() if self.data is None else self.data.structural)
                | self._placing(step, objective)
            ),
            n=self.n,
            method=self.method,
            variables=[
                *self.table.of_kind("variable"),
                # A contact that stands twice has one unknown for both.
                *dict.fromkeys(name for correction in corrections for name in correction.unknowns),
            ],
            parameters=[*self.table.of_kind("parameter"), *self._impulses()],
            step=step,
            step_span=self._step_span(),
            definitions=self.builder.pieces,
            relations=relations,
            objective=objective,
            guesses=guesses,
            jumps=jumps,
            model=None if model_file is None else model_file.path,
            model_span=None if model_file is None else self.span(model_file),
            replay=replay,
            macros=self.builder.macros,
            rotations=[] if self.model is None else self.model.rotations,
            of_model=self.model is not None,
            additions=[] if self.model is None else [word.name for word in self.model.statement.additions],
            left_out=[] if self.model is None else [word.name for word in self.model.statement.without],
            relaxation="" if self.model_statements is None else self.model_statements.relaxation(),
            free_contacts=[] if self.model_statements is None else self.model_statements.free_contacts,
            at_nodes=[] if self.builder.paths is None else self.builder.paths.distances.unknowns(),
            fixtures=fixtures,
            root=frozenset() if self.model_statements is None else self.model_statements.root(),
            corrections=corrections,
            data={} if self.data is None else self.data.sets,
            tables={} if self.data is None else self.data.tables,
            named=self.positions.named,
            model_files=self._model_files(model_file),
        )
        checks.warn(problem, self.table, self.builder.first_use, self.diagnostics)
        problem.warnings = self.diagnostics.warnings()
        return problem

    def _model_files(self, replayed: syntax.ModelFile | None) -> Sequence[RecordedFile]:
        """The files of the spec's model, unless the replay has another one."""
        own = self.model is not None and replayed is not None and replayed.path == self.model.statement.path
        return self.model.files if self.model is not None and own else []

    def _shaping(self) -> set[str]:
        """Numbers of the model that are not inputs of the compiled program."""
        return set() if self.model is None else self.model.structural

    def _impulses(self) -> list[str]:
        """Parameters that the model's contacts add."""
        return [] if self.model_statements is None else self.model_statements.impulses()

    def _step_span(self) -> Span | None:
        """The place of the step's definition in the spec."""
        entry = self.table.entries.get("h")
        return None if entry is None else Span(self.source, entry.start, entry.end)

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
        if self.model_statements is not None and self.model_statements.contacts.free():
            return "stepping"  # what is written or given is for the motion with a schedule
        default = "central" if self.model is None else "hermite-simpson"
        return given or (chosen.name if chosen is not None else default)

    def _jumps(self) -> list[Jump]:
        found: dict[tuple[int, str, int], Jump] = {}
        told = False
        for block in self.tree.blocks("jumps"):
            where = self.range(block)
            for statement in block.statements:
                if not isinstance(statement, syntax.JumpList):
                    continue
                if block.header is None:
                    hint = "put the frame into a range header before it, as in `[20]: tau;`"
                    self.error(statement, "a jump needs a frame", hint)
                elif self.method == "central" and not told:
                    told = True
                    hint = "choose `method: trapezoidal;` or `method: hermite-simpson;`"
                    self.error(block.header, "the method `central` does not support jumps", hint)
                for quantity in statement.quantities:
                    named = self._jump_quantity(quantity)
                    if named is None or where is None or block.header is None:
                        continue
                    for frame in range(where.first, where.last + 1):
                        found.setdefault((frame, *named), Jump(frame, *named, self.span(quantity)))
        if self.model_statements is not None:
            jumping = self.model_statements.jumps()
            if jumping and self.method == "central" and not told:
                span = jumping[0].span
                hint = "choose `method: trapezoidal;` or leave the line out for hermite-simpson"
                message = "contact begins or ends within the motion, and the method `central` does not support jumps"
                self.diagnostics.error(message, span.start, span.end, hint)
            for jump in jumping:
                found.setdefault((jump.frame, jump.name, jump.order), jump)
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

    # ----------------------------------------------- constraints and objective

    def _constraints(self) -> list[Relation]:
        found: list[Relation] = []
        if self.model is not None:
            self._warn_of_frames()
        for _, where, pose in self.statements("constraints", syntax.Pose):
            if self._has_model(pose) and where is not None:
                assert self.model_statements is not None
                found += self.model_statements.pose(pose, where)
        came: list[int] = []  # how many relations each statement has come to
        for _, where, statement in self.statements("constraints", syntax.Relation):
            bounded = self.relations.split(statement)
            if self.builder.poisoned or where is None:
                continue
            before = len(found)
            text = statement.written or syntax.statement_text(self.source, statement)
            for part in bounded:
                body = self.settled(part.body, where, statement)
                if any(
                    self._reads_gaps(e, where, statement)
                    for e in (body, part.lower, part.upper)
                    if e is not None
                ):
                    continue
                one = Relation(
                    body,
                    part.lower,
                    part.upper,
                    where,
                    self.span(statement),
                    text,
                    complementary=statement.complementary,
                )
                found += (
                    [one]
                    if self.builder.paths is None
                    else self.builder.paths.distances.exact(one, self._structural)
                )
                if self.is_fixed(body):
                    message = "this constraint contains no unknown"
                    self.diagnostics.warning(
                        message,
                        statement.start,
                        statement.end,
                        "it is true or false whatever the solution is",
                    )
            came.append(len(found) - before)
            if statement.complementary and came[-3:] != [1, 1, 1]:  # as of distances, which take several rows
                found[before:] = [replace(one, complementary=False) for one in found[before:]]
        if self.builder.paths is not None:
            self.builder.paths.distances.declare(self.table)
        return found

    def _warn_of_frames(self) -> None:
        """Warn of limits of all joints or actuators that hold at a single frame only, beside a pose."""
        for block in self.tree.blocks("constraints"):
            where = None if block.header is None else self.range(block)
            if block.header is None or where is None or where.first != where.last:
                continue
            if not any(isinstance(statement, syntax.Pose) for statement in block.statements):
                continue
            line = self.source.position(block.header.start)[0]
            for statement in block.statements:
                limits = isinstance(statement, syntax.Relation) and "<=" in {
                    operator.replace(">", "<") for operator in statement.operators
                }
                if limits and is_starred(statement) and self.source.position(statement.start)[0] > line:
                    message = f"this holds on frame {where.first} alone, with the pose of line {line}"
                    hint = (
                        "write `[0, n]:` before it if all frames are meant; `[k]: ...` on its own line if not"
                    )
                    self.diagnostics.warning(message, statement.start, statement.end, hint)

    def _structural(self, e: Expr) -> float | None:
        """The value of an expression of constants alone; None for other expressions.

        These constants become structural: another value of one of them needs another transcription.
        """
        values: dict[object, float] = {}
        for key in symbols(e):
            value = self.positions.structural_value(key.name) if isinstance(key, ConstantRef) else None
            if value is None:
                return None
            values[key] = value
        return float(evaluate(e, values))

    def _has_model(self, pose: syntax.Pose) -> bool:
        """Whether poses have a meaning; otherwise a mistake is added."""
        if self.model_statements is None and not any(self.tree.blocks("model")):
            hint = 'poses are those of a model: name it, as in `model: "robot.xml";`'
            self.error(pose, f"`{pose.base.name}` is not declared", hint)
        return self.model_statements is not None

    def _counted(self, integrand: Expr, node: syntax.Node) -> Expr:
        """An integrand that counts only where the recordings that it reads have numbers."""
        if self.data is None:
            return integrand
        from stc.language.recorded import counted_where_known, references

        for ref in references(integrand, self.builder.pieces):
            if not self.data.weight_of(ref)[0].table.coefficients.any():
                name = ref.name.partition(".")[0]
                hint = f"sum over its rows instead, as in `[{name}]: (x - {ref.name})^2;`, or give it a file of its own"
                self.error(
                    node, f"`{ref.name}` has no two consecutive numbers, which an integral needs", hint
                )
        return counted_where_known(integrand, self.data, self.builder.pieces)

    def _reads_gaps(self, body: Expr, where: FrameRange, node: syntax.Node) -> bool:
        """Whether a statement reads a recording in one of its gaps, which is a mistake."""
        if self.data is None:
            return False
        from stc.language.recorded import first_gap, references

        if not any(self.data.weight_of(ref)[1] for ref in references(body, self.builder.pieces)):
            return False
        step, midpoints = self._structural(self.builder.step), self.method == "hermite-simpson"
        found = first_gap(body, self.data, self.builder.pieces, where, step, midpoints)
        if found is None:
            return False
        ref, time = found
        hint = "a term of an `integral` in the objective counts only where there are numbers"
        message = f"`{ref.name}` has gaps, and this statement needs a number at every frame"
        if time is not None:
            message = f"`{ref.name}` has a gap at t = {time:.6g} s, where this statement needs a number"
        self.error(node, message, hint)
        return True

    def _objective(self) -> list[ObjectiveTerm]:
        found: list[ObjectiveTerm] = []
        for block, where, statement in self.statements("objective", syntax.Relation):
            if statement.operators:
                hint = "relations belong under `constraints:`; an equation is penalised as `(a - b)^2`"
                self.builder.fail(statement, "an objective is an expression, not a relation", hint)
                for operand in statement.operands:
                    self.builder.build(operand)
                continue
            summands = self.objective.split(statement.operands[0])
            if self.builder.poisoned or where is None:
                continue
            text = syntax.statement_text(self.source, statement)
            for part in summands:
                body = self.settled(part.body, where, statement)
                rows = self.rows(block)
                if rows and not self._stands_on_rows(body, part.integral, rows, statement):
                    continue
                if part.integral:
                    body = self._counted(body, statement)
                elif self._reads_gaps(body, where, statement):
                    continue
                found.append(ObjectiveTerm(body, part.integral, where, self.span(statement), text, rows))
        return found

    def _stands_on_rows(self, body: Expr, integral: bool, rows: str, node: syntax.Node) -> bool:
        """Whether a term has a value on each row of a data set; mistakes are added."""
        from stc.language.measurements import stands_on_rows

        return stands_on_rows(self, body, integral, rows, node)

    def _placing(self, step: Expr, objective: Sequence[ObjectiveTerm]) -> frozenset[str]:
        """The constants that determine the positions of data rows among the frames."""
        if not any(term.rows for term in objective):
            return frozenset()
        from stc.language.measurements import placing_rows

        return placing_rows(self, step)

    # ------------------------------------------------------- guesses and replay

    def _guesses(self) -> list[Guess]:
        found: list[Guess] = []
        for _, where, pose in self.statements("guess", syntax.Pose):
            if self._has_model(pose) and where is not None:
                assert self.model_statements is not None
                found += self.model_statements.guess(pose, where)
        for _, where, guess in self.statements("guess", syntax.GuessFrom):
            found += self._guesses_from(guess, where)
        for _, where, statement in self.statements("guess", syntax.Assignment):
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

    def _guesses_from(self, guess: syntax.GuessFrom, where: FrameRange | None) -> list[Guess]:
        """The guesses that a data set gives: for every variable that has a column of its name."""
        name = guess.name.name
        if self.table.kind(name) != DATA_SET:
            if name not in self.tree.damaged:
                known = self.table.of_kind(DATA_SET)
                what = (
                    f"`{name}` is a {self.table.kind(name)}"
                    if self.table.kind(name)
                    else f"`{name}` is not declared"
                )
                hint = did_you_mean(name, known) or f"write `{name} = ...;` for a value"
                self.error(guess, what if known else f"expected `=` after `{name}`", hint)
            return []
        if where is None or self.data is None:
            return []
        columns = self.data.guessed(guess, self.table.of_kind("variable"))
        return [Guess(each, looked_up(ref, TIME), where, self.span(guess)) for each, ref in columns]

    def _no_guess_for(self, name: syntax.Name, kind: str | None) -> None:
        word = name.name
        if word in self.tree.damaged or ("." in word and self.builder.model_is_missing):
            return
        if kind is None and "." in word and self.model is not None:
            hint = did_you_mean(word, self.table.of_kind("variable"))
            hint = hint or "coordinates and controls are guessed, or a pose: `[20]: keyframe.stand;`"
            self.error(name, f"`{word}` is no coordinate or control of the model", hint)
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

    def _replay(self) -> tuple[syntax.ModelFile | None, list[ReplayChannel]]:
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
        if self.model_statements is not None and self.model is not None:
            for channel in self.model_statements.replay() if not self.diagnostics.error_count else ():
                channels.setdefault((channel.kind, *channel.path), channel)
            model = model or self.model.statement
        if channels and model is None and not self.diagnostics.error_count:
            first = next(iter(channels.values())).span
            self.diagnostics.error(
                "the replay has no model", first.start, first.end, 'add `model = "file.xml";`'
            )
        return model, list(channels.values())

    def _channel(self, statement: syntax.Channel) -> ReplayChannel | None:
        self.builder.poisoned = False
        body = self.builder.build(statement.value)
        shape = _LONG_PATHS.get(statement.kind)
        if shape is not None and len(statement.path) < 2:
            hint = f"a path has a kind, a name and a field, as in `{statement.kind} {shape} = ...;`"
            self.error(statement, f"the path of `{statement.kind}` is too short", hint)
            return None
        if self.builder.poisoned:
            return None
        if statement.kind == "set":
            for key in symbols(body):
                if not isinstance(key, ConstantRef | ParameterRef):
                    hint = "fields of the model are set from constants and parameters"
                    self.error(statement, f"`set` cannot use `{key}`", hint)
                    return None
        elif statement.kind in ("joint", "compare") and self.builder.holds_index(body):
            hint = "write it in terms of the time `t`: its velocity is compared too"
            self.error(statement, f"`{statement.kind}` cannot use the index `i`", hint)
            return None
        body = self.settled(body, self.everywhere, statement)
        return ReplayChannel(statement.kind, statement.path, body, self.span(statement))
