"""The correspondence of frames between two motions of the same spec whose phases have different numbers of frames.

Frames that the spec names (see :func:`stc.phases.named_cuts`) are paired; between them frames keep their share.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stc.records import dataclass

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Alignment:
    """Corresponding frames of two motions: ``old`` and ``new``, (k,) each and increasing, including both ends."""

    old: FloatArray
    new: FloatArray

    @classmethod
    def even(cls, old: int, new: int) -> Alignment:
        """An alignment in which every frame keeps its share of the whole motion."""
        return cls(np.array([0.0, old]), np.array([0.0, max(new, 1)]))

    @classmethod
    def of(cls, old: Sequence[int], new: Sequence[int]) -> Alignment:
        """An alignment from the frames that both motions name, in the same order; the last entry of each is its last
        frame.

        Frames that cannot be paired are left out; frames between pairs keep their share.
        """
        last, end = old[-1], new[-1]
        if len(old) != len(new):
            return cls.even(last, end)
        inside = [(a, b) for a, b in zip(old, new, strict=True) if 0 < a < last and 0 < b < end]
        kept = [(0, 0), (last, end)]
        # A frame beside another one (`n/2 + 1`) stays beside it: only the one that is named more often is a knot.
        for (a, b), _ in sorted(Counter(inside).items(), key=lambda pair: (-pair[1], pair[0])):
            if all(abs(a - c) > 1 and (a - c) * (b - d) > 0 for c, d in kept):
                kept.append((a, b))
        knots = np.array(sorted(kept), dtype=float)
        return cls(knots[:, 0], knots[:, 1])

    @property
    def is_identity(self) -> bool:
        """Whether every frame keeps its index."""
        return np.array_equal(self.old, self.new)

    def to_new(self, frames: ArrayLike) -> FloatArray:
        """The indices in the new motion, possibly fractional, of frames of the old one."""
        return np.asarray(np.interp(np.asarray(frames, float), self.old, self.new))

    def to_old(self, frames: ArrayLike) -> FloatArray:
        """The indices in the old motion, possibly fractional, of frames of the new one."""
        return np.asarray(np.interp(np.asarray(frames, float), self.new, self.old))
