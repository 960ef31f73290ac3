"""The joints that actuators move: one directly, several through a tendon, or none, if they push against the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup


def pulls(setup: Setup) -> FloatArray:
    """(m, nv) the generalised force of one unit of each control where the motion starts."""
    import mujoco

    model = setup.model(contacts=False)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    data = mujoco.MjData(model)
    setup.reference.put(data, setup.reference.at("after", 0)[:2])
    mujoco.mj_forward(model, data)
    idle, found = data.qfrc_actuator.copy(), np.zeros((len(setup.controls), model.nv))
    for k, address in enumerate(setup.controls.addresses):
        data.ctrl[:], data.act[:] = 0.0, 0.0
        data.ctrl[address] = 1.0
        # What answers with delay has the same force in the end.
        state, count = (
            int(a[setup.controls.actuators[k]]) for a in (model.actuator_actadr, model.actuator_actnum)
        )
        if state >= 0:
            data.act[state + count - 1] = 1.0
        mujoco.mj_forward(model, data)
        found[k] = data.qfrc_actuator - idle
    return found


def own_pull(setup: Setup) -> FloatArray:
    """(m, nv) the same for actuators whose direction does not depend on the pose; zeros for all others.

    These act on a joint along its own coordinates, or on several by a fixed tendon.
    """
    found, model = pulls(setup), setup.compiled
    for row, actuator in enumerate(setup.controls.actuators):
        if not _fixed(model, actuator):
            found[row] = 0.0
    return found


def _fixed(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether the direction of an actuator is the same in every pose."""
    import mujoco

    kinds, joints, kind = mujoco.mjtTrn, mujoco.mjtJoint, int(model.actuator_trntype[actuator])
    target = int(model.actuator_trnid[actuator, 0])
    if kind == int(kinds.mjTRN_JOINT):
        return True
    if kind == int(kinds.mjTRN_JOINTINPARENT):
        return int(model.jnt_type[target]) in (int(joints.mjJNT_SLIDE), int(joints.mjJNT_HINGE))
    if kind != int(kinds.mjTRN_TENDON):
        return False
    first, count = int(model.tendon_adr[target]), int(model.tendon_num[target])
    return bool(np.all(model.wrap_type[first : first + count] == int(mujoco.mjtWrap.mjWRAP_JOINT)))


def driven_dofs(setup: Setup) -> set[int]:
    """The degrees of freedom that the spec's actuators move at the start of the motion.

    A jet at a site and an adhering body push the model as a whole: no joint is theirs.
    """
    import mujoco

    model = setup.compiled
    site, body = int(mujoco.mjtTrn.mjTRN_SITE), int(mujoco.mjtTrn.mjTRN_BODY)
    own = [
        actuator
        for actuator in setup.controls.actuators
        if not (
            int(model.actuator_trntype[actuator]) == body
            or (int(model.actuator_trntype[actuator]) == site and int(model.actuator_trnid[actuator, 1]) < 0)
        )
    ]
    if not own:
        return set()
    data = mujoco.MjData(model)
    setup.reference.put(data, setup.reference.at("after", 0)[:2])
    mujoco.mj_fwdPosition(model, data)
    arms = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        arms, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    return {int(dof) for dof in np.flatnonzero(np.any(arms[own] != 0.0, axis=0))}
