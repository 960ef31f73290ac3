"""The values of a problem's symbols along a solution, at which its expressions are evaluated."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.problem import ConstantRef, IndexRef, ParameterRef, TimeRef, VariableRef
from stc.solution import Solution


def fixed_values(solution: Solution) -> dict[object, Any]:
    """The value of every symbol that does not change along a motion."""
    values: dict[object, Any] = {ConstantRef(k): v for k, v in solution.constants.items()}
    values.update({ParameterRef(k): v for k, v in solution.parameters.items()})
    return values


def values_at(solution: Solution, index: NDArray[np.float64]) -> dict[object, Any]:
    """The value of every symbol at points between the nodes, given by their fractional frame indices."""
    found = fixed_values(solution)
    motion = solution.at_frame(index)
    for name, order in solution.trajectories:
        found[VariableRef(name, order)] = motion[name + "'" * order]
    whole = index.astype(int)
    found[TimeRef()] = solution.time[whole] + (index - whole) * np.diff(solution.time)[whole]
    found[IndexRef()] = index
    return found
