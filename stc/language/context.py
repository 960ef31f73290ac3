"""The shared state of elaboration: tables, frames, and mistakes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from stc.errors import Span
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.definitions import Definitions, collect_definitions, runs
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.expressions import ExpressionBuilder
from stc.language.frames import Frames
from stc.language.kinks import advice, kinks_in
from stc.language.model.stars import each_of
from stc.language.name_table import DATA_SET
from stc.language.names import collect_names
from stc.language.positions import Positions
from stc.language.smoothing import smoothed
from stc.language.words import FRAMES_MEANT, RESERVED
from stc.problem import ConstantRef, DefinitionRef, FrameRange, IndexRef, Jump, TimeRef
from stc.symbolic.expr import Expr, evaluate, substitute, symbols

if TYPE_CHECKING:
    from stc.language.data import Data

S = TypeVar("S", bound=syntax.Node)


class Context:
    """The state of one spec during elaboration.

    ``n`` is 0 if a mistake left the number of frames unknown.  ``time_is_fixed`` says whether ``t`` is known before
    solving: false if a step depends on a parameter.  ``method`` is empty until it is known.
    """

    def __init__(
        self, tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics
    ) -> None:
        self.tree = tree
        self.source = tree.source
        self.diagnostics = diagnostics
        self.table = collect_names(tree, diagnostics, overrides)
        self.constants = Constants(self.table, overrides, diagnostics, tree.damaged)
        self.definitions: Definitions = collect_definitions(tree, self.table, diagnostics)
        self.positions = Positions(self.table, self.constants, self.definitions.unranged(), diagnostics)
        self.builder = ExpressionBuilder(self.table, self.constants, self.positions, diagnostics)
        self.data = self.builder.data = self._data()
        self.model = self.table.model
        if self.model is not None:
            self.builder.use_model(self.model)
        else:
            self.builder.model_is_missing = any(tree.blocks("model"))
        self.builder.model_hint = _model_hint(tree)
        self.n = self.constants.n if self.constants.n is not None else 0
        self.everywhere = FrameRange(0, self.n)
        self.time_is_fixed = True
        self.method = ""
        self.section = ""  # whose statements are read
        self.frames = Frames(self.n, False, self.builder.pieces, ())
        self._fixed: dict[Expr, bool] = {}
        self._strays: set[str] = set()

    def _data(self) -> Data | None:
        """The declarations of `data:`; None if the spec has no such section."""
        if not any(section.kind == "data" for section in self.tree.sections):
            return None
        from stc.language.data import Data

        return Data(self.tree, self.table, self.constants, self.diagnostics)

    def set_motion(self, method: str, jumps: Sequence[Jump]) -> None:
        """Set the method and the jumps, which determine the frames on which a statement can hold."""
        self.method = method
        self.frames = Frames(self.n, method == "central", self.builder.pieces, jumps)

    def span(self, node: syntax.Node) -> Span:
        return Span(self.source, node.start, node.end)

    def error(self, node: syntax.Node, message: str, hint: str = "") -> None:
        self.diagnostics.error(message, node.start, node.end, hint)

    def range(self, block: syntax.Block, *, rows: bool = False) -> FrameRange | None:
        """The frames of a block; None after a mistake in its header.

        Args:
            rows: whether it may name a data set, over whose rows its statements are summed: then it is frame 0 alone.
        """
        if block.header is None:
            return self.everywhere
        data = self.rows(block)
        if not data:
            first = block.header.first
            if rows and block.header.last is None and isinstance(first, syntax.Name):
                if self._means_data(first.name):
                    self._undeclared_data(first)
                    return None
            return self.positions.frames(block.header)
        if not rows:
            hint = f"under `objective:` a term is summed over them, as in `[{data}]: (x - {data}.x)^2;`"
            self.error(
                block.header, f"`{data}` is a data set: only the objective is a sum over its rows", hint
            )
            return None
        return FrameRange(0, 0, self.span(block.header))

    def _undeclared_data(self, node: syntax.Name) -> None:
        name = node.name
        hint = did_you_mean(name, [*self.table.of_kind(DATA_SET), *self.table.of_kind("constant")])
        hint = hint or (
            f'a data set is declared under `data:`, as in `{name} = "{name}.csv";`; a frame is a number'
        )
        self.error(node, f"`{name}` is not declared", hint)

    def _means_data(self, name: str) -> bool:
        """Whether an undeclared word can be the name of a data set."""
        known = (*RESERVED, "n", "h", "N", "?", *self.tree.damaged)
        return self.table.kind(name) is None and name not in known and name.lower() not in FRAMES_MEANT

    def rows(self, block: syntax.Block) -> str:
        """The data set over whose rows the statements of a block are summed; empty if they hold on frames."""
        header = block.header
        if header is None or header.last is not None or not isinstance(header.first, syntax.Name):
            return ""
        name = header.first.name
        return name if self.table.kind(name) == DATA_SET else ""

    def statements(self, section: str, kind: type[S]) -> Iterator[tuple[syntax.Block, FrameRange | None, S]]:
        """Each statement of one kind in a section, with its block and the block's frames; before each one, the
        builder's state after mistakes is reset.
        """
        self.section = section
        for block in self.tree.blocks(section):
            where = self.range(block, rows=section == "objective")
            self.builder.rows = self.rows(block)
            for found in block.statements:
                for statement in self._each(found):
                    if isinstance(statement, kind):
                        self.builder.poisoned = False
                        yield block, where, statement
        self.builder.rows = ""

    def _each(self, statement: syntax.Statement) -> Iterator[syntax.Statement]:
        """The statement itself; or for a statement with `joint.*`, a statement for each joint."""
        if self.model is None or not isinstance(statement, syntax.Relation | syntax.Assignment):
            yield statement
            return
        yield from each_of(statement, self.model)

    def number(self, e: Expr) -> float:
        """The value of an expression of constants."""
        return float(evaluate(e, {key: self.constants.values.get(key.name) for key in symbols(e)}))

    def is_fixed(self, e: Expr) -> bool:
        """Whether an expression consists of constants, ``i`` and a ``t`` that no unknown changes."""
        found = self._fixed.get(e)
        if found is None:
            known = (ConstantRef, IndexRef, TimeRef) if self.time_is_fixed else (ConstantRef, IndexRef)
            found = self._fixed[e] = all(isinstance(key, known) for key in symbols(e))
        return found

    def settled(self, e: Expr, where: FrameRange, node: syntax.Node) -> Expr:
        """``e`` without unnecessary ``before`` and ``after``; its definitions are checked to hold on its frames."""
        gap = self.frames.gap(e, where.first, where.last)
        if gap is not None and not self.tell_of_stray(gap.name, f"line {self._line(node)} uses it on {gap}"):
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
        return self.smooth(plain, where, node)

    def smooth(self, e: Expr, where: FrameRange, node: syntax.Node) -> Expr:
        """``e`` with roots replaced by differentiable ones where possible; remaining kinks are mistakes."""
        found = smoothed(e)
        for kink in kinks_in(self.builder, found) if not isinstance(node, syntax.Channel) else ():
            header = "[0, n]:" if where.span is None else where.span.text
            self.error(kink, *advice(self.builder, kink, node, self.section, header))
        return found

    def _line(self, node: syntax.Node) -> int:
        return self.source.position(node.start)[0]

    def tell_of_stray(self, name: str, use: str) -> bool:
        """Add a hint, once, that a definition holds on some frames only because it follows others under a range header.

        Args:
            use: its use on other frames, as in "line 8 uses it on frame 0".

        Returns:
            Whether that is the case: its only value follows one of several values of another name.
        """
        formulas = self.definitions.formulas
        if len(formulas.get(name, ())) != 1 or name not in self.builder.pieces:
            return False
        for block in self.tree.blocks("definitions"):
            follows = False
            for statement in block.statements:
                if not isinstance(statement, syntax.Assignment):
                    continue
                follows = follows or len(formulas.get(statement.name.name, ())) > 1
                if statement.name.name == name and follows:
                    if name in self._strays:
                        return True
                    self._strays.add(name)
                    where = self.builder.pieces[name][0].range
                    message = f"`{name}` is defined on {where} only, since it stands under that range header"
                    hint = "what holds everywhere goes before the first header, or into a section of its own"
                    hint = f"{use}; {hint}"
                    self.error(statement.name, message, hint)
                    return True
        return False

    def by_piece(self, e: Expr, where: FrameRange, node: syntax.Node) -> list[tuple[FrameRange, Expr]]:
        """``e`` with ranged definitions expanded, for each part of the range on which it is one formula."""
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


def _model_hint(tree: syntax.SpecTree) -> str:
    """The hint for the word `model` in an expression."""
    files = [
        statement.path
        for section in ("model", "replay")
        for block in tree.blocks(section)
        for statement in block.statements
        if isinstance(statement, syntax.ModelFile)
    ]
    path = files[0] if files else "robot.xml"
    listed = f"`stc show {path}` lists what it has"
    if any(tree.blocks("model")):
        return f"a model is not a number; its joints are `joint.NAME`, its motors `actuator.NAME`: {listed}"
    instead = "in place of `lagrangian:`" if any(tree.blocks("lagrangian")) else "as a section of its own"
    hint = (
        f'write `model: "{path}";` {instead}: it brings the coordinates, as `joint.NAME`, the motors and the '
        f"equations of motion; {listed}"
    )
    names = [
        statement.name.name
        for block in tree.blocks("variables")
        for statement in block.statements
        if isinstance(statement, syntax.Declaration)
    ]
    if names:
        some = ", ".join(f"`{name}`" for name in names[:3]) + (", ..." if len(names) > 3 else "")
        hint += f"\nvariables that stand for its coordinates ({some}) are then not declared"
    return hint


def _expressions(node: syntax.Node) -> list[syntax.Expression]:
    """The expressions of a statement."""
    if isinstance(node, syntax.Relation):
        return node.operands
    if isinstance(node, syntax.Assignment | syntax.Channel):
        return [node.value]
    return []
