"""One solve after another of the same program: what the first allocated and scaled serves the next."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar, cast

from stc.solver.kkt.contract import KKTSystem
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["Keeper", "give_back", "kept_form", "key_of"]


T = TypeVar("T")

#: Variables and rows of the largest program that something is kept of.
LARGEST = 5_000_000


class Keeper:
    """What a solve leaves for the next one of the same program.

    Programs whose functions and bounds of rows never change have one as their attribute ``keeper``.
    """

    def __init__(self) -> None:
        self._kept: tuple[object, ScaledProblem] | None = None
        self._determined: tuple[object, Any] | None = None

    def determined(self, key: object, find: Callable[[], T]) -> T:
        """What ``find`` tells of the program, asked once for each key in turn."""
        if self._determined is None or self._determined[0] != key:
            self._determined = key, find()
        return cast("T", self._determined[1])

    def take(self, key: object) -> ScaledProblem | None:
        """What was left under this key; whatever was left is gone then."""
        kept, self._kept = self._kept, None
        return kept[1] if kept is not None and kept[0] == key else None

    def give(self, key: object, form: ScaledProblem) -> None:
        """Leave a form, of which nobody makes use any more."""
        form.release()
        self._kept = key, form


def key_of(nlp: NLP, x0: Floats, options: Options, new_kkt: Callable[..., KKTSystem]) -> Hashable:
    """What a form of ``nlp`` that is scaled at ``x0`` (n,) depends on; None for programs that are not kept."""
    if getattr(nlp, "keeper", None) is None or nlp.n + nlp.m > LARGEST:
        return None
    bounds = nlp.x_lower.tobytes(), nlp.x_upper.tobytes()
    return x0.tobytes(), *bounds, options.scaling, new_kkt


def kept_form(nlp: NLP, key: Hashable) -> ScaledProblem | None:
    """The form that an earlier solve has left, whose functions have values at its start; None where there is none."""
    keeper: Keeper | None = getattr(nlp, "keeper", None)
    form = None if keeper is None or key is None else keeper.take(key)
    if form is None or not isinstance(form.kkt, StructuredKKT):
        return None
    form.nlp = nlp
    form.kkt.restart()
    return form


def give_back(form: ScaledProblem, nlp: NLP, key: Hashable) -> None:
    """Keep a form for the next solve of the same program."""
    keeper: Keeper | None = getattr(nlp, "keeper", None)
    if keeper is not None and key is not None and isinstance(form.kkt, StructuredKKT):
        keeper.give(key, form)
