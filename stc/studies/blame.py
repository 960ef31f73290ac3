"""The statements that cause a solve not to end optimal.

For an infeasible spec: the statements that contradict each other, each with the frame and the amount of its violation.
 For a solve that ended early or failed: the statements, frames and values with the largest errors.
"""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from stc.language.syntax import Node, statement_text
from stc.problem import ConstantRef, ParameterRef
from stc.records import dataclass, field
from stc.solver.convexity import is_convex
from stc.solver.status import STILL_FALLING
from stc.studies.conflict import Conflict, find_conflict
from stc.studies.relaxation import Relaxation, needed_relaxation
from stc.studies.standouts import dependent_rows, largest_residuals, undefined_nearby
from stc.symbolic.expr import symbols
from stc.transcription.bind import BoundProgram, Contradiction
from stc.transcription.ownership import Ownership, Place
from stc.transcription.statements import LINK

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution

FloatArray = NDArray[np.float64]

__all__ = ["Blame", "Culprit", "blame"]

#: Statements hold whose violation, scaled as the solver does, is at most this: the limit of the validation.
_MET = 1e-6
#: Statements listed under one heading, and lines in all.
MOST, MOST_LINES = 6, 8

#: Characters of a statement that are shown in a line.
LONGEST = 70


@dataclass(frozen=True, slots=True)
class Culprit:
    """A statement that contributes to the failure.

    Attributes:
        kind: ``conflict``, ``residual``, ``dependent`` or ``undefined``.
        statement: its text; in words for a row of the transcription itself.
        file, line, column: its position; "" and 0 for the transcription's rows.
        frame: the frame with the largest error, plus one half at midpoints; None in a problem without frames.
        side: ``before`` or ``after`` if that frame has a jump.
        residual: its violation there, in its own units: positive above, negative below; None if that does not apply.
        text: all of this in one line, as people read it.
    """

    kind: str
    statement: str
    file: str
    line: int
    column: int
    frame: float | None
    side: str
    residual: float | None
    text: str


@dataclass(frozen=True, slots=True)
class Blame:
    """The causes of a failure.

    Attributes:
        status: how the solve ended.
        summary: one or two sentences.
        culprits: the statements, those of a conflict first.
        minimal: for a conflict, whether without any one statement the others can hold; None without one.
        solves: number of feasibility problems solved.
        seconds: time of the search.
    """

    status: str
    summary: str
    culprits: list[Culprit] = field(default_factory=list)
    minimal: bool | None = None
    solves: int = 0
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)

    def __str__(self) -> str:
        # Of a set that may not be minimal, those that were found to miss are enough.
        known = sum(one.residual is not None for one in self.culprits) if self.minimal is False else 0
        most = min(known, MOST_LINES) or MOST_LINES
        lines = [self.summary, *(f"  {one.text}" for one in self.culprits[:most])]
        if rest := self.culprits[most:]:
            numbers = sorted({one.line for one in rest if one.line})
            places = f", on line{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}" if numbers else ""
            lines.append(f"  and {len(rest)} more{places}")
        return "\n".join(lines)


def blame(model: Model, solution: Solution, time_limit: float = 10.0) -> Blame | None:
    """The statements that caused a solve of ``model`` to end as ``solution`` did.

    Args:
        model: the spec.
        solution: its solution.
        time_limit: seconds that the search for a minimal conflict may take.

    Returns:
        The statements to blame, or None for a solution that is optimal or unbounded.

    Raises:
        SpecError, UsageError: the model is of another spec than the solution.
    """
    if solution.status in ("optimal", "unbounded"):
        return None
    begin = time.perf_counter()
    problem, transcription = model.transcription(solution.method, **solution.overrides)
    bound = transcription.bind(problem.constants)
    with np.errstate(all="ignore"):
        found = _Search(Ownership(transcription, bound), bound, solution).run(time_limit)
    return Blame(
        solution.status,
        found.summary,
        found.culprits,
        found.minimal,
        found.solves,
        time.perf_counter() - begin,
    )


class _Search:
    """Looks for the statements because of which a solve failed."""

    def __init__(self, ownership: Ownership, bound: BoundProgram, solution: Solution) -> None:
        self.ownership, self.bound, self.solution = ownership, bound, solution
        self.problem = ownership.problem
        good = len(solution.x) == bound.n and np.isfinite(solution.x).all()
        self.x = solution.x if good else bound.x0
        self.y = solution.row_multipliers if good else np.zeros(bound.m)

    def run(self, time_limit: float) -> Blame:
        self.deadline = time.perf_counter() + 2.0 * time_limit
        if self.bound.contradictions:
            return self._contradiction(self.bound.contradictions[0])
        if self.solution.status == "infeasible":
            conflict = find_conflict(self.bound, self.ownership, self.x, self.y, time_limit)
            if conflict is not None and conflict.relations:
                return self._conflict(conflict)
            if conflict is not None:
                return Blame(
                    "",
                    "All statements can hold together: a point that satisfies them was found without the "
                    "objective. Try another guess.",
                    solves=conflict.solves,
                )
        return self._standouts()

    # -- infeasible --------------------------------------------------------------------------------------------

    def _contradiction(self, found: Contradiction) -> Blame:
        relations = [k for k in dict.fromkeys(found.relations) if k >= 0]
        culprits = []
        place = Place(found.frame) if found.frame >= 0 and self.problem.n else None
        for relation in relations:
            others = set(relations) - {relation}
            left = self.deadline - time.perf_counter()
            lack = needed_relaxation(self.bound, self.ownership, others, relation, self.x, left)
            gap = found.gap if lack is None else lack.amount
            culprits.append(self._culprit("conflict", relation, place, gap, f"misses by {abs(gap):.4g}"))
        count = (
            "This statement cannot hold" if len(culprits) == 1 else "These statements cannot hold together"
        )
        return Blame("", f"{count}: {found.message}.", culprits, minimal=True)

    def _conflict(self, conflict: Conflict) -> Blame:
        ranked = list(conflict.relations)
        culprits = []
        for relation, lack in zip(ranked, conflict.lacks, strict=True):
            culprits.append(self._conflicting(relation, lack, others=len(ranked) > 1))
        if conflict.minimal:  # each is as much to blame as the others: in the order of the text
            culprits = [culprit for _, culprit in sorted(zip(ranked, culprits), key=lambda pair: pair[0])]
        else:  # what is known of some helps more than that the others take part
            culprits.sort(key=lambda culprit: culprit.residual is None)
        # Of statements that are not convex nobody has looked everywhere.
        near = "" if is_convex(self.bound) else ", at least near here"
        several = f"These {len(culprits)} statements cannot hold together{near}"
        if len(culprits) == 1:
            summary = f"This statement cannot hold{near}, whatever the other statements are:"
        elif conflict.minimal:
            summary = f"{several}; without any one of them the others can:"
        else:
            summary = f"{several}; there was no time to find which of them are needed for that (--explain takes more)"
            known = any(lack is not None for lack in conflict.lacks)
            summary += (
                ". It is enough to change one of these:" if known else ". The most influential come first:"
            )
        return Blame("", summary, culprits, conflict.minimal, conflict.solves)

    def _conflicting(self, relation: int, lack: Relaxation | None, others: bool) -> Culprit:
        """A statement of a conflict with its violation if the others hold, if there are others."""
        if lack is None:
            return self._culprit("conflict", relation, None, None, "")
        keys = symbols(self.problem.relations[relation].body)
        framed = self.problem.n and not all(isinstance(key, ParameterRef | ConstantRef) for key in keys)
        place = lack.place if framed else None
        note = f"misses by {abs(lack.amount):.4g}"
        culprit = self._culprit("conflict", relation, place, lack.amount, note)
        return replace(culprit, text=f"{culprit.text} when the others hold") if others else culprit

    # -- stuck or out of time ----------------------------------------------------------------------------------

    def _standouts(self) -> Blame:
        culprits, parts = [], []
        undefined = undefined_nearby(self.bound, self.x)
        if len(undefined):
            parts.append("close to the last point these statements are undefined or not differentiable")
            culprits += [
                self._row_culprit("undefined", int(row), None, "") for row in self._first_of_each(undefined)
            ]
        large = largest_residuals(self.bound, self.x)
        if large:
            parts.append("the largest violations are")
            residuals = dict(large)
            for row in self._first_of_each(np.array([row for row, _ in large])):
                off = residuals[int(row)]
                culprits.append(self._row_culprit("residual", int(row), off, f"misses by {abs(off):.4g}"))
        dependent = dependent_rows(self.bound, self.x)
        if len(dependent):
            parts.append("these statements are linearly dependent there")
            culprits += [
                self._row_culprit("dependent", int(row), None, "") for row in self._first_of_each(dependent)
            ]
        if self.solution.status == "infeasible":
            parts.insert(0, "no minimal set of conflicting statements was found in time")
        if not parts and self.solution.violation <= _MET:
            held = f"All statements hold where the solve ended, to {self.solution.violation:.0e};"
            further = "only the objective may become smaller."
            # A message that the objective still falls says that it may have no least value.
            if STILL_FALLING.split("{")[0] not in self.solution.message:
                further += " A solve that goes on from there often ends optimal: --warm-start FILE."
            return Blame("", f"{held} {further}")
        if not parts:
            return Blame("", "No statement stands out where the solve ended.")
        summary = "; ".join(parts)
        return Blame("", f"{summary[0].upper()}{summary[1:]}:", culprits)

    def _first_of_each(self, rows: Any) -> list[int]:
        """The first row of each of a few statements, in the order given."""
        seen: dict[object, int] = {}
        for row in rows:
            owner = int(self.ownership.row_owner[row])
            seen.setdefault(owner if owner != LINK else self.ownership.label(int(row)), int(row))
        return list(seen.values())[:MOST]

    def _row_culprit(self, kind: str, row: int, residual: float | None, note: str) -> Culprit:
        owner = int(self.ownership.row_owner[row])
        place = self.ownership.place(row) if self.problem.n else None
        if owner == LINK:
            name = self.ownership.label(row).removeprefix("link of ")
            rule = f"the method's equation for {name}' between neighbouring frames"
            return self._written(kind, rule, "", 0, 0, place, residual, note)
        return self._culprit(kind, owner, place, residual, note)

    # -- words -------------------------------------------------------------------------------------------------

    def _culprit(
        self, kind: str, relation: int, place: Place | None, residual: float | None, note: str
    ) -> Culprit:
        stated = self.problem.relations[relation]
        span = stated.span
        cause = statement_text(span.source, Node(span.start, span.end))
        if cause == stated.text or stated.coordinate:
            cause = ""
        return self._written(
            kind, stated.text, span.source.name, span.line, span.column, place, residual, note, cause
        )

    def _written(
        self,
        kind: str,
        statement: str,
        file: str,
        line: int,
        column: int,
        place: Place | None,
        residual: float | None,
        note: str,
        cause: str = "",
    ) -> Culprit:
        """A statement with its line of text; ``cause`` is the statement from which it was generated, if there is
        one.
        """
        short = _shortened(statement)
        head = f"{file}:{line}:{column}: `{short}`" if file else f"({short})"
        head += f" (from `{_shortened(cause)}`)" if cause else ""
        if kind in ("undefined", "dependent"):
            note = {"undefined": "undefined or not differentiable", "dependent": "dependent"}[kind]
        tail = " ".join(part for part in (note, f"at {place}" if place is not None else "") if part)
        frame, side = (None, "") if place is None else (place.frame, place.side)
        text = f"{head} {tail}".rstrip()
        return Culprit(kind, statement, file, line, column, frame, side, residual, text)


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
