"""Points of the picture that can be dragged, and the numbers of the spec that put them where they are dragged to.

A handle belongs to a frame at which the spec says where the body is.  Two kinds of frames have handles:

- frames at which a pose is stated (:class:`PoseHandles`): the whole pose, the parts of the body, and the feet that stand;
- all others at which equations hold between coordinates and constants (:class:`StatedHandles`), such as ``x = D`` and
  ``a1 = A1``: the parts of the body that these constants move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.language import syntax
from stc.language.constant_values import constant_values
from stc.language.model.scope import parts_of
from stc.problem import ConstantRef, DefinitionRef, IndexRef, ParameterRef, Problem, Relation, TimeRef, VariableRef
from stc.records import dataclass
from stc.solution import Solution
from stc.steering.knobs import Knobs, PoseSite
from stc.steering.stance import FloatArray, Place, Stance, moving_bodies
from stc.symbolic.expr import Expr, evaluate, symbols
from stc.symbolic.slopes import Sweep

if TYPE_CHECKING:
    from stc.validate.setup import Setup

#: Decimals of lengths and angles, and of quaternions, that dragging writes.
DECIMALS, OF_QUATERNIONS = 4, 7

#: Iterations of a drag by equations.
_ITERATIONS = 8

#: A constant moves everything alike where parts of the body differ by less than this share.
_ALIKE = 1e-4


@dataclass(frozen=True, slots=True)
class Handle:
    """A point that can be dragged.

    Attributes:
        key: tells it from others.
        label: what it is, in words.
        kind: ``place`` (everything moves along), ``pose`` (a part of the body) or ``foot``.
        frame: at which the body is there.
        body: index of the body in the model.
        place: the point of it.
        knobs: the numbers that move it.
    """

    key: str
    label: str
    kind: str
    frame: int
    body: int
    place: Place
    knobs: tuple[str, ...]


def body_name(model: Any, body: int) -> str:
    """What a body is called."""
    return str(model.body(body).name) or f"body {body}"


class PoseHandles:
    """The handles of a pose that the spec states at a frame."""

    def __init__(self, site: PoseSite, knobs: Knobs, setup: Setup, standing: Sequence[tuple[str, Place]]) -> None:
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
            movable = [dof for k, dof in enumerate(dofs) if (known[k] if k < straight else all(known[straight:]))]
            if site.turned and of_root:
                movable = [dof for dof in movable if dof - one.joint.dof < straight]
            self._dofs += movable
            if of_root:
                self._root += dofs
        self.handles = list(self._found(model, standing, knobs))

    def _found(self, model: Any, standing: Sequence[tuple[str, Place]], knobs: Knobs) -> Any:
        site, data = self._site, Stance(model, model.qpos0)
        bodies = moving_bodies(model)
        self._axes = self._of_axes(knobs)
        if any(self._axes) and bodies:
            root = bodies[0]
            yield self._handle("place", f"the whole pose {site.label}", root, data.middle(root), tuple(
                name for name in self._axes if name
            ))  # fmt: skip
        names = tuple(dict.fromkeys(site.coordinates.values()))
        stood = {place.body for _, place in standing}
        if self._dofs:
            for body in bodies:
                if body not in stood:
                    label = f"{body_name(model, body)} {site.label}"
                    yield self._handle("pose", label, body, data.middle(body), names)
        legs = tuple(site.coordinates[path] for path in site.coordinates if self._address[path] not in range(7))
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
            if parts_of(path)[0] == "joint" and self._address[path] < 3 and axis >= 0 and found[axis] is None:
                found[axis] = name
        if self._standing:  # what stands on the floor stays there
            found[2] = self._site.shift[2]
        return found

    def values(self, handle: Handle, target: FloatArray, solution: Solution, setup: Setup) -> dict[str, float]:
        """The numbers that bring a handle to a target, (3,) m, or as near as it gets."""
        stance = Stance(setup.compiled, qpos_at(setup, solution, handle.frame))
        if handle.kind == "place":
            way = target - handle.place.point(stance.data)
            return {
                name: round(solution.constants[name] + float(way[axis]), DECIMALS)
                for axis, name in enumerate(self._axes)
                if name
            }
        staying, dofs = self._standing, self._dofs
        if handle.kind == "foot":
            staying = [place for place in self._standing if place is not handle.place]
            dofs = [dof for dof in self._dofs if dof not in self._root]
            target = np.array([*target[:2], handle.place.point(stance.data)[2]])
        before = stance.qpos
        after = stance.reached(handle.place, target, dofs, staying)
        return self._changed(before, after, solution)

    def _changed(self, before: FloatArray, after: FloatArray, solution: Solution) -> dict[str, float]:
        found = {}
        for path, name in self._site.coordinates.items():
            address = self._address[path]
            if path.rpartition(".")[2] in ("qw", "qx", "qy", "qz"):
                if not self._site.turned:
                    old = np.array([solution.constants[self._site.coordinates[p]] for p in self._quaternion(path)])
                    new = after[[self._address[p] for p in self._quaternion(path)]]
                    sign = 1.0 if float(old @ new) >= 0.0 else -1.0
                    found[name] = round(sign * float(after[address]), OF_QUATERNIONS)
            elif after[address] != before[address]:
                way = float(after[address] - before[address])
                found[name] = round(solution.constants[name] + way, DECIMALS + 1)
        return found

    @staticmethod
    def _quaternion(path: str) -> list[str]:
        joint = path.rpartition(".")[0]
        return [f"{joint}.{part}" for part in ("qw", "qx", "qy", "qz")]


class StatedHandles:
    """The handles of a frame at which equations tie coordinates to constants."""

    def __init__(
        self, frame: int, rows: Sequence[Relation], names: Sequence[str], tree: syntax.SpecTree, setup: Setup
    ) -> None:
        """Find them.

        Args:
            frame: the frame.
            rows: equalities between coordinates that hold there.
            names: of the numbers in them that can be steered.
            tree: the syntax of the working text.
            setup: a motion of it, tied to its model.
        """
        self.frame, self._tree, self._names = frame, tree, list(names)
        self._rows = [row.body if row.lower is None else row.body - row.lower for row in rows]
        self._lines = joint_lines(setup)
        keys: dict[str, None] = {}
        for body in [*self._rows, *(body for _, body in self._lines)]:
            keys.update((key.name, None) for key in symbols(body) if isinstance(key, VariableRef))
        self._variables = list(keys)
        self.handles = list(self._found(setup))

    def _found(self, setup: Setup) -> Any:
        solution, model = setup.solution, setup.compiled
        q, stance = self._start(solution), Stance(model, qpos_at(setup, solution, self.frame))
        bodies = moving_bodies(model)
        if not bodies:
            return
        rates = self._rates(q, self._given(solution, {}), solution)
        if rates is None:
            return
        places = [stance.middle(body) for body in bodies]
        # (bodies, 3, names): how each part moves by each number
        moves = np.stack([self._moves(stance, place, q, setup) @ rates for place in places])
        sizes = np.linalg.norm(moves, axis=1)
        spread = np.linalg.norm(moves - moves.mean(axis=0), axis=1).max(axis=0)
        whole = [k for k in range(len(self._names)) if sizes[:, k].max() > 1e-6 and spread[k] < _ALIKE * sizes[:, k].max()]
        others = [k for k in range(len(self._names)) if k not in whole]
        label = f"at frame {self.frame}"
        if whole:
            names = tuple(self._names[k] for k in whole)
            yield self._handle("place", f"{', '.join(names)} {label}", bodies[0], places[0], names)
        if others and not self._determined(q, solution):
            # Nothing tells how the rest of the body follows: the part that moves most is the one that is meant.
            body = int(np.argmax(sizes[:, others].max(axis=1)))
            names = tuple(self._names[k] for k in others)
            yield self._handle("foot", f"{', '.join(names)} {label}", bodies[body], places[body], names)
            return
        for body, place, size in zip(bodies, places, sizes):
            names = tuple(self._names[k] for k in others if size[k] > 1e-3)
            if names:
                yield self._handle("pose", f"{body_name(model, body)} {label}: {', '.join(names)}", body, place, names)

    def _handle(self, kind: str, label: str, body: int, place: Place, names: tuple[str, ...]) -> Handle:
        return Handle(f"{kind}:{self.frame}:{body}", label, kind, self.frame, body, place, names)

    def values(self, handle: Handle, target: FloatArray, solution: Solution, setup: Setup) -> dict[str, float]:
        """The numbers that bring a handle to a target, (3,) m, or as near as it gets."""
        q = self._start(solution)
        values = {name: solution.constants[name] for name in handle.knobs}
        columns = [self._names.index(name) for name in handle.knobs]
        stance = Stance(setup.compiled, qpos_at(setup, solution, self.frame))
        for _ in range(_ITERATIONS):
            given = self._given(solution, values)
            stance.put(self._qpos(stance, q, setup))
            error = target - handle.place.point(stance.data)
            rates = self._rates(q, given, solution)
            if rates is None or np.linalg.norm(error) < 1e-6:
                break
            moves = self._moves(stance, handle.place, q, setup) @ rates[:, columns]
            damped = np.vstack([moves, 1e-3 * np.eye(len(columns))])
            way = np.linalg.lstsq(damped, np.concatenate([error, np.zeros(len(columns))]), rcond=None)[0]
            way *= min(1.0, 0.3 / max(1e-12, float(np.abs(way).max())))
            values = {name: value + float(step) for (name, value), step in zip(values.items(), way)}
            q = q + rates[:, columns] @ way
            q = self._back(q, self._given(solution, values), solution)
        return {name: round(value, DECIMALS) for name, value in values.items()}

    # ------------------------------------------------------------------- equations

    def _start(self, solution: Solution) -> FloatArray:
        return np.array([solution.trajectories[name, 0].after[self.frame] for name in self._variables])

    def _given(self, solution: Solution, values: Mapping[str, float]) -> dict[str, float]:
        return constant_values(self._tree, {**solution.overrides, **values})

    def _known(self, q: FloatArray, constants: Mapping[str, float], solution: Solution) -> dict[Any, float]:
        known: dict[Any, float] = {ConstantRef(name): value for name, value in constants.items()}
        known[IndexRef()] = float(self.frame)
        known[TimeRef()] = float(solution.time[self.frame])
        for body in self._rows + [body for _, body in self._lines]:
            for key in symbols(body):
                if isinstance(key, VariableRef):
                    own = self._own(key)
                    place = int(key.shift)
                    known[key] = (
                        q[self._variables.index(key.name)] if own else solution.trajectories[key.name, 0].after[place]
                    )
        return known

    def _own(self, key: VariableRef) -> bool:
        """Whether a variable is one of this frame, and not of another one that a row compares with."""
        return key.scale != 0 or int(key.shift) == self.frame

    def _slopes(self, body: Expr, known: Mapping[Any, float]) -> FloatArray:
        """(variables,) slopes of an expression by the variables of this frame."""
        keys = {key for key in symbols(body) if isinstance(key, VariableRef) and self._own(key)}
        found = np.zeros(len(self._variables))
        for key, slope in Sweep([body], known).slopes(0, keys).items():
            assert isinstance(key, VariableRef)
            found[self._variables.index(key.name)] += float(slope)
        return found

    def _rates(self, q: FloatArray, constants: Mapping[str, float], solution: Solution) -> FloatArray | None:
        """(variables, names): how the variables follow the numbers, those that nothing determines as little as can be."""
        known = self._known(q, constants, solution)
        by_variables = np.array([self._slopes(row, known) for row in self._rows])
        start = np.array([evaluate(row, known) for row in self._rows])
        columns = []
        for name in self._names:
            step = 1e-6 * max(1.0, abs(constants[name]))
            other = self._given(solution, {**_plain(constants, self._names), name: constants[name] + step})
            moved = {**known, **{ConstantRef(key): value for key, value in other.items()}}
            columns.append((np.array([evaluate(row, moved) for row in self._rows]) - start) / step)
        by_names = np.stack(columns, axis=1)
        if not (np.isfinite(by_variables).all() and np.isfinite(by_names).all()):
            return None
        found: FloatArray = -np.linalg.pinv(by_variables, rcond=1e-9) @ by_names
        return found

    def _determined(self, q: FloatArray, solution: Solution) -> bool:
        """Whether the rows leave no coordinate open that they speak of."""
        known = self._known(q, self._given(solution, {}), solution)
        rows = np.array([self._slopes(row, known) for row in self._rows])
        used = np.flatnonzero(np.abs(rows).max(axis=0) > 0.0)
        return int(np.linalg.matrix_rank(rows)) == len(used)

    def _back(self, q: FloatArray, constants: Mapping[str, float], solution: Solution) -> FloatArray:
        """The variables nearby for which the rows hold."""
        for _ in range(3):
            known = self._known(q, constants, solution)
            miss = np.array([evaluate(row, known) for row in self._rows])
            slopes = np.array([self._slopes(row, known) for row in self._rows])
            q = q - np.linalg.pinv(slopes, rcond=1e-9) @ miss
        return q

    # ------------------------------------------------------------------- the model

    def _qpos(self, stance: Stance, q: FloatArray, setup: Setup) -> FloatArray:
        """The model's pose for values of the variables."""
        known = self._known(q, setup.solution.constants, setup.solution)
        found = stance.qpos
        for address, body in self._lines:
            found[address] = evaluate(body, known)
        return found

    def _moves(self, stance: Stance, place: Place, q: FloatArray, setup: Setup) -> FloatArray:
        """(3, variables): how a point of the model moves by the variables, by central differences."""
        found = np.zeros((3, len(q)))
        here = stance.qpos
        for k in range(len(q)):
            ends = []
            for step in (1e-6, -1e-6):
                other = q.copy()
                other[k] += step
                stance.put(self._qpos(stance, other, setup))
                ends.append(place.point(stance.data))
            found[:, k] = (ends[0] - ends[1]) / 2e-6
        stance.put(here)
        return found


def _plain(constants: Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    return {name: constants[name] for name in names}


def joint_lines(setup: Setup) -> list[tuple[int, Expr]]:
    """Of each coordinate that the replay ties its address in ``qpos``, and the expression that it is."""
    from stc.origin import model_of

    problem = model_of(setup.solution).problem(setup.solution.method, **setup.solution.overrides)
    bodies = {".".join(line.path): line.body for line in problem.replay if line.kind == "joint"}
    found = []
    for tie in setup.ties:
        lines = [bodies.get(name) for name in tie_lines(tie)]
        found += [(address, body) for address, body in zip(tie.positions, lines) if body is not None]
    return found


def tie_lines(tie: Any) -> list[str]:
    """The replay lines of a tie, one for each of its positions."""
    if len(tie.positions) == 1:
        return [tie.line.name]
    return [f"{tie.dofs[0].rpartition('.')[0]}.{part}" for part in ("qw", "qx", "qy", "qz")]


def qpos_at(setup: Setup, solution: Solution, frame: int) -> FloatArray:
    """(nq,) the model's pose at a frame of a motion; at a jump the one after it."""
    import mujoco

    found: FloatArray = np.array(mujoco.MjData(setup.compiled).qpos)
    found[setup.reference.positions] = setup.reference.at("after", frame)[0]
    return found


def stated_frames(problem: Problem, knobs: Knobs, setup: Setup, tree: syntax.SpecTree) -> list[StatedHandles]:
    """The frames at which equations between coordinates hold that constants take part in, with their handles.

    Constants that shape the frames, or that occur in what holds on several frames (as masses and lengths do in the
    equations of motion), are no places, and are left out.
    """
    coordinates = {
        key.name for _, body in joint_lines(setup) for key in symbols(body) if isinstance(key, VariableRef)
    }
    of_poses = {name for site in knobs.poses for name in [*site.coordinates.values(), *filter(None, site.shift)]}
    needs = _needs(tree, setup.solution.overrides)
    elsewhere: set[str] = set()
    at: dict[int, list[Relation]] = {}
    for relation in problem.relations:
        names = _constants(relation)
        if relation.range.first != relation.range.last:
            elsewhere |= names
        elif relation.is_equality and _is_place(relation, coordinates):
            at.setdefault(relation.range.first, []).append(relation)
    elsewhere |= {key.name for line in problem.replay for key in symbols(line.body) if isinstance(key, ConstantRef)}
    elsewhere |= {key.name for key in symbols(problem.step) if isinstance(key, ConstantRef)}
    steerable = {
        name for name in knobs.knobs if name not in elsewhere | of_poses | set(problem.structural)
    }
    found = []
    for frame, rows in sorted(at.items()):
        used = set().union(*(needs.get(name, {name}) for row in rows for name in _constants(row)))
        names = [name for name in knobs.knobs if name in used & steerable]
        if names:
            found.append(StatedHandles(frame, rows, names, tree, setup))
    return [one for one in found if one.handles]


def _needs(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> dict[str, set[str]]:
    """The constants that each constant is made from, itself included."""
    from stc.language.constants import Constants
    from stc.language.diagnostics import Diagnostics
    from stc.language.names import collect_names

    diagnostics = Diagnostics(tree.source)
    constants = Constants(collect_names(tree, diagnostics, overrides), overrides, diagnostics, tree.damaged)
    return {name: constants.made_from(name) for name in constants.values}


def _expressions(relation: Relation) -> list[Expr]:
    return [body for body in (relation.body, relation.lower, relation.upper) if body is not None]


def _constants(relation: Relation) -> set[str]:
    return {
        key.name for body in _expressions(relation) for key in symbols(body) if isinstance(key, ConstantRef)
    }


def _is_place(relation: Relation, coordinates: set[str]) -> bool:
    """Whether a relation is one between coordinates, without velocities, forces and parameters."""
    keys = [key for body in _expressions(relation) for key in symbols(body)]
    if any(isinstance(key, ParameterRef | DefinitionRef) for key in keys):
        return False
    variables = [key for key in keys if isinstance(key, VariableRef)]
    return bool(variables) and all(
        key.order == 0 and key.name in coordinates and key.scale in (0, 1) and (key.scale == 0 or not key.shift)
        for key in variables
    )


def standing_places(knobs: Knobs, problem: Problem, model: Any, frame: int) -> list[tuple[str, Place]]:
    """The contacts of a spec with a model that stand at a frame: their names, and the points of the model."""
    from stc.language.constants import Constants
    from stc.language.diagnostics import Diagnostics
    from stc.language.names import collect_names

    tree = knobs.tree
    diagnostics = Diagnostics(tree.source)
    given = {name: value for name, value in problem.constants.items() if name in knobs.knobs and knobs.knobs[name].declared}
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


def _place_of(declaration: syntax.ContactDeclaration, constants: Any, model: Any) -> Place | None:
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
