"""From the text of a spec to a :class:`stc.problem.Problem`.

``parse`` gives a text's syntax tree, ``elaborate`` the problem; ``read_problem`` is both in one, which finds
mistakes of both kinds in one run.
"""

from __future__ import annotations

from collections.abc import Mapping

from stc.errors import Source, SpecError
from stc.language.diagnostics import Diagnostics
from stc.language.elaborate import elaborate, elaborate_with_recovery
from stc.language.parser import parse, parse_with_recovery
from stc.problem import Problem


def read_problem(
    source: Source, overrides: Mapping[str, float] | None = None, method: str | None = None
) -> Problem:
    """The problem that a text states: :func:`parse`, then :func:`elaborate`.

    Raises:
        SpecError: with all mistakes: those of syntax, and those of meaning in the statements that could be
        read. UsageError: an override or the method names nothing that exists.
    """
    diagnostics = Diagnostics(source)
    tree = parse_with_recovery(source, diagnostics)
    problem = elaborate_with_recovery(tree, overrides or {}, method, diagnostics)
    if problem is None or diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    return problem


__all__ = ["elaborate", "parse", "read_problem"]
