"""The rows of a program that are products of two complementary sides, and the indices of these sides."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.solver.nlp import NLP, Floats, Ints, Mask

__all__ = ["Complementary", "Pairs", "pairs_of"]


@dataclass(frozen=True, slots=True)
class Pairs:
    """``0 <= a complements b >= 0``, k times: each side is what an entry of (variables, rows) has to spare.

    Attributes:
        product: the rows that state ``a*b <= 0``, (k,).
        side: indices of ``a`` and of ``b`` in (variables, rows): below n a variable, else n more than a row, (k, 2).
        lower: whether the side is above a lower bound, else it is below an upper one, (k, 2).
    """

    product: Ints
    side: Ints
    lower: Mask

    @classmethod
    def none(cls) -> Pairs:
        """No pairs."""
        return cls(np.zeros(0, np.int64), np.zeros((0, 2), np.int64), np.zeros((0, 2), bool))

    def __len__(self) -> int:
        return self.product.size

    def limits(self, nlp: NLP) -> Floats:
        """The bounds that the sides are measured from, (k, 2)."""
        low = np.concatenate([nlp.x_lower, nlp.row_lower])
        high = np.concatenate([nlp.x_upper, nlp.row_upper])
        return np.where(self.lower, low[self.side], high[self.side])

    def spare(self, nlp: NLP, x: Floats, rows: Floats) -> Floats:
        """``a`` and ``b`` at variables ``x`` (n,) with values ``rows`` (m,) of the rows, (k, 2)."""
        value = np.concatenate([x, rows])[self.side]
        return np.where(self.lower, 1.0, -1.0) * (value - self.limits(nlp))

    @staticmethod
    def shares(spare: Floats) -> Floats:
        """The smaller sides of pairs ``spare`` (k, 2), each relative to ``max(1, larger side)``, (k,)."""
        return np.asarray(spare.min(axis=1) / np.maximum(1.0, spare.max(axis=1)))

    def residual(self, nlp: NLP, x: Floats) -> float:
        """The largest of the smaller sides at ``x`` (n,), relative to ``max(1, larger side)``."""
        return float(self.shares(self.spare(nlp, x, nlp.values(x)[1])).max(initial=0.0))

    def among(self, x_index: NDArray[np.int64], row_index: NDArray[np.int64]) -> Pairs:
        """The pairs of a program that some variables and rows make: those of which product and sides are there.

        Args:
            x_index, row_index: where variables (n,) and rows (m,) are in that program, -1 where they are not.
        """
        count = int((x_index >= 0).sum())
        place = np.concatenate([x_index, np.where(row_index < 0, -1, row_index + count)])
        product, side = row_index[self.product], place[self.side]
        there = (product >= 0) & (side >= 0).all(axis=1)
        return Pairs(product[there], side[there], self.lower[there])


@runtime_checkable
class Complementary(Protocol):
    """A problem that knows which of its rows are products of complementary sides."""

    @property
    def pairs(self) -> Pairs:
        """The products and their sides."""


def pairs_of(nlp: NLP) -> Pairs | None:
    """The complementary pairs of a program; None where it has none."""
    return nlp.pairs if isinstance(nlp, Complementary) and len(nlp.pairs) else None
