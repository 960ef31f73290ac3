"""Elements that flags under `option` of a model switch off are removed from it, so that no other module must check
them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco


def take_out(model: mujoco.MjModel) -> None:
    """Remove disabled limits, clamping of controls, dry friction and equality constraints from a compiled model, which
    MuJoCo simulates as before.
    """
    import mujoco

    flags, disabled = mujoco.mjtDisableBit, model.opt.disableflags

    def off(*bits: mujoco.mjtDisableBit) -> bool:
        return any(disabled & int(bit) for bit in bits)

    if off(flags.mjDSBL_LIMIT, flags.mjDSBL_CONSTRAINT):
        model.jnt_limited[:], model.tendon_limited[:] = 0, 0
    if off(flags.mjDSBL_FRICTIONLOSS, flags.mjDSBL_CONSTRAINT):
        model.dof_frictionloss[:], model.tendon_frictionloss[:] = 0.0, 0.0
    if off(flags.mjDSBL_EQUALITY, flags.mjDSBL_CONSTRAINT):
        model.eq_active0[:] = 0
    if off(flags.mjDSBL_CLAMPCTRL):
        model.actuator_ctrllimited[:] = 0
