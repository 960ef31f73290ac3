"""The equalities of a model: closed loops, and joints that are geared to each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco


class Equalities:
    """The forces that the equalities of a model can give, for each position.

    All vectors are in the model's own order of coordinates.

    Args:
        model: the model with its constraints; its contacts are not used.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        self.model, self.data = model, mujoco.MjData(model)

    def given(self, position: FloatArray, force: FloatArray) -> FloatArray:
        """(nv,) the part of a generalised force that the equalities can give in this position."""
        directions = self.directions(position)
        if not directions.shape[1]:
            return np.zeros_like(force)
        return np.asarray(directions @ np.linalg.lstsq(directions, force, rcond=None)[0])

    def without(self, position: FloatArray, force: FloatArray) -> FloatArray:
        """(nv,) the part of a generalised force that the equalities cannot give in this position."""
        return force - self.given(position, force)

    def directions(self, position: FloatArray) -> FloatArray:
        """(nv, k) generalised force of a unit force along each equation."""
        import mujoco

        if not self.model.neq:
            return np.zeros((self.model.nv, 0))
        self.data.qpos[:] = position
        mujoco.mj_fwdPosition(self.model, self.data)
        rows = np.flatnonzero(self.data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
        return constraint_rows(self.model, self.data, rows).T


def constraint_rows(model: mujoco.MjModel, data: mujoco.MjData, rows: np.ndarray) -> FloatArray:
    """(k, nv) the generalised force of a unit force along each of some rows of the active constraints."""
    import mujoco

    found, unit = np.zeros((len(rows), model.nv)), np.zeros(data.nefc)
    for force, row in zip(found, rows, strict=True):
        unit[row] = 1.0
        mujoco.mj_mulJacTVec(model, data, force, unit)
        unit[row] = 0.0
    return found
