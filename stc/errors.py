"""Every exception that the project raises on purpose, and the places in a text that they point at.

A :class:`Source` is the text of one spec, a :class:`Span` a piece of it, a :class:`Diagnostic` one mistake or
warning about a span.  ``str`` of any exception here is the full message as a user should see it:

    hop.stc:14:13: error: `fxx` is not declared
       14 |     m*x'' - fxx;
          |             ^^^
          did you mean `fx`?
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping

from stc.records import dataclass, field
from stc.terminal_text import visible

#: Lines longer than this are shown as a window around the place that is meant.
EXCERPT_WIDTH = 110


@dataclass(eq=False, slots=True)
class Origins:
    """The characters of the original spec for every character of a text whose repetitions have been written out.

    ``counts`` are the constants that determine the repetitions, with their values.
    """

    written: Source
    counts: dict[str, int] = field(default_factory=dict)
    _begins: list[int] = field(default_factory=list, repr=False)
    _pieces: list[tuple[int, int, int, str]] = field(default_factory=list, repr=False)

    def add(self, at: int, length: int, start: int, end: int, values: str) -> None:
        """Map ``length`` characters from ``at`` on to those from ``start`` to ``end`` of the original spec.

        Where they are as many, each stands for one; else all for all.  ``values`` are the values of the repetition's
        indices.
        """
        self._begins.append(at)
        self._pieces.append((length, start, end, values))

    def place(self, start: int, end: int) -> tuple[int, int]:
        """The characters of the spec that those from ``start`` to ``end`` stand for."""
        begin = self._corner(start, 0)
        return begin, max(begin, self._corner(max(start, end - 1), 1))

    def _corner(self, offset: int, after: int) -> int:
        """The offset in the spec at which the character at ``offset`` begins, or ends with ``after`` = 1."""
        piece = max(0, bisect_right(self._begins, offset) - 1)
        length, start, end, _ = self._pieces[piece]
        if length != end - start:
            return end if after else start
        return min(start + offset - self._begins[piece] + after, end)

    def first(self, offset: int) -> int | None:
        """The first character of the written-out text that comes from the one at ``offset`` of the spec, or None."""
        for begin, (length, start, end, _) in zip(self._begins, self._pieces):
            if start <= offset < end:
                return begin + (offset - start if length == end - start else 0)
        return None

    def values(self, offset: int) -> str:
        """The values of the repetition's indices there, such as ``k = 3``; empty outside repetitions."""
        return self._pieces[max(0, bisect_right(self._begins, offset) - 1)][3]


@dataclass(eq=False, slots=True)
class Source:
    """The text of one spec, and its name in messages (a path, or ``<text>``).

    ``model_file`` is the file of the model that the text names, if it is known already.
    ``origins`` maps a text whose repetitions have been written out to the original text; lines and columns are those
    of the original.
    ``carried`` holds the data files of a solution, by the paths in its text; None if they are on disk beside the spec.
    """

    name: str
    text: str
    path: str | None = None
    model_file: str | None = None
    carried: Mapping[str, bytes] | None = None
    origins: Origins | None = field(default=None, repr=False)
    _line_starts: list[int] | None = field(default=None, repr=False)

    @property
    def written(self) -> str:
        """The text of the spec as it was written."""
        return self.text if self.origins is None else self.origins.written.text

    def place(self, start: int, end: int) -> tuple[int, int]:
        """The characters of the source text from which ``start`` to ``end`` were generated."""
        return (start, end) if self.origins is None else self.origins.place(start, end)

    def repeats(self, name: str, offset: int) -> bool:
        """Whether the text there is repeated for each value of ``name``."""
        values = "" if self.origins is None else self.origins.values(offset)
        return f", {name} = " in f", {values}"

    def line_starts(self) -> list[int]:
        """Offsets of the first character of every line that was written."""
        if self._line_starts is None:
            starts = [0]
            find = self.written.find
            at = find("\n")
            while at >= 0:
                starts.append(at + 1)
                at = find("\n", at + 1)
            self._line_starts = starts
        return self._line_starts

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of a character, both counted from 1."""
        starts = self.line_starts()
        offset = self.place(offset, offset + 1)[0]
        line = bisect_right(starts, offset) - 1
        return line + 1, offset - starts[line] + 1

    def line(self, number: int) -> str:
        """The text of a line (counted from 1) without its line end."""
        starts = self.line_starts()
        start = starts[number - 1]
        written = self.written
        end = starts[number] - 1 if number < len(starts) else len(written)
        return written[start:end].rstrip("\r")


@dataclass(frozen=True, slots=True)
class Span:
    """The characters ``start`` to ``end`` (excluded) of a source."""

    source: Source
    start: int
    end: int

    @property
    def line(self) -> int:
        """Line of the first character, counted from 1."""
        return self.source.position(self.start)[0]

    @property
    def column(self) -> int:
        """Column of the first character, counted from 1."""
        return self.source.position(self.start)[1]

    @property
    def text(self) -> str:
        """The text, with repetitions written out."""
        return self.source.text[self.start : self.end]

    @property
    def repeated(self) -> str:
        """The value of the repetition from which this place comes, such as ``k = 3``; empty without a repetition."""
        return "" if self.source.origins is None else self.source.origins.values(self.start)

    @property
    def location(self) -> str:
        """``name:line:column``."""
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    def excerpt(self) -> str:
        """The line of the span, numbered, with a row of carets below it."""
        number, column = self.source.position(self.start)
        line = self.source.line(number)
        start, end = self.source.place(self.start, self.end)
        width = max(1, min(end - start, len(line) - column + 1))
        # A piece of a long line is enough: nothing is measured that is not shown.
        before = _shown(line[max(0, column - 1 - EXCERPT_WIDTH) : column - 1])
        marked = _shown(line[column - 1 : column - 1 + min(width, EXCERPT_WIDTH)])
        after = _shown(line[column - 1 + width : column - 1 + width + EXCERPT_WIDTH])
        if len(before) + len(marked) + len(after) > EXCERPT_WIDTH:
            room = max(20, (EXCERPT_WIDTH - len(marked)) // 2)
            if len(before) > room:
                before = "..." + before[len(before) - room + 3 :]
            if len(marked) > EXCERPT_WIDTH - 40:
                marked, after = marked[: EXCERPT_WIDTH - 43] + "...", ""
            if len(after) > room:
                after = after[: room - 3] + "..."
        gutter = f"{number:5d} | "
        blank = " " * 6 + "| "
        return (
            f"{gutter}{before}{marked}{after}".rstrip()
            + f"\n{blank}{' ' * len(before)}{'^' * max(1, len(marked))}"
        )


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One mistake or warning: its message, its place in the text, and a hint.

    ``severity`` is ``"error"`` or ``"warning"``; ``span`` is None if the mistake has no place in the text.
    """

    severity: str
    message: str
    span: Span | None = None
    hint: str = ""

    def render(self) -> str:
        """Location and message, the excerpt, the hint: three to six lines without a final line end."""
        text = f"{self.severity}: {self.message}"
        if self.span is not None:
            for_what = f" (for {self.span.repeated})" if self.span.repeated else ""
            text = f"{self.span.location}: {text}{for_what}\n{self.span.excerpt()}"
        return text + "".join(f"\n        {line}" for line in self.hint.splitlines())

    def __str__(self) -> str:
        return self.render()


def _shown(text: str) -> str:
    """A piece of a line for an excerpt, with one character per column."""
    return visible(text.expandtabs(4))


class StcError(Exception):
    """Any error that the user can correct; its message says how."""

    def _render_traceback_(self) -> list[str]:
        """The output in a notebook: the message with its place in the spec, without a traceback."""
        return str(self).splitlines()


class SpecError(StcError):
    """Mistakes in the text of a spec, all that were found, in the order of the text."""

    diagnostics: tuple[Diagnostic, ...]

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__(self.diagnostics)

    def __str__(self) -> str:
        return self.shown()

    def shown(self, most: int | None = None) -> str:
        """The message with at most ``most`` mistakes, and the number of the others."""
        lines = [diagnostic.render() for diagnostic in self.diagnostics[:most]]
        if len(lines) < len(self.diagnostics):
            lines.append(f"and {len(self.diagnostics) - len(lines)} more mistakes")
        return "\n".join(lines)


class EvaluationError(StcError):
    """A function of the spec is undefined (0/0, the root of a negative number...) where its value is needed.

    ``expression`` is the statement's own text, ``frame`` where it was evaluated (a half at a midpoint),
    ``values`` the numbers that its names had there, in the units of the spec.
    """

    def __init__(
        self,
        message: str,
        *,
        expression: str = "",
        frame: float | None = None,
        values: Mapping[str, float] | None = None,
        span: Span | None = None,
        hint: str = "",
    ) -> None:
        super().__init__(message)
        self.message = message
        self.expression = expression
        self.frame = frame
        self.values = dict(values or {})
        self.span = span
        self.hint = hint

    def __str__(self) -> str:
        message = self.message
        if self.frame is not None:
            message += f" at frame {self.frame:g}"
        notes = []
        if self.expression and self.span is None:
            notes.append(f"in `{self.expression}`")
        if self.values:
            notes.append("with " + ", ".join(f"{name} = {value:.9g}" for name, value in self.values.items()))
        if self.hint:
            notes.append(self.hint)
        return Diagnostic("error", message, self.span, "\n".join(notes)).render()


class UsageError(StcError):
    """An invalid call or command line: an unknown option, constant, file or name."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message, hint)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message}\n  {self.hint}" if self.hint else self.message


#: What to do about a spec without a model.
OWN_MODEL = "docs/own_model.md describes how to write a model and connect a spec to it"


class UnsolvedError(UsageError):
    """A solve ended other than optimal, but an optimal solution is required; ``status`` says how it ended."""

    def __init__(self, message: str, hint: str, status: str) -> None:
        super().__init__(message, hint)
        self.status = status

    def __reduce__(self) -> tuple[type[UnsolvedError], tuple[str, str, str]]:
        return UnsolvedError, (self.message, self.hint, self.status)


class SolutionError(StcError):
    """A solution that contradicts itself, or a file that is not a solution."""


class EndedError(StcError):
    """The work was stopped before there was a result; ``status`` is ``time_limit`` or ``interrupted``."""

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message, status)
        self.message = message
        self.status = status

    def __str__(self) -> str:
        return self.message
