"""The handles of a pose that the spec states at a frame: the whole pose, parts of the body, and feet that stand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.language import syntax
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.model.scope import parts_of
from stc.language.names import collect_names
from stc.problem import Problem
from stc.solution import Solution
from stc.steering.handles import DECIMALS, Handle, body_name, qpos_at
from stc.steering.knobs import Knobs, PoseSite
from stc.steering.posed_body import FloatArray, Place, PosedBody, moving_bodies

if TYPE_CHECKING:
    from stc.validate.setup import Setup

#: Decimals of quaternions that dragging writes.
_OF_QUATERNIONS = 7


class PoseHandles:
    """The handles of a pose that the spec states at a frame."""

    def __init__(
        self, site: PoseSite, knobs: Knobs, setup: Setup, standing: Sequence[tuple[str, Place]]
    ) -> None:
        """Find them.

        Args:
            site: the pose.
            knobs: of the spec.
            setup: a motion of it, tied to its model.
            standing: the contacts that stand at the frame, with their names.
        """
        assert knobs.scope is not None
        self._site, self._standing = site, [place for _, place in standing]
        #: Of each coordinate its address in ``qpos``.
        self._address: dict[str, int] = {}
        self._dofs: list[int] = []
        self._root: list[int] = []
        model = setup.compiled
        for one in knobs.scope.coordinates:
            dofs = range(one.joint.dof, one.joint.dof + len(one.rates))
            of_root = int(model.body_parentid[model.jnt_bodyid[model.dof_jntid[one.joint.dof]]]) == 0
            known = [path in site.coordinates for path in one.pose]
            for k, path in enumerate(one.pose):
                self._address[path] = one.joint.qpos + k
            straight = len(one.positions)
            movable = [
                dof for k, dof in enumerate(dofs) if (known[k] if k < straight else all(known[straight:]))
            ]
            if site.turned and of_root:
                movable = [dof for dof in movable if dof - one.joint.dof < straight]
            self._dofs += movable
            if of_root:
                self._root += dofs
        self.handles = list(self._found(setup, standing, knobs))

    def _found(self, setup: Setup, standing: Sequence[tuple[str, Place]], knobs: Knobs) -> Iterator[Handle]:
        site = self._site
        model = setup.compiled
        data = PosedBody(model, qpos_at(setup, setup.solution, site.frame))
        bodies = moving_bodies(model)
        self._axes = self._of_axes(knobs)
        moving = tuple(name for name in self._axes if name)
        if moving and bodies:
            below = _below(data, bodies[0], [place for _, place in standing])
            yield self._handle("place", f"the whole pose {site.label}", bodies[0], below, moving)
        names = tuple(dict.fromkeys(site.coordinates.values()))
        stood = {place.body for _, place in standing}
        if self._dofs:
            for body in bodies:
                if body not in stood:
                    label = f"{body_name(model, body)} {site.label}"
                    yield self._handle("pose", label, body, data.middle(body), names)
        legs = tuple(
            site.coordinates[path] for path in site.coordinates if self._address[path] not in range(7)
        )
        if set(self._dofs) - set(self._root):
            for name, place in standing:
                yield self._handle("foot", f"{name} {site.label}", place.body, place, legs)

    def _handle(self, kind: str, label: str, body: int, place: Place, names: tuple[str, ...]) -> Handle:
        return Handle(f"{kind}:{label}", label, kind, self._site.frame, body, place, names)

    def _of_axes(self, knobs: Knobs) -> list[str | None]:
        """The number that moves the whole pose along each axis of the world."""
        found: list[str | None] = list(self._site.shift)
        for path, name in self._site.coordinates.items():
            axis = "xyz".find(path.rpartition(".")[2])
            if len(parts_of(path)) == 3 and self._address[path] < 3 and axis >= 0 and found[axis] is None:
                found[axis] = name
        if self._standing:  # what stands on the floor stays there
            found[2] = self._site.shift[2]
        return found

    def reached(
        self, handle: Handle, target: FloatArray, solution: Solution, setup: Setup
    ) -> tuple[dict[str, float], FloatArray]:
        """See :meth:`stc.steering.handles.Handles.reached`."""
        stance = PosedBody(setup.compiled, qpos_at(setup, solution, handle.frame))
        here = handle.place.point(stance.data)
        if handle.kind == "place":
            way = np.where([name is not None for name in self._axes], target - here, 0.0)
            moved = {
                name: round(solution.constants[name] + float(way[axis]), DECIMALS)
                for axis, name in enumerate(self._axes)
                if name
            }
            return moved, here + way
        staying, dofs = self._standing, self._dofs
        if handle.kind == "foot":
            staying = [place for place in self._standing if place is not handle.place]
            dofs = [dof for dof in self._dofs if dof not in self._root]
            target = np.array([*target[:2], here[2]])
        before = stance.qpos
        after = stance.reached(handle.place, target, dofs, staying)
        stance.put(after)
        return self._changed(before, after, solution), handle.place.point(stance.data)

    def _changed(self, before: FloatArray, after: FloatArray, solution: Solution) -> dict[str, float]:
        found = {}
        for path, name in self._site.coordinates.items():
            address = self._address[path]
            if path.rpartition(".")[2] in ("qw", "qx", "qy", "qz"):
                if not self._site.turned:
                    old = np.array(
                        [solution.constants[self._site.coordinates[p]] for p in self._quaternion(path)]
                    )
                    new = after[[self._address[p] for p in self._quaternion(path)]]
                    sign = 1.0 if float(old @ new) >= 0.0 else -1.0
                    found[name] = round(sign * float(after[address]), _OF_QUATERNIONS)
            elif after[address] != before[address]:
                way = float(after[address] - before[address])
                found[name] = round(solution.constants[name] + way, DECIMALS + 1)
        return found

    @staticmethod
    def _quaternion(path: str) -> list[str]:
        joint = path.rpartition(".")[0]
        return [f"{joint}.{part}" for part in ("qw", "qx", "qy", "qz")]


def _below(stance: PosedBody, body: int, standing: Sequence[Place]) -> Place:
    """A point that goes with a body, below its middle: on the floor where something stands there."""
    point = stance.middle(body).point(stance.data)
    lowest = min((float(place.point(stance.data)[2]) for place in standing), default=float(point[2]))
    there = np.array([point[0], point[1], lowest])
    frame = stance.data.xmat[body].reshape(3, 3)
    return Place(body, frame.T @ (there - stance.data.xpos[body]))


def standing_places(knobs: Knobs, problem: Problem, model: Any, frame: int) -> list[tuple[str, Place]]:
    """The contacts of a spec with a model that stand at a frame: their names, and the points of the model."""
    tree = knobs.tree
    diagnostics = Diagnostics(tree.source)
    given = {
        name: value
        for name, value in problem.constants.items()
        if name in knobs.knobs and knobs.knobs[name].declared
    }
    constants = Constants(collect_names(tree, diagnostics, given), given, diagnostics, tree.damaged)
    declared: dict[str, syntax.ContactDeclaration] = {}
    standing: dict[str, None] = {}
    for block in tree.blocks("contact"):
        for statement in block.statements:
            if isinstance(statement, syntax.ContactDeclaration):
                declared[statement.name.name] = statement
            elif isinstance(statement, syntax.ContactPlace) and block.header is not None:
                first = constants.value_of(block.header.first)
                last = first if block.header.last is None else constants.value_of(block.header.last)
                if first is not None and last is not None and first - 1e-6 <= frame <= last + 1e-6:
                    standing[statement.name.name] = None
    found = [(name, _place_of(declared[name], constants, model)) for name in standing if name in declared]
    return [(name, place) for name, place in found if place is not None]


def _place_of(declaration: syntax.ContactDeclaration, constants: Constants, model: Any) -> Place | None:
    """The point of the model that a contact is declared with."""
    import mujoco

    first = declaration.pose[0] if declaration.pose else None
    if not isinstance(first, syntax.Name):
        return None
    kind, name, *_ = [*parts_of(first.name), ""]
    flat = declaration.kind.name == "foot"
    if kind not in ("site", "geom", "body"):
        return None
    index = int(mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))
    if index < 0:
        return None
    if kind == "body":
        local = [constants.value_of(item) for item in declaration.pose[1:4]]
        numbers = [0.0 if value is None else value for value in local] + [0.0] * (3 - len(local))
        return Place(index, np.array(numbers), flat)
    body = int(getattr(model, f"{kind}_bodyid")[index])
    return Place(body, np.array(getattr(model, f"{kind}_pos")[index]), flat)
