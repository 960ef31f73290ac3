"""A model's equations of motion as numbers, for comparison with other equations.

The model is set up by the names of a ``replay:`` section, without a motion: joints by name, in the caller's order,
actuators and external forces by their lines.  With q the joints, v and a their first and second time derivatives, u the
controls and f the external forces, the model's equations are

    M(q) a + c(q, v) = Q(q, v, u, f)

where c contains gravity, springs, velocity products and damping, and Q the forces of actuators and external forces.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.dynamics import SmoothDynamics
from stc.validate.equalities import Equalities
from stc.validate.fields import set_fields
from stc.validate.forces import Attachments
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_control, load_model, names_of
from stc.validate.ties import find_joint

if TYPE_CHECKING:
    import mujoco


class ModelEquations:
    """The smooth equations of motion of a model, in the caller's order of joints.

    Attributes:
        joints: names of all k joints of the model.
        units: ``m`` or ``rad`` per joint.
        actuators: names of the driven actuators.
        outer: external forces as their lines are written: ``apply body.lamp.fx``.
        has_springs: whether static forces include those of springs.
        sliders: the joints and tendons with dry friction: ``joint elbow``, ``tendon rope``.
        dry: (s,) dry friction of each, N or N m.
        sliding: (s,) the direction in which each slides, 1 or -1; 0 (the initial value) ignores its dry friction; nan:
            the direction of the velocity.
        has_equalities: whether the model closes loops or gears joints to each other.
        notes: elements of the model that are not part of the equations of motion.
    """

    def __init__(
        self,
        path: Path,
        fields: Mapping[tuple[str, ...], float],
        joints: Sequence[str],
        actuators: Sequence[str],
        outer: Sequence[tuple[str, tuple[str, ...]]],
    ) -> None:
        """Compile a model and set its fields.

        Raises:
            ModelError: a name or path that the model does not have, a joint that is not named, or an actuator
                with a state of its own.
        """
        model = load_model(path)
        set_fields(model, fields)
        found = [find_joint(model, name) for name in joints]
        self.joints, self.units = list(joints), [unit for _, _, unit in found]
        self.actuators = list(actuators)
        loose = [name for name in names_of(model, "joint") if name not in self.joints]
        if len(found) != model.nv or model.nq != model.nv:
            which = f": {', '.join(loose)}" if loose else ""
            raise ModelError(f"the replay section does not tie every joint of {path.name}{which}")
        if model.na:
            raise ModelError(f"{path.name} has actuators with a state of their own: they answer with delay")
        self._position = np.array([p for p, _, _ in found], dtype=np.intp)
        self._velocity = np.array([v for _, v, _ in found], dtype=np.intp)
        self._address = np.array([find_control(model, name)[1] for name in self.actuators], dtype=np.intp)
        self._places = Attachments(model, outer)
        self.outer = self._places.names
        self.has_springs = bool(np.any(model.jnt_stiffness != 0.0))
        self._dry_joints = [j for j, v in enumerate(self._velocity) if model.dof_frictionloss[v] > 0.0]
        self._dry_tendons = np.flatnonzero(model.tendon_frictionloss > 0.0)
        self.sliders = [f"joint {self.joints[j]}" for j in self._dry_joints]
        self.sliders += [f"tendon {model.tendon(t).name or t}" for t in self._dry_tendons]
        losses = model.dof_frictionloss[self._velocity[self._dry_joints]]
        self.dry = np.concatenate([losses, model.tendon_frictionloss[self._dry_tendons]])
        self.sliding = np.zeros(len(self.dry))
        self.notes = _leftovers(model)
        self.has_equalities = bool(model.neq)
        self._equalities = Equalities(copy.copy(model))
        self._dynamics = SmoothDynamics(model)
        self._controls = np.zeros(model.nu)

    def _put(self, q: FloatArray, v: FloatArray) -> None:
        data = self._dynamics.data
        data.qpos[self._position] = q
        data.qvel[self._velocity] = v

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """The mass matrix M of the k joints at their positions q, (k, k)."""
        self._put(q, np.zeros(len(q)))
        return self._dynamics.mass_matrix()[np.ix_(self._velocity, self._velocity)]

    def bias(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """(k,) c, and dry friction as joints and tendons are sliding."""
        friction = self.friction(q, self.sliding, v)
        self._put(q, v)
        return self._dynamics.bias()[self._velocity] + friction

    def friction(self, q: FloatArray, sliding: FloatArray, v: FloatArray | None = None) -> FloatArray:
        """(k,) the contribution of dry friction to c if joints and tendons slide in these directions, (s,); nan: as at
        v, (k,).
        """
        if not sliding.any():
            return np.zeros(len(q))
        slides = self.slides(q)
        moving = np.zeros(len(sliding)) if v is None else np.sign(slides @ v)
        return np.asarray((self.dry * np.where(np.isnan(sliding), moving, sliding)) @ slides)

    def slides(self, q: FloatArray) -> FloatArray:
        """(s, k) the sliding speed of each joint and tendon with dry friction, per velocity of each joint."""
        import mujoco

        ways = np.zeros((len(self.dry), len(q)))
        ways[np.arange(len(self._dry_joints)), self._dry_joints] = 1.0
        dynamics = self._dynamics
        for j, unit in enumerate(np.eye(len(q)) if len(self._dry_tendons) else ()):
            self._put(q, unit)
            mujoco.mj_fwdPosition(dynamics.model, dynamics.data)
            mujoco.mj_fwdVelocity(dynamics.model, dynamics.data)
            # The velocity of a tendon is linear in those of the joints.
            ways[len(self._dry_joints) :, j] = dynamics.data.ten_velocity[self._dry_tendons]
        return ways

    def gravities(self, q: FloatArray) -> FloatArray:
        """(k, 3) the contribution of a gravity of 1 m/s^2 along each axis of the world to c."""
        gravity = self._dynamics.model.opt.gravity
        given, found = gravity.copy(), np.zeros((len(q), 3))
        gravity[:] = 0.0
        without = self.bias(q, np.zeros(len(q)))
        for axis in range(3):
            gravity[:] = np.eye(3)[axis]
            found[:, axis] = self.bias(q, np.zeros(len(q))) - without
        gravity[:] = given
        return found

    def force(self, q: FloatArray, v: FloatArray, u: FloatArray, f: FloatArray) -> FloatArray:
        """The generalised forces Q of actuators with controls u and of outer forces f, (k,)."""
        self._put(q, v)
        dynamics = self._dynamics
        self._controls[self._address] = u
        dynamics.data.qfrc_applied[:] = 0.0
        self._places.apply(dynamics.model, dynamics.data, f)
        return (dynamics.actuation(self._controls) + dynamics.data.qfrc_applied)[self._velocity]

    def held(self, q: FloatArray, force: FloatArray) -> FloatArray:
        """(k,) the part of a generalised force that loops and gears of the model can give."""
        position, whole = np.array(self._dynamics.model.qpos0), np.zeros(len(force))
        position[self._position] = q
        whole[self._velocity] = force
        return self._equalities.given(position, whole)[self._velocity]

    def inverse(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """(k,) ``mj_inverse``: the generalised force that the motion needs."""
        friction = self.friction(q, self.sliding, v)
        self._put(q, v)
        acceleration = np.zeros(len(a))
        acceleration[self._velocity] = a
        return self._dynamics.inverse(acceleration)[self._velocity] + friction


def _leftovers(model: mujoco.MjModel) -> list[str]:
    """Elements of the model that act besides its smooth equations of motion."""
    import mujoco

    notes = []
    limited = [
        name
        for name in names_of(model, "joint")
        if model.jnt_limited[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)]
    ]
    if limited:
        notes.append(f"the model's own joint limits are left out of the comparison: {', '.join(limited)}")
    return notes
