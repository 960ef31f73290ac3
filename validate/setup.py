"""The inputs of a validation: the model with the spec's numbers, and its connections to the solution."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from stc.arguments import path as file_path
from stc.model_source import opened
from stc.recorded_files import changed, unpacked
from stc.records import dataclass, field
from stc.solution import Solution
from stc.validate.fields import apply_fields, set_fields
from stc.validate.forces import Activations, Attachments, Controls, OuterForces
from stc.validate.mocap import weld_where_it_begins
from stc.validate.model import (
    ModelError,
    actuator_names,
    find_activation,
    find_control,
    find_model,
    joint_names,
    load_model,
)
from stc.validate.outputs import Output, compared_outputs, find_output
from stc.validate.reference import Reference
from stc.validate.ties import Tie, joint_part, tied_joints

if TYPE_CHECKING:
    import mujoco

    from stc.validate.untied import UntiedMotion


@dataclass(slots=True)
class Setup:
    """A solution and its model, connected by the replay lines.

    Attributes:
        solution: the motion.
        path: path of the model file.
        compiled: the model with the fields that the spec sets; use a copy from :meth:`model` to change options.
        fields: model fields that the spec set, by path.
        ties: the joints with ``joint`` lines, part by part.
        reference: their solved motion as a function of time.
        controls: controls of the actuators.
        activations: states of actuators, as the solution has them.
        applied: forces that always act.
        contact: forces that the model's own contacts should supply.
        outputs: the compared outputs.
        untied: the motion of the joints without ``joint`` lines, after a replay has shown which of them move; None if
            there are none or their motion is not known.
        unknown: why it is not known, in words; otherwise "".
        faults: differences between the model and the one that the motion was solved for, one line each.
        remarks: notes on the origin of the model.
    """

    solution: Solution
    path: Path
    compiled: mujoco.MjModel
    fields: dict[str, float]
    ties: list[Tie]
    reference: Reference
    controls: Controls
    activations: Activations
    applied: OuterForces
    contact: OuterForces
    outputs: list[Output]
    untied: UntiedMotion | None = None
    unknown: str = ""
    faults: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def put(self, data: mujoco.MjData, part: str, frame: int) -> None:
        """Set a simulation to the solved position, velocity and activations at a node."""
        self.reference.put(data, self.reference.at(part, frame)[:2])
        data.act[self.activations.addresses] = self.activations.at(part, frame)

    def model(self, contacts: bool = True) -> mujoco.MjModel:
        """A copy of the model, whose options may be changed.

        Args:
            contacts: False switches its contacts off, and the stops of joints on which a `contact` line states one.
        """
        import mujoco

        made = copy.copy(self.compiled)
        if not contacts:
            made.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
            made.jnt_limited[[made.dof_jntid[dof] for dof in self.contact.where.dofs if dof >= 0]] = 0
        return made

    def description(self) -> mujoco.MjSpec:
        """The model's description as its file and the spec's additions make it, without the spec's numbers."""
        return opened(self.path, self.solution.additions).spec

    @property
    def all_forces(self) -> OuterForces:
        """Applied and contact forces together, which act if the model's contacts are switched off."""
        return OuterForces(self.compiled, self.solution, ("apply", "contact"))

    @property
    def knows_activations(self) -> bool:
        """Whether the solution contains the states of all actuators that have one."""
        return len(set(self.activations.addresses.tolist())) == self.compiled.na

    @property
    def all_tied(self) -> bool:
        """Whether the solution contains the motion of every coordinate of the model."""
        return len(self.reference.velocities) == self.compiled.nv

    def notes(self) -> list[str]:
        """Notes on elements of the model that the spec leaves out, and on inputs that the model changes."""
        notes = [*self.remarks]
        if self.solution.status != "optimal":
            notes.append(f"the solution is not optimal: {self.solution.status}")
        tied = {tie.joint for tie in self.ties}
        loose = [name for joint, name in enumerate(joint_names(self.compiled)) if joint not in tied]
        if loose:
            notes.append(
                f"joints without a `joint` line start at rest in the model's initial position: {', '.join(loose)}"
            )
        driven, takes = set(self.controls.actuators), self.compiled.actuator_ctrlnum
        names = enumerate(actuator_names(self.compiled))
        idle = [name for index, name in names if index not in driven and takes[index]]
        if idle:
            notes.append(f"actuators not driven by the spec get the control 0: {', '.join(idle)}")
        clamped = self.controls.beyond_range(self.compiled)
        if clamped:
            notes.append(f"the model clamps the control of {', '.join(clamped)} to a smaller range")
        return notes


def prepare(
    solution: Solution, model: str | os.PathLike[str] | None = None, beside: Iterable[str | Path] = ()
) -> Setup:
    """Find and compile the model of a solution, and connect the replay lines to it.

    Args:
        solution: the motion.
        model: a model file to use in place of the one that the spec names.
        beside: folders to search besides the one of the spec.

    Raises:
        ModelError: there is no model, or a replay line does not fit it.
        SolutionError: time does not increase along the solution.
    """
    solution.require_increasing_times()
    path, carried = _path(solution, model, beside)
    compiled = load_model(path, solution.additions)
    fields = apply_fields(compiled, solution)
    ties = tied_joints(compiled, solution)
    if not ties:
        raise ModelError(f"the replay section of {solution.name} ties no joint: there cannot be compared")
    setup = Setup(
        solution,
        path,
        compiled,
        fields,
        ties,
        Reference(solution, ties),
        Controls(compiled, solution),
        Activations(compiled, solution),
        OuterForces(compiled, solution, ("apply",)),
        OuterForces(compiled, solution, ("contact",)),
        compared_outputs(compiled, solution),
    )
    if "mocap" in solution.additions:
        weld_where_it_begins(setup)
    if carried:
        setup.remarks.append(
            f"there is no model {solution.model} here: the one stored in the solution is replayed"
        )
    elif model is None:
        setup.faults = model_faults(solution, path)
    return setup


def model_faults(solution: Solution, path: Path) -> list[str]:
    """A line for a model that differs from the one that a motion was solved for; empty if it does not, or is not
    recorded.
    """
    other = changed(solution.files, path)
    if not other:
        return []
    files = ", ".join(other[:3]) + (f" and {len(other) - 3} more" if len(other) > 3 else "")
    if other == [solution.model] or other == [path.name]:
        files = path.name
    return [
        f"{files} of the model has changed since this motion was solved: solve it again, or name the model that is to "
        "be replayed"
    ]


def require_line(model: mujoco.MjModel, kind: str, path: tuple[str, ...]) -> None:
    """Check a replay line against the model, before there is a motion; ``set`` lines leave a 1 in the model.

    Raises:
        ModelError: it is not in the model.
    """
    if kind == "joint":
        joint_part(model, path)
    elif kind == "actuator" and find_activation(model, ".".join(path)) is None:
        find_control(model, ".".join(path))
    elif kind == "set":
        set_fields(model, {path: 1.0})
    elif kind in ("apply", "contact"):
        Attachments(model, [(kind, path)])
    elif kind == "compare":
        find_output(model, path)


def _path(
    solution: Solution, model: str | os.PathLike[str] | None, beside: Iterable[str | Path]
) -> tuple[Path, bool]:
    """The path of the model, and whether it is the one stored in the solution because there is no other."""
    if model is not None:
        return find_model(file_path(model, "the model"), [Path()]), False
    if solution.model is None:
        raise ModelError(f"{solution.name} names no model: add a replay section to the spec to validate it")
    try:
        return find_model(solution.model, [solution.directory or Path(), *beside]), False
    except ModelError:
        carried = unpacked(solution.files)
        if carried is None:
            raise
        return carried, True
