"""The inputs of the model: the controls of its actuators, and external forces.

``actuator NAME = e``
    the control of an actuator; ``actuator NAME.pos = e`` (``.vel``, ``.ff``, ``.voltage``) of one that takes several.
``actuator NAME.activation = e``
    its state, of which the replay takes the start alone; ``.activation1``, ... where it has several.
``apply joint.NAME = e``, ``apply body.NAME.fx = e``, ``apply site.NAME.my = e`` (...)
    a force that acts whatever the model itself supplies: a generalised force on a joint (on a free joint's ``.x``,
    ``.y``, ``.z``, ``.wx``, ``.wy`` or ``.wz``); a force (``fx``, ``fy``, ``fz``, in N, along the world's axes) at a
    place of the model (:mod:`stc.validate.places`), or a torque (``mx``, ``my``, ``mz``, in N m) on its body.
``contact body.NAME.fx = e`` (...)
    the same, for a force that the ground gives.  Where the model has its own contacts, they supply it; the
    solved one acts where those are switched off, as in the inverse dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.solution import Solution
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_activation, find_control, lines_of
from stc.validate.places import Place, find_place, require_kind
from stc.validate.signals import Signals
from stc.validate.ties import joint_dof, joint_part

if TYPE_CHECKING:
    import mujoco

#: Of a force and a torque.
_PARTS = ("fx", "fy", "fz", "mx", "my", "mz")


class Controls(Signals):
    """Control signals of a replay.

    Attributes:
        names: of the controls: those of the driven actuators.
        actuators: indices in the model, of the actuator of each control.
        addresses: (k,) index in MuJoCo's ``ctrl`` of each driven actuator.
    """

    def __init__(self, model: mujoco.MjModel, solution: Solution) -> None:
        """Tie the spec's ``actuator`` lines to the model.

        Raises:
            ModelError: an unknown actuator, or one of several controls that is not named.
        """
        lines = [line for line in lines_of(solution, "actuator") if find_activation(model, line.name) is None]
        super().__init__(solution, lines)
        self.names = [line.name for line in self.lines]
        found = [find_control(model, name) for name in self.names]
        self.actuators = [actuator for actuator, _ in found]
        self.addresses = np.array([address for _, address in found], dtype=np.intp)

    def beyond_range(self, model: mujoco.MjModel) -> list[str]:
        """Names of the actuators whose control leaves the range to which the model clamps it."""
        found = []
        for name, address, channel in zip(self.names, self.addresses, self.channels):
            if model.actuator_ctrllimited[address]:
                lower, upper = model.actuator_ctrlrange[address]
                values = np.concatenate([channel.before, channel.after])
                slack = 1e-9 * max(1.0, abs(lower), abs(upper))
                if values.min() < lower - slack or values.max() > upper + slack:
                    found.append(name)
        return found


class Activations(Signals):
    """States of actuators from ``actuator NAME.activation`` lines; a replay starts with them.

    Attributes:
        addresses: (k,) index in MuJoCo's ``act`` of each.
    """

    def __init__(self, model: mujoco.MjModel, solution: Solution) -> None:
        """Tie the spec's lines to the model."""
        found = [(line, find_activation(model, line.name)) for line in lines_of(solution, "actuator")]
        super().__init__(solution, [line for line, address in found if address is not None])
        self.addresses = np.array([address for _, address in found if address is not None], dtype=np.intp)


class Attachments:
    """The places at which external forces act on a model, and their generalised forces.

    Attributes:
        names: the lines as they are written.
        places: the place of each line; None for lines on joints.
        parts: the component of each line with a place: an index in fx, fy, fz, mx, my, mz.
        dofs: the degree of freedom of each line on a joint; -1 for all others.
    """

    def __init__(self, model: mujoco.MjModel, lines: Sequence[tuple[str, tuple[str, ...]]]) -> None:
        """Find the places of lines given by their kind and path.

        Raises:
            ModelError: an unknown path.
        """
        self.names = [f"{kind} {'.'.join(path)}" for kind, path in lines]
        self.places: list[Place | None] = []
        self.parts: list[int] = []
        self.dofs: list[int] = []
        for written, (_, path) in zip(self.names, lines):
            require_kind(path[0], written)
            on_joint = path[0] == "joint"
            place, part = (None, -1) if on_joint else _part_of_place(model, written, path)
            self.places.append(place)
            self.parts.append(part)
            self.dofs.append(_dof(model, written, path[1:]) if on_joint else -1)
        #: The places, each once, and where among them each line's is.
        self._different = list(dict.fromkeys(place for place in self.places if place is not None))
        self._where = [None if place is None else self._different.index(place) for place in self.places]

    def __len__(self) -> int:
        return len(self.names)

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, values: FloatArray) -> None:
        """Set ``qfrc_applied`` to the generalised forces in the state of ``data``.

        Args:
            model: the model.
            data: the simulation; its kinematics are updated for its ``qpos``.
            values: (k,) the forces.
        """
        if not self.names:
            return
        import mujoco

        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        applied = data.qfrc_applied
        applied[:] = 0.0
        for dof, value in zip(self.dofs, values):
            if dof >= 0:
                applied[dof] += value
        total = np.zeros(len(applied))
        for place, wrench in self.wrenches(values):
            mujoco.mj_applyFT(
                model, data, wrench[:3], wrench[3:], place.point(model, data), place.body, total
            )
        applied += total

    def wrenches(self, values: FloatArray) -> list[tuple[Place, FloatArray]]:
        """The force in N and torque in N m of each place, (6,) along the world's axes.

        Args:
            values: (k,) the forces; generalised ones on joints are left out.
        """
        wrenches = np.zeros((len(self._different), 6))
        for where, part, value in zip(self._where, self.parts, values):
            if where is not None:
                wrenches[where, part] += value
        return list(zip(self._different, wrenches))


class OuterForces(Signals):
    """External forces on the model over time: its ``apply`` or ``contact`` lines.

    Attributes:
        where: see :class:`Attachments`.
    """

    def __init__(self, model: mujoco.MjModel, solution: Solution, kinds: tuple[str, ...]) -> None:
        """Tie the lines of the given kinds to the model.

        Raises:
            ModelError: an unknown path.
        """
        super().__init__(solution, [line for kind in kinds for line in lines_of(solution, kind)])
        self.where = Attachments(model, [(line.kind, line.path) for line in self.lines])
        #: See :meth:`Attachments.apply` and :meth:`Attachments.wrenches`.
        self.apply, self.wrenches = self.where.apply, self.where.wrenches


def _part_of_place(model: mujoco.MjModel, written: str, path: tuple[str, ...]) -> tuple[Place, int]:
    if len(path) < 3 or path[-1] not in _PARTS:
        find_place(model, path[:2], written)  # tells of a missing or unknown name first
        raise ModelError(f"{written}: end the path in one of .{', .'.join(_PARTS)}")
    return find_place(model, path[:-1], written), _PARTS.index(path[-1])


def _dof(model: mujoco.MjModel, written: str, path: tuple[str, ...]) -> int:
    """The degree of freedom that a force on a joint acts on."""
    if not path:
        raise ModelError(f"{written}: the name of the joint is missing")
    dof = joint_dof(model, *joint_part(model, path))
    if dof is None:
        raise ModelError(f"{written}: no force acts on a component of a quaternion: write .wx, .wy or .wz")
    return dof
