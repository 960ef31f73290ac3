"""One solve after another of the same program: what the first allocated and scaled serves the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from stc.solver.kkt.contract import KKTSystem
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["Keeper", "give_back", "kept_form", "key_of", "once"]


T = TypeVar("T")
P = TypeVar("P", bound=NLP)

#: Variables and rows of the largest program that something is kept of.
LARGEST = 5_000_000


def same(a: Floats, b: Floats) -> bool:
    """Whether two arrays of one length have the same entries. They must not be changed later."""
    return a is b or bool((a == b).all())


#: What a form depends on: where it is scaled and the bounds of the variables, (n,) each; and the settings.
Key = tuple[tuple[Floats, Floats, Floats], tuple[bool, Callable[..., KKTSystem]]]


class Keeper:
    """Data that a solve keeps for the next one of the same program.

    Programs whose functions and bounds of rows never change have one as their attribute ``keeper``.
    """

    def __init__(self) -> None:
        self._kept: tuple[Key, ScaledProblem] | None = None
        self._found: dict[object, tuple[tuple[Floats, Floats], Any]] = {}

    def once(self, find: Callable[[P], T], nlp: P) -> T:
        """The result of ``find``, which is called only once as long as the program's bounds are the same."""
        known = self._found.get(find)
        if known is None or not (same(known[0][0], nlp.x_lower) and same(known[0][1], nlp.x_upper)):
            known = self._found[find] = (nlp.x_lower, nlp.x_upper), find(nlp)
        return cast("T", known[1])

    def take(self, key: Key) -> ScaledProblem | None:
        """Remove the form that is kept, and return it if it was kept under this key; otherwise None."""
        kept, self._kept = self._kept, None
        if kept is None or kept[0][1] != key[1] or not all(map(same, kept[0][0], key[0])):
            return None
        return kept[1]

    def give(self, key: Key, form: ScaledProblem) -> None:
        """Keep a form that is no longer in use."""
        form.release()
        self._kept = key, form


def once(find: Callable[[P], T], nlp: P) -> T:
    """The result of ``find``, kept by the program's keeper if it has one (see ``Keeper.once``)."""
    keeper = _keeper(nlp)
    return find(nlp) if keeper is None else keeper.once(find, nlp)


def _keeper(nlp: NLP) -> Keeper | None:
    return getattr(nlp, "keeper", None)


def key_of(nlp: NLP, x0: Floats, options: Options, new_kkt: Callable[..., KKTSystem]) -> Key | None:
    """The key of a form of ``nlp`` scaled at ``x0`` (n,); None for programs without a keeper."""
    if _keeper(nlp) is None or nlp.n + nlp.m > LARGEST:
        return None
    return (x0, nlp.x_lower, nlp.x_upper), (options.scaling, new_kkt)


def kept_form(nlp: NLP, key: Key | None) -> ScaledProblem | None:
    """The form that an earlier solve has left, whose functions have values at its start; None where there is none."""
    keeper = _keeper(nlp)
    form = None if keeper is None or key is None else keeper.take(key)
    if form is None or not isinstance(form.kkt, StructuredKKT):
        return None
    form.nlp = nlp
    form.kkt.restart()
    return form


def give_back(form: ScaledProblem, nlp: NLP, key: Key | None) -> None:
    """Keep a form for the next solve of the same program."""
    keeper = _keeper(nlp)
    if keeper is not None and key is not None and isinstance(form.kkt, StructuredKKT):
        keeper.give(key, form)
