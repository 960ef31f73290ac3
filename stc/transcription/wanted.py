"""The numbers of a program that leave its kernels, all of them or those of a part, and their targets.

This depends neither on the scaling, of which a solve has several, nor on constants, of which one solve after another
has its own. So it is computed once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass, field
from stc.solver.evaluator import Indices, Part
from stc.transcription.assemble import Program, Sparsity
from stc.transcription.gather import Copying

__all__ = ["Wanted"]

Known = TypeVar("Known")

#: Variables and rows of the largest program that keeps it for its next solve, and of how many parts.
LARGEST, KEPT = 3_000_000, 2


@dataclass(slots=True)
class Wanted:
    """The requested numbers of a program.

    Attributes:
        row_source: as in :class:`Program`, for the requested rows.
        gradient, jacobian, hessian: the requested entries, at their own places.
        part: the part; None for all.
    """

    row_source: Indices
    gradient: Sparsity
    jacobian: Sparsity
    hessian: Sparsity
    part: Part | None
    _known: dict[Any, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, program: Program, part: Part | None) -> Wanted:
        """All numbers of a program, or those of a part, found anew only where the program has not kept them."""
        for known in program.wanted:
            if known.part is part:
                return cast("Wanted", known)
            if known.part is not None and part is not None and known.part.alike(part):
                return replace(known, part=replace(known.part, x=part.x))
        made = cls._of(program, part)
        if program.size + program.row_count <= LARGEST:
            program.wanted[:] = [*program.wanted[1 - KEPT :], made]
        return made

    @classmethod
    def _of(cls, program: Program, part: Part | None) -> Wanted:
        gradient, jacobian, hessian = program.gradient, program.jacobian, program.hessian
        if part is None:
            return cls(program.row_source, gradient, jacobian, hessian, None)
        place = np.full(program.size, -1, np.int32)
        place[part.cols] = np.arange(len(part.cols))
        at = np.flatnonzero(place[gradient.cols] >= 0)
        return cls(
            program.row_source[part.rows],
            replace(
                gradient, rows=gradient.rows[at], cols=place[gradient.cols[at]], first=gradient.first[at]
            ),
            replace(jacobian, rows=part.jac_rows, cols=part.jac_cols, first=jacobian.first[part.jac]),
            replace(hessian, rows=part.hess_rows, cols=part.hess_cols, first=hessian.first[part.hess]),
            part,
        )

    def _once(self, key: Any, make: Callable[[], Known]) -> Known:
        if key not in self._known:
            self._known[key] = make()
        found: Known = self._known[key]
        return found

    def others(self, size: int) -> Indices:
        """The variables, out of the given number, that are not in the part."""
        assert self.part is not None
        cols = self.part.cols
        return self._once("others", lambda: _without(size, cols))

    def spread(self, places: Indices, piece: slice) -> Copying:
        """The copies of numbers to a contiguous piece of targets."""
        key = "spread", id(places), piece.start, piece.stop
        return self._once(key, lambda: Copying.to(places[piece]))

    def rows(self, piece: slice) -> Copying:
        """The copies of a piece of the rows from the values' buffer."""
        return self._once(("rows", piece.start, piece.stop), lambda: Copying.of(self.row_source[piece]))

    def outputs(self, begin: int, end: int) -> list[tuple[int, slice, Copying]]:
        """The copies at these positions of the derivatives' buffer: matrices, entries, copies."""
        return self._once(("outputs", begin, end), lambda: list(self._outputs(begin, end)))

    def _outputs(self, begin: int, end: int) -> Iterator[tuple[int, slice, Copying]]:
        # of the type of what is searched, which is not converted then
        ends = np.array([begin, end], np.int32)
        for number, matrix in enumerate((self.gradient, self.jacobian, self.hessian)):
            first, last = np.searchsorted(matrix.first, ends).tolist()
            if first < last:
                at = slice(first, last)
                into = self._targets(number, np.arange(first, last, dtype=np.int32))
                yield number, at, Copying.of(matrix.first[at], into)

    def folded(self, number: int) -> tuple[Indices, Copying]:
        """The entries of a matrix that are copied again after summation, and their copies."""
        return self._once(("folded", number), lambda: self._folded(number))

    def _folded(self, number: int) -> tuple[Indices, Copying]:
        matrix = (self.gradient, self.jacobian, self.hessian)[number]
        at = np.flatnonzero(np.isin(matrix.first, matrix.folding.changed())).astype(np.int32)
        return at, Copying.of(matrix.first[at], self._targets(number, at))

    def _targets(self, number: int, entries: Indices) -> Indices:
        """The targets of entries of a matrix: a gradient has all variables, including those with a zero derivative."""
        return entries if number else self.gradient.cols[entries]


def _without(size: int, places: Indices) -> NDArray[np.int32]:
    """All places below ``size`` but these."""
    absent = np.ones(size, bool)
    absent[places] = False
    return np.flatnonzero(absent).astype(np.int32)
