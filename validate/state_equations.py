"""A model's equations of motion at any state, with any joints: their residual, and each force.

:class:`stc.validate.model_equations.ModelEquations` has a coordinate for each degree of freedom; this module uses
positions, velocities and accelerations in MuJoCo's own order, and thus supports free and ball joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.dynamics import SmoothDynamics
from stc.validate.fields import set_fields
from stc.validate.forces import Attachments
from stc.validate.metrics import FloatArray
from stc.validate.model import find_activation, find_control, joint_names, load_model
from stc.validate.ties import PLACE, QUATERNION, TURNING, joint_dof, joint_part, parts_of

if TYPE_CHECKING:
    import mujoco


@dataclass(slots=True)
class ModelState:
    """A state in MuJoCo's order: position (nq,), velocity and acceleration (nv,), controls (nu,), activations (na,),
    and the external forces in the order of their lines.
    """

    q: FloatArray
    v: FloatArray
    a: FloatArray
    u: FloatArray
    z: FloatArray
    f: FloatArray


class StateEquations:
    """The smooth equations of motion of a model at states in its own order.

    Attributes:
        dofs: names of the degrees of freedom: ``hip``, ``root.x``, ``root.wx``.
        outer: outer forces as their lines are written.
        notes: elements of the model that are not part of the equations of motion.
    """

    def __init__(
        self,
        path: Path,
        fields: Mapping[tuple[str, ...], float],
        outer: Sequence[tuple[str, tuple[str, ...]]],
        additions: Sequence[str] = (),
    ) -> None:
        """Compile a model and set its fields.

        Raises:
            ModelError: a path that the model does not have.
        """
        model = load_model(path, additions)
        set_fields(model, fields)
        self.model = model
        self.notes = _leftovers(model)
        self._places = Attachments(model, outer)
        self.outer = self._places.names
        self.dofs = [name for joint in range(model.njnt) for name in _dofs(model, joint)]
        self._dynamics = SmoothDynamics(model)
        self.orientations = [
            int(model.jnt_qposadr[joint]) + len([p for p in parts_of(model, joint) if p in PLACE])
            for joint in range(model.njnt)
            if QUATERNION[0] in parts_of(model, joint)
        ]

    def joint(self, path: tuple[str, ...]) -> tuple[int | None, int | None]:
        """The indices in ``qpos`` and ``qvel`` of the element that a joint line names; None if it is not in one of
        them.

        Raises:
            ModelError: there is no such joint, or it has no such part.
        """
        model = self.model
        joint, part = joint_part(model, path)
        positions = [one for one in parts_of(model, joint) if one not in TURNING]
        at = int(model.jnt_qposadr[joint]) + positions.index(part) if part in positions else None
        return at, joint_dof(model, joint, part)

    def actuator(self, name: str) -> tuple[int | None, int | None]:
        """The index in ``ctrl`` or ``act`` of the element that an actuator line names.

        Raises:
            ModelError: there is no such actuator.
        """
        state = find_activation(self.model, name)
        return (find_control(self.model, name)[1], None) if state is None else (None, state)

    def left(self, state: ModelState) -> tuple[FloatArray, float]:
        """(nv,) the required force minus the given force, and the largest part of either."""
        dynamics = self._dynamics
        dynamics.put(state.q, state.v)
        dynamics.data.act[:] = state.z
        dynamics.data.qfrc_applied[:] = 0.0
        self._places.apply(dynamics.model, dynamics.data, state.f)
        applied = dynamics.data.qfrc_applied.copy()
        given = dynamics.actuation(state.u)
        needed = dynamics.inverse(state.a)
        size = max(
            float(np.abs(part).max(initial=0.0)) for part in (needed, given, applied, dynamics.data.qfrc_bias)
        )
        return needed - given - applied, size


def _dofs(model: mujoco.MjModel, joint: int) -> list[str]:
    name = joint_names(model)[joint]
    parts = [part for part in parts_of(model, joint) if part not in QUATERNION]
    return [f"{name}.{part}" if part else name for part in parts]


def _leftovers(model: mujoco.MjModel) -> list[str]:
    """Elements of the model that act besides its smooth equations of motion."""
    left = {
        "joint limits": model.jnt_limited,
        "limits of tendons": model.tendon_limited,
        "dry friction": np.concatenate([model.dof_frictionloss, model.tendon_frictionloss]),
        "equality constraints": model.eq_active0,
    }
    found = [what for what, of_each in left.items() if np.any(of_each)]
    return [f"left out of the comparison: {', '.join(found)}"] if found else []
