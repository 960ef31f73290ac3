"""Collect mistakes while reading goes on, and suggest names."""

from __future__ import annotations

from collections.abc import Iterable

from stc.errors import Diagnostic, Source, Span


class Diagnostics:
    """The mistakes and warnings found so far in one source; the same one at the same place counts once.

    In repeated text, a place counts once whatever the message is: only the first repetition is reported.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.items: list[Diagnostic] = []
        self._seen: set[tuple[str, int, int]] = set()
        self.error_count = 0

    def _add(self, severity: str, message: str, start: int, end: int, hint: str) -> None:
        key = (message, start, end)
        if self.source.origins is not None and self.source.origins.values(start):
            key = (severity, *self.source.place(start, end))
        if key in self._seen:
            return
        self._seen.add(key)
        self.items.append(Diagnostic(severity, message, Span(self.source, start, end), hint))
        self.error_count += severity == "error"

    def error(self, message: str, start: int, end: int, hint: str = "") -> None:
        """Add a mistake for the characters ``start`` to ``end``."""
        self._add("error", message, start, end, hint)

    def warning(self, message: str, start: int, end: int, hint: str = "") -> None:
        """Add a warning about something that is allowed but probably not intended."""
        self._add("warning", message, start, end, hint)

    def errors(self) -> list[Diagnostic]:
        """The mistakes, in the order of the text."""
        return sorted((d for d in self.items if d.severity == "error"), key=_place)

    def warnings(self) -> list[Diagnostic]:
        """The warnings, in the order of the text."""
        return sorted((d for d in self.items if d.severity == "warning"), key=_place)


def shortened(listed: list[str], most: int = 12) -> list[str]:
    """A long list with ``...`` for its middle."""
    return listed if len(listed) <= most else [*listed[: most - 2], "...", listed[-1]]


def _place(diagnostic: Diagnostic) -> int:
    span = diagnostic.span
    return span.source.place(span.start, span.end)[0] if span is not None else -1


def edit_distance(a: str, b: str) -> int:
    """Fewest insertions, deletions, substitutions and swaps of neighbours that make ``a`` into ``b``.

    The optimal string alignment distance (Damerau 1964; restricted to non-overlapping swaps).
    """
    previous2: list[int] = []
    previous = list(range(len(b) + 1))
    for row, x in enumerate(a, 1):
        current = [row] + [0] * len(b)
        for column, y in enumerate(b, 1):
            best = min(previous[column] + 1, current[column - 1] + 1, previous[column - 1] + (x != y))
            if row > 1 and column > 1 and x == b[column - 2] and a[row - 2] == y:
                best = min(best, previous2[column - 2] + 1)
            current[column] = best
        previous2, previous = previous, current
    return previous[-1]


def nearest_name(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate for which ``name`` is most probably a misspelling, or None if none is close.

    Close means one edit in names of two to five letters, two from six, three from nine on; a difference in case
    alone is closer than any other.
    """
    limit = 0 if len(name) < 2 else 1 if len(name) < 6 else 2 if len(name) < 9 else 3
    best: str | None = None
    best_score = float("inf")
    for candidate in candidates:
        if candidate == name or abs(len(candidate) - len(name)) > limit:
            continue
        if candidate.lower() == name.lower():
            score = 0.5
        else:
            score = edit_distance(name.lower(), candidate.lower())
            if score > limit or score >= max(len(name), len(candidate)):
                continue
            if len(candidate) == 1 and name != 2 * candidate:
                continue  # everything of two letters is one slip from a name of one letter
            # the later in the word the slip, the likelier
            same = next((k for k, (x, y) in enumerate(zip(name, candidate)) if x != y), len(candidate))
            score -= 0.01 * same + 0.01 * (name == 2 * candidate)
        if score < best_score:
            best, best_score = candidate, score
    return best


#: How a time derivative is called where there is no prime, by its order.
_DERIVATIVES = (
    (1, ("{}_dot", "{}dot", "d{}", "d{}_dt", "d{}dt", "{}_d", "{}_prime")),
    (2, ("{}_ddot", "{}ddot", "dd{}", "d2{}", "d2{}_dt2", "d2{}dt2", "{}_dd", "{}_dotdot")),
)


def derivative_meant(name: str, variables: Iterable[str]) -> str:
    """The hint for an undeclared name that looks like a derivative of a variable, or ''."""
    for variable in variables:
        for order, shapes in _DERIVATIVES:
            if name in [shape.format(variable) for shape in shapes]:
                return f"the {'second ' * (order == 2)}derivative of `{variable}` is `{variable}{order * chr(39)}`"
    return ""


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """``did you mean `x`?`` for the nearest candidate, or an empty text."""
    found = nearest_name(name, candidates)
    return f"did you mean `{found}`?" if found else ""
