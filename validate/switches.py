"""What the flags under `option` of a model switch off is taken out of it, so that nobody else has to look."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco


def take_out(model: mujoco.MjModel) -> None:
    """Take limits, the clamping of controls, dry friction and equality constraints that are switched off out of a
    compiled model: MuJoCo simulates it as before.
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
