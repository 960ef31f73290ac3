"""What drives the model: the controls of its actuators, and forces that act on it from outside.

``actuator NAME = e``
    the control of an actuator.
``apply joint.NAME = e``, ``apply body.NAME.fx = e``, ``apply site.NAME.my = e`` (...)
    a force that acts whatever the model itself supplies: a generalised force on a joint; a force (``fx``,
    ``fy``, ``fz``, in N, along the world's axes) at the origin of a body's frame or at a site, or a torque
    (``mx``, ``my``, ``mz``, in N m) on that body.
``contact body.NAME.fx = e`` (...)
    the same, for a force that the ground gives.  Where the model has its own contacts, they supply it; the
    solved one acts where those are switched off, as in the inverse dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.solution import Solution
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_actuator, find_object, lines_of, nearest
from stc.validate.signals import Signals

if TYPE_CHECKING:
    import mujoco

_PARTS = ("fx", "fy", "fz", "mx", "my", "mz")


class Controls(Signals):
    """Control signals of a replay.

    Attributes:
        names: the driven actuators.
        actuators: their indices in the model.
        addresses: (k,) index in MuJoCo's ``ctrl`` of each driven actuator.
    """

    def __init__(self, model: mujoco.MjModel, solution: Solution) -> None:
        """Tie the spec's ``actuator`` lines to the model.

        Raises:
            ModelError: an unknown actuator, or one that takes several controls.
        """
        super().__init__(solution, lines_of(solution, "actuator"))
        self.names = [line.name for line in self.lines]
        self.actuators = [find_actuator(model, name) for name in self.names]
        self.addresses = np.array([model.actuator_ctrladr[index] for index in self.actuators], dtype=np.intp)

    def beyond_range(self, model: mujoco.MjModel) -> list[str]:
        """Names of the actuators whose control leaves the range that the model clamps it to."""
        found = []
        for name, index, channel in zip(self.names, self.actuators, self.channels):
            if model.actuator_ctrllimited[index]:
                lower, upper = model.actuator_ctrlrange[index]
                values = np.concatenate([channel.before, channel.after])
                slack = 1e-9 * max(1.0, abs(lower), abs(upper))
                if values.min() < lower - slack or values.max() > upper + slack:
                    found.append(name)
        return found


@dataclass(frozen=True, slots=True)
class _Target:
    """Where an outer force acts: on degree of freedom ``dof``, or as part of a wrench at a body or site."""

    dof: int = -1
    kind: str = ""
    index: int = -1
    part: int = -1


class Attachments:
    """Where outer forces act on a model, and what they amount to."""

    def __init__(self, model: mujoco.MjModel, lines: Sequence[tuple[str, tuple[str, ...]]]) -> None:
        """Find the places of lines given by their kind and path.

        Raises:
            ModelError: an unknown path.
        """
        self.names = [f"{kind} {'.'.join(path)}" for kind, path in lines]
        self._targets = [_target(model, name, path) for name, (_, path) in zip(self.names, lines)]

    def __len__(self) -> int:
        return len(self.names)

    def apply(self, model: mujoco.MjModel, data: mujoco.MjData, values: FloatArray) -> None:
        """Set ``qfrc_applied`` to what the forces amount to in the state of ``data``.

        Args:
            model: the model.
            data: its ``qpos`` counts; kinematics are brought up to date.
            values: (k,) the forces.
        """
        if not self.names:
            return
        import mujoco

        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        data.qfrc_applied[:] = 0.0
        for target, value in zip(self._targets, values):
            if target.dof >= 0:
                data.qfrc_applied[target.dof] += value
        total = np.zeros(model.nv)
        for (kind, index), wrench in self.wrenches(values).items():
            body = index if kind == "body" else int(model.site_bodyid[index])
            point = (data.xpos if kind == "body" else data.site_xpos)[index]
            mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], point, body, total)
        data.qfrc_applied[:] += total

    def wrenches(self, values: FloatArray) -> dict[tuple[str, int], FloatArray]:
        """Per body or site (its kind and index) the force in N and torque in N m, (6,) along the world's axes.

        Args:
            values: (k,) the forces; generalised ones on joints are left out.
        """
        found: dict[tuple[str, int], FloatArray] = {}
        for target, value in zip(self._targets, values):
            if target.dof < 0:
                found.setdefault((target.kind, target.index), np.zeros(6))[target.part] += value
        return found


class OuterForces(Signals):
    """Forces on the model that are not its actuators': ``apply`` or ``contact`` lines over time."""

    def __init__(self, model: mujoco.MjModel, solution: Solution, kinds: tuple[str, ...]) -> None:
        """Tie the lines of the given kinds to the model.

        Raises:
            ModelError: an unknown path.
        """
        super().__init__(solution, [line for kind in kinds for line in lines_of(solution, kind)])
        self._places = Attachments(model, [(line.kind, line.path) for line in self.lines])
        #: See :meth:`Attachments.apply` and :meth:`Attachments.wrenches`.
        self.apply, self.wrenches = self._places.apply, self._places.wrenches


def _target(model: mujoco.MjModel, written: str, path: tuple[str, ...]) -> _Target:
    kind, *rest = path
    if kind not in ("joint", "body", "site"):
        known = nearest(kind, ["joint", "body", "site"])
        raise ModelError(f"{written}: a force acts on a joint, a body or a site, not on {kind}{known}")
    if not rest:
        raise ModelError(f"{written}: the name of the {kind} is missing")
    index = find_object(model, kind, rest[0], written)
    if kind == "joint":
        if len(rest) > 1:
            raise ModelError(f"{written}: the force on a joint has no parts")
        if model.jnt_type[index] < 2:  # free and ball joints come first
            raise ModelError(f"{written}: a ball or free joint has several coordinates")
        return _Target(dof=int(model.jnt_dofadr[index]))
    if len(rest) != 2 or rest[1] not in _PARTS:
        raise ModelError(f"{written}: end the path in one of .{', .'.join(_PARTS)}")
    return _Target(kind=kind, index=index, part=_PARTS.index(rest[1]))
