"""The curvature of rows: whether they are convex functions of the variables, concave ones, or neither."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from stc.problem import ParameterRef, VariableRef
from stc.symbolic.differentiate import hessian
from stc.symbolic.structure import LINEAR, QUADRATIC, mentions
from stc.transcription.assemble import Program
from stc.transcription.derive import Group
from stc.transcription.numbers import Numbers

#: Eigenvalues this small, relative to the largest, are rounding errors.
ROUNDING: Final = 1e-12


def row_bends(program: Program, numbers: Numbers) -> NDArray[np.int8]:
    """1 for each row that is convex, -1 for each that is concave, 0 for rows that are neither or unknown. (m,)

    (m,).  Of rows that are not linear, quadratic ones are known, for the given numbers: by the eigenvalues of their
    second derivatives, which are constants.
    """
    bends = np.zeros(program.row_count, np.int8)
    bends[program.row_linear] = 1
    for group in program.groups:
        for row, degree in enumerate(group.programs.degrees):
            if LINEAR < degree <= QUADRATIC and group.size:
                bends[group.row_ids[row]] = _bends(group, row, numbers)
    return bends


def _bends(group: Group, row: int, numbers: Numbers) -> NDArray[np.int8]:
    """(nodes,) for one row at each node of its group: 1 if it is convex, -1 if it is concave, 0 if neither is known."""
    entries = hessian(group.rows[row].body, group.unknown)
    if any(mentions(e, lambda key: isinstance(key, VariableRef | ParameterRef)) for e in entries.values()):
        return np.zeros(group.size, np.int8)
    place = {unknown: k for k, unknown in enumerate(sorted({k for pair in entries for k in pair}))}
    matrices = np.zeros((group.size, len(place), len(place)))
    for (a, b), e in entries.items():
        matrices[:, place[a], place[b]] = matrices[:, place[b], place[a]] = numbers.at(e, group.nodes)
    if not np.isfinite(matrices).all():
        return np.zeros(group.size, np.int8)
    eigenvalues = np.linalg.eigvalsh(matrices)
    tiny = ROUNDING * np.abs(eigenvalues).max(axis=1, initial=0.0)
    convex = eigenvalues.min(axis=1, initial=0.0) >= -tiny
    concave = eigenvalues.max(axis=1, initial=0.0) <= tiny
    return np.where(convex, 1, np.where(concave, -1, 0)).astype(np.int8)
