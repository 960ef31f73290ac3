"""Frames from syntax: the frames of a range header, and the frame of an index."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction

from stc.errors import Span
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.name_table import NameTable
from stc.language.names import dependency_order
from stc.language.numbers import NOISE, NotANumber, Resolve, Unknown, affine, exact
from stc.language.words import FRAMES_MEANT
from stc.problem import FrameRange, NamedFrame

Position = tuple[Fraction | int, Fraction | int]


class Positions:
    """Evaluates headers and indices, and records the constants in them (``structural``).

    ``formulas`` are the definitions without a range header: those of constants alone may stand in a range
    too.
    """

    def __init__(
        self,
        table: NameTable,
        constants: Constants,
        formulas: Mapping[str, syntax.Expression],
        diagnostics: Diagnostics,
    ) -> None:
        self.table = table
        self.constants = constants
        self.formulas = formulas
        self.diagnostics = diagnostics
        self.structural: set[str] = set()
        self._values: dict[bool, dict[str, tuple[float, float] | NotANumber | Unknown]] = {
            True: {},
            False: {},
        }
        self._headers: dict[int, FrameRange | None] = {}
        self._named: dict[int, list[NamedFrame]] = {}

    @property
    def named(self) -> list[NamedFrame]:
        """The frames named by headers and indices so far, in the order of the text."""
        return sorted((one for some in self._named.values() for one in some), key=lambda one: one.span.start)

    def structural_value(self, name: str) -> float | None:
        """The value of a structural constant."""
        self.structural |= self.constants.made_from(name)
        return self.constants.values.get(name)

    def _resolver(self, what: str, indexed: bool) -> Callable[[syntax.Name], tuple[float, float]]:
        def resolve(node: syntax.Name) -> tuple[float, float]:
            name = node.name
            kind = self.table.kind(name)
            if kind is not None:
                self.table.entries[name].used = True
            if kind == "constant" or (name in ("n", "h") and name in self.constants.values):
                value = self.structural_value(name)
                if value is None:
                    raise Unknown
                return 0.0, value
            if name == "pi":
                return 0.0, math.pi
            if name == "h" and kind is None:
                return 0.0, 1.0
            if name == "i" and indexed:
                return 1.0, 0.0
            if kind == "definition" and name in self.formulas:
                made = self._value_of_definition(name, indexed, resolve)
                if isinstance(made, NotANumber):
                    hint = f"{what} is made of constants{' and `i`' if indexed else ''}"
                    root = made.__cause__ if isinstance(made.__cause__, NotANumber) else made
                    message = f"`{name}` is not a number before solving: {root.message}"
                    raise NotANumber(node, message, hint) from root
                if isinstance(made, Unknown):
                    raise made
                return made
            if kind is not None or name in ("i", "t", "inf"):
                shown = f"the {kind} `{name}`" if kind else f"`{name}`"
                raise NotANumber(
                    node, f"{what} cannot use {shown}", "it is made of constants" + indexed * " and `i`"
                )
            if name == "n" and self.constants.n is None:
                raise Unknown  # noted once for the whole file
            meant = "`[n]` is the last frame" if name == "N" else FRAMES_MEANT.get(name.lower(), "")
            raise self.constants.undeclared(node, meant)

        return resolve

    def _value_of_definition(
        self, name: str, indexed: bool, resolve: Resolve
    ) -> tuple[float, float] | NotANumber | Unknown:
        """The value of a definition, or the reason why it has none; each is evaluated once."""
        known = self._values[indexed]
        if name not in known:

            def needs(other: str) -> list[str]:
                inside = syntax.names(self.formulas[other])
                return [each for each in inside if each in self.formulas and each not in known]

            for each in dependency_order([name], needs)[0]:
                try:
                    known[each] = affine(self.formulas[each], resolve)
                except (NotANumber, Unknown) as problem:
                    known[each] = problem
        return known[name]

    def frames(self, header: syntax.RangeHeader) -> FrameRange | None:
        """The frames of a header, or None after adding a mistake."""
        if id(header) not in self._headers:
            self._headers[id(header)] = self._frames(header)
        return self._headers[id(header)]

    def _frames(self, header: syntax.RangeHeader) -> FrameRange | None:
        resolve = self._resolver("a range", False)
        ends: list[float] = []
        for node in (header.first, header.last):
            if node is None:
                continue
            try:
                ends.append(affine(node, resolve)[1])
            except NotANumber as problem:
                self.diagnostics.error(problem.message, problem.node.start, problem.node.end, problem.hint)
            except Unknown:
                pass
        n = self.constants.n
        if n is None or len(ends) < 1 + (header.last is not None):
            return None
        low, high = ends[0], ends[-1]
        if math.isinf(low) or math.isinf(high):
            self.diagnostics.error("a range has to be finite", header.start, header.end)
            return None
        first, last = math.ceil(low - NOISE), math.floor(high + NOISE)
        shown = f"{low:.12g}" if header.last is None else f"[{low:.12g}, {high:.12g}]"
        if first > last:
            if header.last is None:
                message, hint = f"frame {shown} is not a whole number", "a range `[k]:` stands for one frame"
                hint = self._not_whole(header.first) or hint
            else:
                message, hint = f"the range {shown} holds no whole number", "a range is `[first, last]:`"
                if low > high:
                    # Too small a number of frames makes ends cross that were rounded from shares of it.
                    broken = [node for node, end in ((header.first, low), (header.last, high)) if end % 1.0]
                    hint = (self._not_whole(broken[0]) if broken else "") or "its ends seem to be swapped"
            self.diagnostics.error(message, header.start, header.end, hint)
            return None
        if first < 0 or last > n:
            what = f"frame {shown} is" if header.last is None else f"the range {shown} reaches"
            self.diagnostics.error(
                f"{what} outside the motion", header.start, header.end, f"its frames are 0 to {n}"
            )
            return None
        span = Span(self.diagnostics.source, header.start, header.end)
        self._named[id(header)] = [NamedFrame(first, span), NamedFrame(last, span)]
        return FrameRange(first, last, span)

    def _not_whole(self, node: syntax.Expression) -> str:
        """The hint for a position that is not a whole number for the values of its constants; else empty."""
        values = {name: self.constants.values.get(name) for name in syntax.names(node)}
        known = [f"{name} = {value:.12g}" for name, value in values.items() if value is not None]
        if not known:
            return ""
        text = self.diagnostics.source.text[node.start : node.end]
        return f"`{text}` is not a whole number for {', '.join(known)}"

    def index(self, node: syntax.Expression) -> Position | None:
        """``(scale, shift)`` of an index ``scale*i + shift``, or None after adding a mistake."""
        try:
            a, b = affine(node, self._resolver("an index", True))
        except NotANumber as problem:
            self.diagnostics.error(problem.message, problem.node.start, problem.node.end, problem.hint)
            return None
        except Unknown:
            return None
        scale, shift = exact(a), exact(b)
        if scale is None or shift is None or (scale.denominator == 1 and shift.denominator != 1):
            shown = f"{b:.12g}" if a == 0 else f"{a:.12g}*i + {b:.12g}"
            hint = self._not_whole(node) or "an index has to be the number of a frame"
            self.diagnostics.error(f"the index {shown} is never a whole number", node.start, node.end, hint)
            return None
        n = self.constants.n
        if n is None:
            return None
        if scale == 0 and not 0 <= shift <= n:
            hint = f"its frames are 0 to {n}"
            self.diagnostics.error(f"frame {shift} is outside the motion", node.start, node.end, hint)
            return None
        if scale == 0:
            span = Span(self.diagnostics.source, node.start, node.end)
            self._named[id(node)] = [NamedFrame(int(shift), span)]
        return scale, shift
