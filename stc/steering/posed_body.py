"""A body in a pose: where its parts are, how they move with its joints, and the pose in which a part is elsewhere."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from stc.records import dataclass

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

#: Iterations of a reach, and how far each goes at most, in m.
_ITERATIONS, _STRIDE = 12, 0.15

#: Places that are to stay may be off by this, in m; less than the language allows a contact to be off its surface.
_STAYS = 2e-4

#: What turning a joint by 1 rad costs beside a distance of 1 m that is left: little, so that places are reached.
_COST = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A point of a body.

    Attributes:
        body: its index.
        local: (3,) m, in the body's frame.
        flat: whether the body may not turn there either, as the sole of a foot that stands.
    """

    body: int
    local: FloatArray
    flat: bool = False

    def point(self, data: mujoco.MjData) -> FloatArray:
        """(3,) the position of the point in the world, in m."""
        found: FloatArray = data.xpos[self.body] + data.xmat[self.body].reshape(3, 3) @ self.local
        return found


def moving_bodies(model: mujoco.MjModel) -> list[int]:
    """The bodies that move on their own: those that are welded to others, or to the world, are left out."""
    return [b for b in range(1, model.nbody) if model.body_weldid[b] == b]


_kept = threading.local()


def state_of(model: mujoco.MjModel) -> mujoco.MjData:
    """MuJoCo's state of a model, for positions alone.

    Each thread keeps one, since making one takes longer than anything that is computed with it here.
    """
    import mujoco

    found: mujoco.MjData | None = getattr(_kept, "state", None)
    if found is None or found.model is not model:
        found = _kept.state = mujoco.MjData(model)
    return found


class PosedBody:
    """A model in a pose that may be changed: one at a time in each thread, for the next one has the same state.

    Attributes:
        data: MuJoCo's state, of which only positions are used.
    """

    def __init__(self, model: mujoco.MjModel, qpos: FloatArray) -> None:
        self.model, self.data = model, state_of(model)
        self.put(qpos)

    def put(self, qpos: FloatArray) -> None:
        """Take a pose, (nq,)."""
        import mujoco

        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    @property
    def qpos(self) -> FloatArray:
        """(nq,) the pose."""
        return np.array(self.data.qpos)

    def middle(self, body: int) -> Place:
        """The centre of mass of a body."""
        return Place(body, np.array(self.model.body_ipos[body]))

    def reached(
        self, place: Place, target: FloatArray, dofs: Sequence[int], staying: Sequence[Place]
    ) -> FloatArray:
        """(nq,) the pose nearest to this one in which a point is at a target, or as near as it gets.

        Each step is the shortest change of the joints that lessens the distance while the points that stay do so: least
        squares in the null space of what is held, damped (Buss, Introduction to inverse kinematics, 2009).

        Args:
            place: the point.
            target: (3,) m.
            dofs: the degrees of freedom that may move.
            staying: points that stay where they are.
        """
        import mujoco

        start = self.qpos
        held = [(one, one.point(self.data), np.array(self.data.xmat[one.body])) for one in staying]
        best, least = start, float(np.linalg.norm(target - place.point(self.data)))
        free = list(dofs)
        for _ in range(_ITERATIONS):
            jacobian = self._jacobian(place)[:3, free]
            fixed, gap = self._held(held, free)
            basis = _null_space(fixed)
            way = -np.linalg.pinv(fixed, rcond=1e-6) @ gap if len(fixed) else np.zeros(len(free))
            error = target - place.point(self.data) - jacobian @ way
            length = float(np.linalg.norm(error))
            error *= min(1.0, _STRIDE / max(length, 1e-12))
            if basis.shape[1]:
                reduced = jacobian @ basis
                system = np.vstack([reduced, _COST * np.eye(basis.shape[1])])
                way = (
                    way
                    + basis
                    @ np.linalg.lstsq(system, np.concatenate([error, np.zeros(basis.shape[1])]), rcond=None)[
                        0
                    ]
                )
            full = np.zeros(self.model.nv)
            full[free] = way
            moved = self.qpos
            mujoco.mj_integratePos(self.model, moved, full, 1.0)
            at_end = self._limit(moved, free)
            self.put(moved)
            left = float(np.linalg.norm(target - place.point(self.data)))
            worst = max(
                (float(np.linalg.norm(one.point(self.data) - at)) for one, at, _ in held), default=0.0
            )
            if worst < _STAYS and left < least - 1e-9:
                best, least = self.qpos, left
            if worst < 1e-7 and (left < 1e-6 or float(np.abs(way).max(initial=0.0)) < 1e-7):
                break
            free = [dof for dof in free if dof not in at_end] or free
        self.put(start)
        return best

    def _jacobian(self, place: Place) -> FloatArray:
        """(6, nv) velocity of a point and of its body's turning, by velocities of the joints."""
        import mujoco

        moving, turning = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, moving, turning, place.point(self.data), place.body)
        return np.vstack([moving, turning])

    def _held(
        self, held: Sequence[tuple[Place, FloatArray, FloatArray]], free: Sequence[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Rows (r, k) of what stays by the free joints, and how far it is off, (r,)."""
        rows, gaps = [np.zeros((0, len(free)))], [np.zeros(0)]
        for one, at, frame in held:
            jacobian = self._jacobian(one)[:, free]
            rows.append(jacobian if one.flat else jacobian[:3])
            gaps.append(one.point(self.data) - at)
            if one.flat:
                gaps.append(0.5 * _turn(frame.reshape(3, 3), self.data.xmat[one.body].reshape(3, 3)))
        return np.vstack(rows), np.concatenate(gaps)

    def _limit(self, qpos: FloatArray, free: Sequence[int]) -> set[int]:
        """Keep hinges and slides within their ranges, in place; the degrees of freedom that were beyond."""
        found = set()
        for dof in free:
            joint = int(self.model.dof_jntid[dof])
            if self.model.jnt_limited[joint] and self.model.jnt_type[joint] >= 2:  # slide or hinge
                address = int(self.model.jnt_qposadr[joint])
                low, high = self.model.jnt_range[joint]
                inside = float(np.clip(qpos[address], low, high))
                if inside != qpos[address]:
                    qpos[address] = inside
                    found.add(dof)
        return found


def _null_space(rows: FloatArray) -> FloatArray:
    """(k, m) an orthonormal basis of what rows (r, k) do not see."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, values, right = np.linalg.svd(rows)
    rank = int(np.sum(values > 1e-6 * max(1.0, float(values.max(initial=0.0)))))
    return right[rank:].T


def _turn(start: FloatArray, end: FloatArray) -> FloatArray:
    """(3,) twice the sine of half the small turn between two frames, along its axis."""
    total = np.zeros(3)
    for axis in range(3):
        total += np.cross(start[:, axis], end[:, axis])
    return total
