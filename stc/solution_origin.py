"""From a solution back to its problem: the text in the solution, the problem it states, a model to solve again."""

from __future__ import annotations

from typing import Any

from stc.arguments import numbers
from stc.pipeline import Model
from stc.solution import Solution
from stc.solution_restated import source_of


def model_of(solution: Solution) -> Model:
    """The model that solved a solution; for one from a file, a model from the text in the file.

    Raises:
        SpecError: the text is not a spec.
    """
    if solution.origin is None:
        solution.origin = Model(source_of(solution))
    model: Model = solution.origin
    return model


def resolve(solution: Solution, **changes: Any) -> Solution:
    """Solve a solution's spec again with other constants; see :meth:`stc.solution.Solution.resolve`."""
    constants = {**solution.overrides, **numbers(changes.pop("constants", None) or {})}
    changes = {"method": solution.method, "warm_start": solution, **changes}
    return model_of(solution).solve(constants=constants, **changes)
