"""What actuators move: one joint directly, several through a tendon, or none, where they push against the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup


def joint_dof(model: mujoco.MjModel, actuator: int) -> int | None:
    """The degree of freedom of the one joint that an actuator acts on; None for all that acts elsewhere."""
    import mujoco

    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    if int(model.actuator_trntype[actuator]) not in kinds:
        return None
    return int(model.jnt_dofadr[model.actuator_trnid[actuator, 0]])


def driven_dofs(setup: Setup) -> set[int]:
    """The degrees of freedom that the spec's actuators move, where the motion starts.

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
