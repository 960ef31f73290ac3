"""Poses that the model does not allow: joints beyond the ends of their ranges, equalities that the solved joints
violate.

Neither shows in the inverse dynamics, which ignores the forces of joint limits and equalities.  MuJoCo's own limits and
equalities are compliant springs, so that a replay can come close to a pose that the mechanism does not have.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate import limits
from stc.validate.equalities import constraint_rows
from stc.validate.metrics import FloatArray, Metric

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup
    from stc.validate.ties import Tie

#: Of each step of the second-order methods the position is off by this times the step's square and what the
#: acceleration changes by in it.
_TRUNCATION = 1.0 / 12.0

#: A joint that is within this share of its range from an end is at it.
_RESTS = 1e-6

#: A row of an equality that moves an untied coordinate by less than this depends on the tied ones alone.
_NOTHING = 1e-12


def beyond_range(setup: Setup, tie: Tie) -> tuple[float, float, float] | None:
    """The largest distance of a joint beyond its range at the nodes, with its value and that end of the range.

    Returns:
        The distance, 0 or less within the range, the joint's value and the range's end, in m or rad; None where the
        model has no such limit.
    """
    import mujoco

    model = setup.compiled
    if not model.jnt_limited[tie.joint] or model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_LIMIT):
        return None
    return tie.beyond(*(float(bound) for bound in model.jnt_range[tie.joint]))


def limit_metrics(setup: Setup) -> list[Metric]:
    """The distance of each tied joint beyond its range at the nodes; for information if a line states the force of its
    stop.
    """
    # A stop that yields lets the joint go as far as its force, which the spec states, takes.
    stated = _stops_stated(setup)
    found = []
    for tie in setup.ties:
        beyond = beyond_range(setup, tie)
        if beyond is not None:
            limit = None if tie.joint in stated else _allowed(setup, tie)
            beyond_by = max(beyond[0], 0.0)
            found.append(Metric("joint beyond its range", f"joint {tie.name}", beyond_by, tie.unit, limit))
    return found


def _stops_stated(setup: Setup) -> set[int]:
    """The joints on which a line of the replay states a force."""
    dofs = [dof for dof in (*setup.applied.where.dofs, *setup.contact.where.dofs) if dof >= 0]
    return {int(setup.compiled.dof_jntid[dof]) for dof in dofs}


def limit_notes(setup: Setup) -> list[str]:
    """A note on joints that rest at an end of their range, if the motion has no force of their stop."""
    stated, resting = _stops_stated(setup), []
    for tie in setup.ties:
        if tie.joint in stated or beyond_range(setup, tie) is None:
            continue
        lower, upper = (float(bound) for bound in setup.compiled.jnt_range[tie.joint])
        channel = tie.channels(0)[0]
        at_end = [
            np.abs(values - end) <= _RESTS * (upper - lower)
            for values in (channel.after[:-1], channel.before[1:])
            for end in (lower, upper)
        ]
        if (at_end[0] & at_end[2]).any() or (at_end[1] & at_end[3]).any():
            resting.append(tie.name)
    if not resting:
        return []
    return [
        f"at an end of their range for a step or more: {', '.join(resting)}. A range is a bound of the motion and "
        "gives no force; what a stop gives is stated with a `contact` line on the joint"
    ]


def _allowed(setup: Setup, tie: Tie) -> float:
    """The allowed distance of a joint beyond its range: rounding of a stated bound, the solver's and the method's
    error.
    """
    solution = setup.solution
    left = limits.BEYOND_RANGE + limits.left_by_solver(solution.violation)
    if solution.method == "hermite-simpson" or not tie.knows_acceleration or not solution.n:
        return left
    changes = max(np.ptp([channel.before, channel.after]) for channel in tie.channels(2))
    error = _TRUNCATION * float(np.diff(solution.time).max()) ** 2 * float(changes)
    return left + min(error, limits.OPEN_LOOP_DRIFT[solution.method])


def equality_metrics(setup: Setup) -> list[Metric]:
    """The violation of each equality of the model at the frames, if the spec determines the pose that it constrains."""
    import mujoco

    model = setup.model(contacts=False)
    if not model.neq:
        return []
    data = mujoco.MjData(model)
    loose = np.setdiff1d(np.arange(model.nv), setup.reference.velocities)
    # Where constraints act on untied joints that move, the motion that they are given is a guess.
    unknown = loose if setup.untied is None else setup.untied.free
    worst: dict[tuple[int, str], float] = {}
    hidden: set[int] = set()
    for frame in range(setup.solution.n + 1):
        part = "after" if frame < setup.solution.n else "before"
        if setup.untied is not None:
            setup.untied.put(data, setup.untied.at(part, frame))
        setup.reference.put(data, setup.reference.at(part, frame)[:2])
        mujoco.mj_fwdPosition(model, data)
        for index, rows in equality_rows(data).items():
            if len(unknown) and _moves(model, data, rows, unknown):
                hidden.add(index)
            for unit, value in _broken(model, index, data.efc_pos[rows]):
                worst[index, unit] = max(worst.get((index, unit), 0.0), value)
    method = setup.solution.method
    limit = limits.of_extent(
        limits.OPEN_LOOP_DRIFT[method],
        limits.DRIFT_SHARE[method],
        setup.reference.extent,
        limits.DRIFT_FLOOR[method],
    )
    return [
        Metric("equality broken in the solved pose", equality_title(model, index), value, unit, limit)
        for (index, unit), value in worst.items()
        if index not in hidden
    ]


def equality_rows(data: mujoco.MjData) -> dict[int, np.ndarray]:
    """The rows of each active equality among the constraints."""
    import mujoco

    rows = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
    return {int(index): rows[data.efc_id[rows] == index] for index in np.unique(data.efc_id[rows])}


def _moves(model: mujoco.MjModel, data: mujoco.MjData, rows: np.ndarray, dofs: np.ndarray) -> bool:
    """Whether rows of the constraints depend on some coordinates."""
    return bool(np.abs(constraint_rows(model, data, rows)[:, dofs]).max(initial=0.0) > _NOTHING)


def _broken(model: mujoco.MjModel, index: int, gaps: FloatArray) -> list[tuple[str, float]]:
    """Units and sizes of the violations of an equality, from its rows."""
    import mujoco

    kinds = mujoco.mjtEq
    kind = int(model.eq_type[index])
    if kind == int(kinds.mjEQ_WELD):
        # The axis of the rotation times the sine of half its angle, weighted.
        weight = float(model.eq_data[index, 10]) or 1.0
        sine = min(float(np.linalg.norm(gaps[3:])) / weight, 1.0)
        return [("m", float(np.linalg.norm(gaps[:3]))), ("rad", 2.0 * float(np.arcsin(sine)))]
    if kind == int(kinds.mjEQ_JOINT):
        hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
        unit = "rad" if int(model.jnt_type[model.eq_obj1id[index]]) == hinge else "m"
        return [(unit, float(np.abs(gaps).max()))]
    return [("m", float(np.linalg.norm(gaps)))]


def equality_title(model: mujoco.MjModel, index: int) -> str:
    """The name of an equality, or the names of the elements that it connects."""
    import mujoco

    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, index)
    if name:
        return f"equality {name}"
    kinds, objects = mujoco.mjtEq, mujoco.mjtObj
    joins = {int(kinds.mjEQ_JOINT): objects.mjOBJ_JOINT, int(kinds.mjEQ_TENDON): objects.mjOBJ_TENDON}
    kind = joins.get(int(model.eq_type[index]), int(model.eq_objtype[index]))
    ends = [
        mujoco.mj_id2name(model, kind, int(end)) or f"number {int(end)}"
        for end in (model.eq_obj1id[index], model.eq_obj2id[index])
        if end >= 0
    ]
    return f"equality {index} ({' and '.join(ends)})"
