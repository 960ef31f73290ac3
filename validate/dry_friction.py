"""Dry friction of joints by MuJoCo's law: Coulomb's law, except where a joint hardly moves.

MuJoCo's dry friction is a soft constraint.  With the bound F, the force at a velocity v and an acceleration a is
-F clip((a + b v)/(F R), -1, 1), where the damping b and the softness R follow from ``solreffriction``,
``solimpfriction`` and the joint's inertia (MuJoCo's documentation, "Computation: the constraint model").  It therefore
has its full value as soon as a joint moves visibly.  A motion may state either law, MuJoCo's with rounded corners.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.limits import FRICTION_MISSING
from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco

#: A joint that is slower (m/s or rad/s) is at rest for its dry friction.
AT_REST = 1e-9

#: From so many times the least pull at which it has its bound on, friction has no more room than rounded corners leave.
_AT_BOUND = 2.0
#: The share of its bound that friction may miss there, times the square of that pull: twice what corners leave that are
#: hyperbolas through 0.3 of the bound's pull, (sqrt((p + 1)^2 + 0.09) - sqrt((p - 1)^2 + 0.09))/2 = 1 - 0.045/p^2 + ...
_ROUNDED = 0.09


class DryFriction:
    """The dry friction of a model's joints.

    Parameters
    ----------
    model
        The compiled model.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        import mujoco

        self.loss = np.array(model.dof_frictionloss)
        lowest, highest = mujoco.mjMINIMP, mujoco.mjMAXIMP
        least, most = np.clip(np.array(model.dof_solimp)[:, :2].T, lowest, highest)
        time, ratio = np.array(model.dof_solref).T
        shortest = 0.0
        if not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_REFSAFE):
            shortest = 2.0 * model.opt.timestep
        standard = time > 0.0
        #: (nv,) 1/s.
        self.damping = np.where(
            standard, 2.0 / (most * np.where(standard, np.maximum(time, shortest), 1.0)), -ratio / most
        )
        #: (nv,) the acceleration of a joint at rest, in m/s^2 or rad/s^2, at which its friction has its bound.
        self.bound = np.maximum(mujoco.mjMINVAL, self.loss * (1.0 - least) / least * model.dof_invweight0)

    def force(self, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
        """(nv,) MuJoCo's own friction at velocities and accelerations (nv,)."""
        return np.asarray(-self.loss * np.clip(self._pull(velocity, acceleration), -1.0, 1.0))

    def _pull(self, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
        return np.asarray((acceleration + self.damping * velocity) / self.bound)

    def missing(self, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
        """(nv,) the share of its bound that friction may miss: all of it at rest, and where the two laws differ."""
        pull = self._pull(velocity, acceleration)
        loose = (np.abs(velocity) <= AT_REST) | (np.abs(pull) < _AT_BOUND) | (pull * velocity < 0.0)
        rounded = np.minimum(FRICTION_MISSING, _ROUNDED / np.maximum(np.abs(pull), _AT_BOUND) ** 2)
        return np.where(loose, 1.0, rounded)

    def without(
        self,
        force: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        passed: FloatArray | None = None,
    ) -> FloatArray:
        """(nv,) the part of generalised forces that dry friction cannot explain.

        Where all of the bound may be missing, friction is anything within it; elsewhere it is the bound against the
        motion, up to the share that may be missing.

        Args:
            passed: (nv, nv) what equalities leave of a unit force on each degree of freedom, of which ``force`` is
                made as well; None without equalities.
        """
        missing = self.missing(velocity, acceleration)
        full = -self.loss * np.sign(velocity)
        nearly = (1.0 - missing) * full
        loose = missing == 1.0
        low = np.where(loose, -self.loss, np.minimum(full, nearly))
        high = np.where(loose, self.loss, np.maximum(full, nearly))
        rough = self.loss > 0.0
        if passed is None or not rough.any():
            return np.asarray(force - np.clip(force, low, high))
        from scipy.optimize import lsq_linear

        found = lsq_linear(passed[:, rough], force, (low[rough], high[rough]), method="bvls", tol=1e-20)
        return np.asarray(force - passed[:, rough] @ found.x)
