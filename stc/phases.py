"""The phases of a motion, in each of which the same equations hold.

A spec may state different equations of motion before and after a contact.  The statements that hold between two frames
are known from their ranges; neighbouring steps with the same statements form one phase.  Statements on single frames
(starts, ends, waypoints) belong to no phase.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

from stc.problem import DefinitionRef, ObjectiveTerm, Problem, Relation, VariableRef
from stc.records import dataclass
from stc.symbolic.expr import Expr, substitute, sym, symbols
from stc.time_derivatives import time_derivative


@dataclass(frozen=True, slots=True)
class Equation:
    """An equation of the spec in one phase.

    Attributes:
        body: the expression that must be zero; ranged definitions are replaced by the valid piece, sides of jumps
            dropped.
        relation: its statement.
    """

    body: Expr
    relation: Relation


@dataclass(frozen=True, slots=True)
class Phase:
    """Frames ``first`` to ``last`` and the equations that hold on every step between them."""

    first: int
    last: int
    equations: tuple[Equation, ...]

    def __str__(self) -> str:
        return f"frames {self.first} to {self.last}"


def phases(problem: Problem) -> list[Phase]:
    """All phases in the order of time; empty if the motion has one frame only."""
    wide = [r for r in problem.relations if r.is_equality and r.range.first < r.range.last]
    found: list[Phase] = []
    for first, last in stretches(problem, wide):
        here = [r for r in wide if r.range.first <= first and last <= r.range.last]
        equations = tuple(Equation(_difference(problem, r, first), r) for r in here)
        if found and [e.body for e in found[-1].equations] == [e.body for e in equations]:
            found[-1] = replace(found[-1], last=last)
        else:
            found.append(Phase(first, last, equations))
    return found


def stretches(problem: Problem, relations: Iterable[Relation]) -> list[tuple[int, int]]:
    """Intervals of frames on which each of some statements holds or does not, and each definition is one piece.

    Between two frames, a definition under range headers has the meaning of the first of them, after its jump if it has
    one.
    """
    pieces = [piece.range for several in problem.definitions.values() for piece in several]
    cuts = {0, problem.n} | {k for r in relations for k in (r.range.first, r.range.last)}
    cuts |= {k for r in pieces for k in (r.first, r.last + 1) if k <= problem.n}
    cuts |= {r.last for r in pieces}.intersection(jump.frame for jump in problem.jumps)
    return list(pairwise(sorted(cuts)))


def named_cuts(problem: Problem) -> list[int]:
    """Frames at which something jumps, begins or ends, in an order that does not depend on n; the last is n."""
    found = [jump.frame for jump in problem.jumps]
    for several in problem.definitions.values():
        for piece in several:
            found += [piece.range.first, piece.range.last + 1]
    statements: list[Relation | ObjectiveTerm] = [*problem.relations, *problem.objective]
    for statement in statements:
        found += [statement.range.first, statement.range.last]
    return [*found, problem.n]


def _difference(problem: Problem, relation: Relation, first: int) -> Expr:
    """The left side of an equation minus its right side, after frame ``first``."""
    body = relation.body if relation.lower is None else relation.body - relation.lower
    return resolved(problem, body, first)


def resolved(problem: Problem, body: Expr, first: int) -> Expr:
    """An expression as it applies between frame ``first`` and the next one.

    Ranged definitions become the piece that holds at that frame (the later of two; where it jumps, rather one
    that does not end there), variables lose the side of a jump.
    """
    jumps = any(jump.frame == first for jump in problem.jumps)
    while True:
        changes: dict[object, Expr] = {}
        for key in symbols(body):
            if isinstance(key, DefinitionRef):
                pieces = problem.definitions.get(key.name, ())
                holding = [p for p in pieces if p.range.first <= first <= p.range.last]
                if jumps and key.name != "h":
                    holding = [p for p in holding if not p.range.first < p.range.last == first] or holding
                if holding:
                    changes[key] = time_derivative(holding[-1].body, key.order, problem.rotations)
            elif isinstance(key, VariableRef) and key.side:
                changes[key] = sym(replace(key, side=""))
        if not changes:
            return body
        body = substitute(body, changes)
