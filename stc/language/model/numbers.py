"""Numbers of a model, such as a mass, that a spec sets: by parameters, and by expressions of `set` lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from stc.language.context import Context
from stc.language.model.scope import ModelScope
from stc.problem import (
    ConstantRef,
    Correction,
    DefinitionPiece,
    Fixture,
    FrameRange,
    Guess,
    ParameterRef,
    Relation,
    ReplayChannel,
)
from stc.symbolic.expr import Expr, num, substitute, sym


def given_numbers(context: Context, model: ModelScope, replay: Sequence[ReplayChannel]) -> dict[object, Expr]:
    """The replacements for numbers of the model in its equations: expressions of `set` lines, declared parameters.

    A `set` line that would change the replay alone is noted as a mistake.
    """
    found: dict[object, Expr] = {
        ConstantRef(name): sym(ParameterRef(name))
        for name in model.constants
        if context.table.kind(name) == "parameter"
    }
    for channel in replay:
        name = model.number_named(channel.path) if channel.kind == "set" else None
        if name is None or channel.body is sym(ConstantRef(name)):
            continue
        if name in model.constants:
            found[ConstantRef(name)] = channel.body
        else:
            hint = f"it is not an input of the equations: give it by `constants: {name} = 0.1;` or `--set {name}=0.1`"
            message = f"`set {name}` would change the replay and not the equations"
            context.diagnostics.error(message, channel.span.start, channel.span.end, hint)
    return found


def guesses_of_numbers(context: Context, model: ModelScope) -> list[Guess]:
    """The guess of parameters that are numbers of the model: the model's values."""
    span = context.span(model.statement)
    return [
        Guess(name, num(value), FrameRange(0, 0), span)
        for name, value in model.constants.items()
        if context.table.kind(name) == "parameter"
    ]


class Putting:
    """Substitutes expressions for numbers of the model.

    Args:
        given: the replacement by the number's symbol, see :func:`given_numbers`.
    """

    def __init__(self, given: Mapping[object, Expr]) -> None:
        self._given = given
        self._memo: dict[Expr, Expr] = {}

    def __call__(self, e: Expr) -> Expr:
        return substitute(e, self._given, self._memo)

    def bound(self, e: Expr | None) -> Expr | None:
        """A lower or upper bound with the model's numbers substituted; None without a bound."""
        return None if e is None else self(e)

    def definitions(self, pieces: dict[str, list[DefinitionPiece]]) -> None:
        """Substitute the model's numbers in definitions under range headers; ``pieces`` is changed in place."""
        for name, known in pieces.items():
            pieces[name] = [replace(piece, body=self(piece.body)) for piece in known]

    def relations(self, relations: Sequence[Relation]) -> list[Relation]:
        """Constraints with the model's numbers substituted; equalities keep one expression on both sides."""
        rows = []
        for one in relations:
            lower = self.bound(one.lower)
            upper = lower if one.is_equality else self.bound(one.upper)
            between = self.bound(one.between)
            rows.append(replace(one, body=self(one.body), lower=lower, upper=upper, between=between))
        return rows

    def corrections(self, corrections: Iterable[Correction]) -> list[Correction]:
        """The corrections of links (contacts, closed loops), with the model's numbers in their shares."""
        return [replace(one, shares={key: self(e) for key, e in one.shares.items()}) for one in corrections]

    def fixtures(self, fixtures: Iterable[Fixture]) -> list[Fixture]:
        """Fixtures with the model's numbers substituted."""
        return [
            replace(one, places=[self(e) for e in one.places], rates=[self(e) for e in one.rates])
            for one in fixtures
        ]
