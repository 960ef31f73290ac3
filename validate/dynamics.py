"""The model's smooth equations of motion, M(q) a + c(q, v) = forces, as arrays.

"Smooth" excludes the forces of MuJoCo's constraint solver: contacts, joint limits, dry friction, equalities.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.metrics import FloatArray

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

#: The change of a velocity, in m/s or rad/s, by which the effect of dampers is found.
_SLIGHTLY = 1e-3


class SmoothDynamics:
    """Evaluates the equations of motion of a model state by state.

    All vectors are in the model's own order of coordinates (``qpos``, ``qvel``).
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Use a model, with its constraints and the clamping of its actuators switched off."""
        import mujoco

        flags = mujoco.mjtDisableBit
        model.opt.disableflags |= int(flags.mjDSBL_CONSTRAINT) | int(flags.mjDSBL_CLAMPCTRL)
        model.actuator_forcelimited[:] = 0
        model.jnt_actfrclimited[:] = 0
        self.model, self.data = model, mujoco.MjData(model)

    def put(self, position: FloatArray, velocity: FloatArray | None = None) -> None:
        """Set the state; the velocity is zero unless it is given."""
        self.data.qpos[:] = position
        self.data.qvel[:] = 0.0 if velocity is None else velocity

    def mass_matrix(self) -> FloatArray:
        """(nv, nv) M in the present position."""
        import mujoco

        mujoco.mj_fwdPosition(self.model, self.data)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return full

    def bias(self) -> FloatArray:
        """(nv,) c in the present state: gravity, springs, velocity products, damping, with the sign of the left
        side.
        """
        import mujoco

        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        return np.asarray(self.data.qfrc_bias - self.data.qfrc_passive)

    def actuation(self, controls: FloatArray) -> FloatArray:
        """(nv,) generalised force of the actuators in the present state under all of the model's controls."""
        import mujoco

        self.data.ctrl[:] = controls
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        mujoco.mj_fwdActuation(self.model, self.data)
        return np.array(self.data.qfrc_actuator)

    def inverse(self, acceleration: FloatArray) -> FloatArray:
        """(nv,) ``mj_inverse``: the generalised force that this acceleration needs in the present state."""
        import mujoco

        self.data.qacc[:] = acceleration
        mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse)

    def decay(self) -> float:
        """The highest rate, 1/s, at which dampers and actuators slow the model in the present state, under its
        present controls; from differences of their forces, which are linear in the velocities or nearly so.
        """
        mass, speed = self.mass_matrix(), self.data.qvel.copy()
        forces = []
        for step in (np.zeros(len(speed)), *(_SLIGHTLY * np.eye(len(speed)))):
            self.data.qvel[:] = speed + step
            forces.append(self.actuation(self.data.ctrl.copy()) + self.data.qfrc_passive)
        slopes = np.transpose(forces[0] - np.array(forces[1:])) / _SLIGHTLY
        return float(np.linalg.eigvals(np.linalg.solve(mass, slopes)).real.max(initial=0.0))


def mass_matrices(setup: Setup, count: int) -> Iterator[FloatArray]:
    """(nv, nv) each: M at a number of frames of the solved motion, spread evenly."""
    dynamics = SmoothDynamics(setup.model())
    for frame in np.unique(np.linspace(0, setup.solution.n, count).astype(int)):
        setup.reference.put(dynamics.data, setup.reference.at("after", int(frame))[:2])
        yield dynamics.mass_matrix()
