"""Numbers of a model in expressions: literals, or symbols whose values can be changed later.

A number is named by its path, the one that ``set`` lines have: ``("body", "torso", "mass")``,
``("option", "gravity", "z")``.  Zero is always a literal, so that products with it vanish.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence

from stc.records import dataclass
from stc.symbolic.expr import ZERO, Expr, evaluate, num, substitute, sym
from stc.symbolic.structure import mentions

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ModelNumber:
    """The key of the symbol of a number that can be set."""

    path: Path


@dataclass(frozen=True, slots=True)
class DerivedNumber:
    """The key of the symbol of a number that is computed from others, such as the mass of several bodies together."""

    name: Path


def none_of_them(path: Path) -> bool:
    """Select no number: all are literals."""
    return False


def all_of_them(path: Path) -> bool:
    """Select every number that can be set."""
    return True


class Numbers:
    """The numbers that are symbols, and their values.

    Parameters
    ----------
    chosen
        Whether the number with a path becomes a symbol.
    symbol
        Makes the symbol's expression from its path; one with the key :class:`ModelNumber` if not given.

    Attributes
    ----------
    values
        The model's own value of every number that has become a symbol.
    derived
        What derived numbers are in terms of those and of derived numbers that come before them.
    """

    def __init__(
        self, chosen: Callable[[Path], bool] = none_of_them, symbol: Callable[[Path], Expr] | None = None
    ) -> None:
        self._chosen = chosen
        self._symbol = symbol or (lambda path: sym(ModelNumber(path)))
        self.values: dict[Path, float] = {}
        self.derived: dict[DerivedNumber, Expr] = {}

    def number(self, value: float, *path: str) -> Expr:
        """The expression of a number."""
        if value == 0.0:
            return ZERO
        if not self._chosen(path):
            return num(value)
        self.values[path] = value
        return self._symbol(path)

    def derive(self, e: Expr, *name: str) -> Expr:
        """A symbol for an expression of numbers; the expression itself if it is as simple."""
        if not e.args:
            return e
        if e.op == "neg" and not e.args[0].args:
            return e
        key = DerivedNumber(name)
        if self.derived.setdefault(key, e) is not e:
            raise ValueError(f"two derived numbers with the name {'.'.join(name)}")
        return sym(key)

    def derived_values(self, values: Mapping[Hashable, float]) -> dict[Hashable, float]:
        """The values of all derived numbers.

        Parameters
        ----------
        values
            Of the symbols of numbers, by their keys: ``ModelNumber(path)`` where no other ones were asked for.
        """
        found: dict[Hashable, float] = dict(values)
        for key, e in self.derived.items():
            found[key] = evaluate(e, found)
        return {key: found[key] for key in self.derived}

    def expanded(self, expressions: Sequence[Expr], depends: Callable[[Hashable], bool]) -> list[Expr]:
        """Expressions with derived numbers expanded if they depend on numbers that are unknowns.

        Parameters
        ----------
        expressions
            Any.
        depends
            Whether the symbol with a key is one of those numbers.
        """
        replaced: dict[Hashable, Expr] = {}
        for key, e in self.derived.items():
            whole = substitute(e, replaced)
            if mentions(whole, depends):
                replaced[key] = whole
        return [substitute(e, replaced) for e in expressions]
