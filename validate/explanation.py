"""The number of the model that explains a residual of the inverse dynamics.

If the solved forces do not produce the solved accelerations, often one number of the model differs from that in the
spec's equations.  Each number that can influence the residual is fitted alone, by the Gauss-Newton method, of which
one step is exact for masses, inertias, armatures, damping, stiffness, gear and gravity.  The axis of a joint is
exchanged for each axis of its frame.  A number that removes almost all of the residual is named, with its fitted value.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.records import dataclass
from stc.validate.dry_friction import DryFriction
from stc.validate.inverse import places_of
from stc.validate.metrics import FloatArray
from stc.validate.model import actuator_names, joint_names

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup

#: So many nodes are looked at: a number that is wrong shows at all of them.
_NODES = 16

#: A number explains the residual that leaves no more than this share of it.
_EXPLAINED = 1e-5

#: At most so many numbers are named where several explain it as well.
_NAMED = 3

#: Steps of Gauss and Newton's method, and what the numbers are changed by for its differences, of their size.
_STEPS, _CHANGE = 6, 1e-4

#: Numbers whose slopes leave more than this share of the residual have little to do with it.
_HOPELESS = 0.9

#: Numbers below this share of the size of their kind are nothing.
_NOTHING = 1e-9

#: Gets the array of a model that holds the numbers.
Array = Callable[["mujoco.MjModel"], FloatArray]


@dataclass(frozen=True, slots=True)
class _Numbers:
    """Numbers of a model that are fitted together.

    Attributes:
        title: their name in a ``set`` line of a spec, or in messages.
        array: the array of the model that holds them.
        at: their indices in it.
        size: the scale of a change.
        positive: whether they cannot be negative.
    """

    title: str
    array: Array
    at: tuple[Any, ...]
    size: float
    positive: bool = False

    def read(self, model: mujoco.MjModel) -> FloatArray:
        return np.array([np.ravel(self.array(model)[at])[0] for at in self.at], dtype=np.float64)

    def write(self, model: mujoco.MjModel, values: FloatArray) -> None:
        for at, value in zip(self.at, values):
            self.array(model)[at] = value

    def told(self, wanted: FloatArray, given: FloatArray) -> str:
        wanted = np.where(np.abs(wanted) > _NOTHING * self.size, wanted, 0.0)
        return f"{self.title} were {_text(wanted)} instead of {_text(given)}"


def explanation(setup: Setup) -> str:
    """The numbers of the model that explain the residual, in words; "" if none does or it cannot be determined."""
    if not setup.all_tied or not setup.reference.has_acceleration or setup.compiled.na or setup.compiled.neq:
        return ""
    residuals = _Residuals(setup)
    given = residuals.of(setup.compiled)
    size = float(np.linalg.norm(given))
    if not size > 0.0 or not np.isfinite(size):
        return ""
    single: list[tuple[float, str]] = []
    several: list[tuple[float, str]] = []
    for numbers in _candidates(setup.compiled):
        wanted, left = residuals.fitted(numbers, given)
        if left <= _EXPLAINED * size:
            told = numbers.told(wanted, numbers.read(setup.compiled))
            (single if len(numbers.at) == 1 else several).append((left, told))
    for title, model in _other_axes(setup.compiled):
        left = float(np.linalg.norm(residuals.of(model)))
        if left <= _EXPLAINED * size:
            single.append((left, title))
    best = [told for _, told in sorted(single or several)[:_NAMED]]
    return f"it would vanish if in the model {', or '.join(best)}" if best else ""


class _Residuals:
    """The residuals of a motion at some of its nodes, in models that differ in some numbers."""

    def __init__(self, setup: Setup) -> None:
        self._setup, self._outer = setup, setup.all_forces
        places = places_of(*(setup.solution.force_frames or (0, setup.solution.n)), setup.solution.method)
        places.sort(key=lambda place: place[1])
        chosen = np.unique(np.linspace(0, len(places) - 1, _NODES).astype(int))
        self._places = [places[k] for k in chosen]

    def of(self, model: mujoco.MjModel) -> FloatArray:
        """(nodes * nv,) the residuals in a model; infinite if MuJoCo cannot change it in this way."""
        import mujoco

        flags, setup = mujoco.mjtDisableBit, self._setup
        model = copy.copy(model)
        model.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_LIMIT)
        model.opt.disableflags |= int(flags.mjDSBL_FRICTIONLOSS)
        # Frames that coincide are not looked at one by one; where the mass matrix is stored so, they have to.
        model.body_sameframe[model.body_simple == 0] = 0
        data = mujoco.MjData(model)
        try:
            mujoco.mj_setConst(model, data)
        except mujoco.FatalError:
            return np.full(len(self._places) * model.nv, np.inf)
        mujoco.mj_resetData(model, data)
        found, dry = [], DryFriction(model)
        for part, index in self._places:
            setup.reference.put(data, setup.reference.at(part, index))
            data.ctrl[setup.controls.addresses] = setup.controls.at(part, index)
            self._outer.apply(model, data, self._outer.at(part, index))
            mujoco.mj_inverse(model, data)
            needed = data.qfrc_inverse.copy()
            mujoco.mj_fwdActuation(model, data)
            left = needed - data.qfrc_actuator - data.qfrc_applied
            found.append(dry.without(left, data.qvel, data.qacc))
        return np.concatenate(found)

    def fitted(self, numbers: _Numbers, given: FloatArray) -> tuple[FloatArray, float]:
        """The values that minimise the residual, and the remaining residual."""
        model = copy.copy(self._setup.compiled)
        values, residual = numbers.read(model), given
        left = float(np.linalg.norm(residual))
        for _ in range(_STEPS):
            slopes = []
            for k in range(len(values)):
                changed = values.copy()
                changed[k] += _CHANGE * numbers.size
                numbers.write(model, changed)
                slopes.append((self.of(model) - residual) / (_CHANGE * numbers.size))
            slope = np.array(slopes).T
            if not slope.any() or not np.all(np.isfinite(slope)):
                break
            way = -np.linalg.lstsq(slope, residual, rcond=None)[0]
            if np.linalg.norm(residual + slope @ way) > _HOPELESS * left:
                break
            new = values + way
            if numbers.positive and np.any(new < _NOTHING * numbers.size):
                break
            numbers.write(model, new)
            residual_there = self.of(model)
            left_there = float(np.linalg.norm(residual_there))
            if not left_there < 0.9 * left:
                break
            values, residual, left = new, residual_there, left_there
        return values, left


def _candidates(model: mujoco.MjModel) -> Iterator[_Numbers]:
    """Numbers of a model that can cause a residual, one by one, then inertias and gears together."""
    bodies = [model.body(body).name or f"body{body}" for body in range(model.nbody)]
    weight, length = float(model.body_mass.max()), float(model.stat.extent)
    inertia = float(model.body_inertia.max()) or weight * length**2
    for body, name in enumerate(bodies):
        if not body:
            continue
        for axis, letter in enumerate("xyz"):
            yield _Numbers(f"body.{name}.pos.{letter}", _array("body_pos"), ((body, axis),), length)
        if model.body_mass[body] > 0.0:
            yield _Numbers(f"body.{name}.mass", _array("body_mass"), (body,), weight, positive=True)
            for axis, letter in enumerate("xyz"):
                at = ((body, axis),)
                yield _Numbers(
                    f"body.{name}.inertia.{letter}", _array("body_inertia"), at, inertia, positive=True
                )
                yield _Numbers(f"body.{name}.com.{letter}", _array("body_ipos"), at, length)
            three = tuple((body, axis) for axis in range(3))
            yield _Numbers(f"body.{name}.inertia", _array("body_inertia"), three, inertia, positive=True)
            yield _Numbers(f"body.{name}.com", _array("body_ipos"), three, length)
    for joint, name in enumerate(joint_names(model)):
        first = int(model.jnt_dofadr[joint])
        dofs = np.flatnonzero(model.dof_jntid == joint)
        for field in ("damping", "armature", "frictionloss"):
            own = (slice(first, first + len(dofs)),)
            yield _Numbers(f"joint.{name}.{field}", _array(f"dof_{field}"), own, 1.0)
        yield _Numbers(f"joint.{name}.stiffness", _array("jnt_stiffness"), (joint,), 1.0)
        if dofs.size == 1:
            three = tuple((joint, axis) for axis in range(3))
            yield _Numbers(f"the axis of joint.{name}", _array("jnt_axis"), three, 1.0)
    for actuator, name in enumerate(actuator_names(model)):
        for parameter in ("gainprm", "biasprm"):
            for k in np.flatnonzero(getattr(model, f"actuator_{parameter}")[actuator]):
                title, at = f"actuator.{name}.{parameter}[{k}]", ((actuator, int(k)),)
                yield _Numbers(title, _array(f"actuator_{parameter}"), at, 1.0)
        gears = tuple((actuator, k) for k in range(3 if np.any(model.actuator_gear[actuator, 1:3]) else 1))
        yield _Numbers(f"actuator.{name}.gear", _array("actuator_gear"), gears, 1.0)
    for axis, letter in enumerate("xyz"):
        yield _Numbers(f"option.gravity.{letter}", lambda model: model.opt.gravity, (axis,), 1.0)


def _other_axes(model: mujoco.MjModel) -> Iterator[tuple[str, mujoco.MjModel]]:
    """For a joint whose axis is exchanged for another axis of its frame: its description, and the changed model."""
    import mujoco

    for joint, name in enumerate(joint_names(model)):
        if int(model.jnt_type[joint]) < int(mujoco.mjtJoint.mjJNT_SLIDE):
            continue
        for axis in (*np.eye(3), *-np.eye(3)):
            if not np.allclose(axis, model.jnt_axis[joint]):
                made = copy.copy(model)
                made.jnt_axis[joint] = axis
                yield (
                    f"the axis of joint.{name} were {_text(axis)} instead of {_text(model.jnt_axis[joint])}",
                    made,
                )


def _array(name: str) -> Array:
    return lambda model: np.asarray(getattr(model, name))


def _text(values: FloatArray) -> str:
    return " ".join(f"{float(value) + 0.0:.6g}" for value in np.atleast_1d(values))
