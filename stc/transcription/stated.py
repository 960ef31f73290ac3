"""A problem on its frames: unknowns, rows, bounds and objective as expressions, before derivation.

This is sufficient to read a decision vector, to evaluate statements at it, and to find the statement of a multiplier.
Derivatives and kernels come on top of it in :mod:`stc.transcription.transcription`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.problem import Problem
from stc.records import dataclass, field
from stc.symbolic.expr import Expr
from stc.transcription.derive import Group
from stc.transcription.grid import Grid
from stc.transcription.grouping import build_groups, number_rows
from stc.transcription.layout import Layout
from stc.transcription.lower import Expander, Lowering
from stc.transcription.recover import Recovery
from stc.transcription.statements import Sorter, Statements, highest_orders
from stc.transcription.steps import Steps

FloatArray = NDArray[np.float64]


@dataclass(slots=True)
class Stated:
    """The statements of a problem on the frames of its motion, from its text and structural constants."""

    problem: Problem
    grid: Grid
    layout: Layout
    steps: Steps
    lowering: Lowering
    statements: Statements
    _remembered: dict[str, Any] = field(default_factory=dict, repr=False, kw_only=True)

    def remembered(self, name: str, find: Callable[[Any], Any]) -> Any:
        """The result of ``find`` for this statement, cached."""
        if name not in self._remembered:
            self._remembered[name] = find(self)
        return self._remembered[name]

    @property
    def groups(self) -> list[Group]:
        """The rows and summands by their nodes; rows are numbered in the solver's order."""
        found: list[Group] = self.remembered("groups", _numbered_groups)
        return found

    @property
    def row_count(self) -> int:
        """The number of rows."""
        return sum(len(row.nodes) for row in self.statements.rows)

    def recovery(self, x: FloatArray, constants: Mapping[str, float] | None = None) -> Recovery:
        """Reads node values off a decision vector."""
        return Recovery(
            self.problem,
            self.grid,
            self.layout,
            self.steps,
            self.lowering,
            self.problem.constants if constants is None else constants,
            x,
        )


def _numbered_groups(stated: Stated) -> list[Group]:
    groups = build_groups(stated.statements)
    number_rows(groups)
    return groups


def state(problem: Problem) -> Stated:
    """State a problem on its frames.

    Raises:
        SpecError: a statement holds on no frame, or a step's form is not supported.
    """
    grid = Grid(problem)
    expand = Expander(problem, grid)
    steps = Steps(problem, grid, expand)
    bodies: list[Expr] = []
    stated = [(r.body, r.range) for r in problem.relations] + [(o.body, o.range) for o in problem.objective]
    for body, where in stated:
        bodies += [expanded for expanded, _ in expand(body, grid.nodes(where))]
    if problem.method == "central":
        orders = dict.fromkeys(problem.variables, 0)
    else:
        orders = highest_orders(problem, bodies)
    layout = Layout(problem, grid, orders)
    lowering = Lowering(problem, grid, layout, steps)
    return Stated(problem, grid, layout, steps, lowering, Sorter(problem, grid, lowering).run())
