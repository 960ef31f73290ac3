"""Welds to mocap bodies that hold a body where it is at the first frame.

MuJoCo leaves a mocap body where the file has it until a program moves it, mostly to where the body is that is welded to
it.  Here the weld gets the relative pose of both in place of that, so that no simulation has to be told.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

#: Where a weld has, among its numbers, the relative pose, and whether MuJoCo derives that from the model's own pose.
_POSE, _DERIVED = slice(3, 10), 11


def weld_where_it_begins(setup: Setup) -> None:
    """Give all welds to mocap bodies the relative pose of the first frame."""
    import mujoco

    model = setup.compiled
    data = mujoco.MjData(model)
    setup.put(data, "after", 0)
    mujoco.mj_kinematics(model, data)
    for index in np.flatnonzero(_to_mocap(model)):
        first, second = model.eq_obj1id[index], model.eq_obj2id[index]
        anchor = model.eq_data[index, :3].copy()
        place, inverse, relative = (np.zeros(size) for size in (3, 4, 4))
        mujoco.mju_negQuat(inverse, data.xquat[first])
        mujoco.mju_mulQuat(relative, inverse, data.xquat[second])
        at = data.xpos[second] + data.xmat[second].reshape(3, 3) @ anchor - data.xpos[first]
        mujoco.mju_rotVecQuat(place, at, inverse)
        model.eq_data[index, _POSE] = [*place, *relative]
        model.eq_data[index, _DERIVED] = 0.0


def _to_mocap(model: mujoco.MjModel) -> np.ndarray:
    """(neq,) whether an equality constraint is a weld of a body to a mocap body."""
    import mujoco

    welds = (model.eq_type == mujoco.mjtEq.mjEQ_WELD) & (model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY)
    ends = np.array([model.eq_obj1id, model.eq_obj2id])
    return np.asarray(welds & (model.body_mocapid[np.where(welds, ends, 0)] >= 0).any(axis=0))
