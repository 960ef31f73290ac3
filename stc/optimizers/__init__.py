"""The optimizers by name.

``sqp`` is the project's own method and the default; ``nlopt:NAME`` are NLopt's algorithms and ``witkin-kass`` is
the method of the 1988 paper.  All take the same problem and options and give the same kind of result.
"""

from __future__ import annotations

from functools import partial
from typing import Protocol

from stc.errors import UsageError
from stc.solver.nlp import NLP
from stc.solver.options import Options
from stc.solver.report import Callback, Result, Start
from stc.solver.sqp import minimize

__all__ = [
    "DEFAULT",
    "Minimizer",
    "SizeWarning",
    "caution",
    "has_long_steps",
    "optimizer_names",
    "optimizer_of",
]

DEFAULT = "sqp"
WITKIN_KASS = "witkin-kass"


class SizeWarning(UserWarning):
    """An optimizer is used on a problem far larger than it is meant for."""


class Minimizer(Protocol):
    """The call signature of every optimizer."""

    def __call__(
        self,
        nlp: NLP,
        options: Options | None = None,
        callback: Callback | None = None,
        start: Start | None = None,
    ) -> Result:
        """Minimise; limits, interruptions and failures are statuses."""


def optimizer_of(name: str) -> Minimizer:
    """The optimizer of a name.

    Raises:
        UsageError: there is none of that name.
    """
    if name == DEFAULT:
        return minimize
    if not isinstance(name, str):
        raise UsageError(f"an optimizer is a name such as `{DEFAULT}`, not {name!r}")
    if name.startswith("nlopt:"):
        from stc.optimizers.nlopt_adapter import minimize_with_nlopt
        from stc.optimizers.nlopt_algorithms import choose

        choose(name)
        return partial(minimize_with_nlopt, name)
    if name in (WITKIN_KASS, f"{WITKIN_KASS}:printed"):
        from stc.optimizers.witkin_kass import minimize_witkin_kass

        return partial(minimize_witkin_kass, variant=name.partition(":")[2])
    from difflib import get_close_matches

    names = optimizer_names()
    near = get_close_matches(name, [*names, *(n.partition(":")[2] for n in names if ":" in n)], n=1)
    meant = next((n for n in names if near and (n == near[0] or n.endswith(":" + near[0]))), "")
    known = f"the optimizers are {', '.join(names)}"
    raise UsageError(
        f"there is no optimizer `{name}`", f"did you mean `{meant}`? {known}" if meant else known
    )


def optimizer_names() -> list[str]:
    """Every optimizer, without choices of local algorithms."""
    from stc.optimizers.nlopt_algorithms import ALGORITHMS

    return [DEFAULT, WITKIN_KASS, f"{WITKIN_KASS}:printed", *(f"nlopt:{name}" for name in ALGORITHMS)]


def caution(name: str, nlp: NLP) -> str:
    """A warning about this optimizer on a problem of this size, or ""."""
    if not name.startswith("nlopt:"):
        return ""
    from stc.optimizers.nlopt_algorithms import caution, choose

    return caution(choose(name), nlp)


def has_long_steps(name: str, nlp: NLP) -> bool:
    """Whether single steps of this optimizer may take minutes on a problem of this size, despite limits."""
    if not name.startswith("nlopt:"):
        return False
    from stc.optimizers.nlopt_algorithms import choose, has_long_steps

    return has_long_steps(choose(name), nlp)
