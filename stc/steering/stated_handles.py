"""The handles of a frame at which equations tie coordinates to constants, such as ``x = D`` and ``a1 = A1``.

They are the parts of the body that these constants move.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.language import syntax
from stc.language.constant_values import ConstantValues
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.names import collect_names
from stc.problem import (
    ConstantRef,
    DefinitionRef,
    IndexRef,
    ParameterRef,
    Problem,
    Relation,
    TimeRef,
    VariableRef,
)
from stc.solution import Solution
from stc.solution_origin import model_of
from stc.steering.handles import DECIMALS, Handle, body_name, qpos_at
from stc.steering.knobs import Knobs
from stc.steering.posed_body import FloatArray, Place, PosedBody, moving_bodies
from stc.symbolic.expr import Expr, evaluate, symbols
from stc.symbolic.slopes import Sweep

if TYPE_CHECKING:
    from stc.validate.setup import Setup

#: Iterations of a drag by equations.
_ITERATIONS = 8

#: A constant moves everything alike where parts of the body differ by less than this share.
_ALIKE = 1e-4


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
        self.frame, self._values, self._names = frame, ConstantValues(tree), list(names)
        self._rows = [row.body if row.lower is None else row.body - row.lower for row in rows]
        self._lines = joint_lines(setup)
        keys: dict[str, None] = {}
        for body in [*self._rows, *(body for _, body in self._lines)]:
            keys.update((key.name, None) for key in symbols(body) if isinstance(key, VariableRef))
        self._variables = list(keys)
        self.handles = list(self._found(setup))

    def _found(self, setup: Setup) -> Iterator[Handle]:
        solution, model = setup.solution, setup.compiled
        q, stance = self._start(solution), PosedBody(model, qpos_at(setup, solution, self.frame))
        bodies = moving_bodies(model)
        if not bodies:
            return
        rates = self._rates(q, self._given(solution, {}), solution)
        if rates is None:
            return
        places = [stance.middle(body) for body in bodies]
        # (bodies, 3, names): how each part moves by each number
        moves = np.stack([self._moves(stance, place, q, rates, setup) for place in places])
        sizes = np.linalg.norm(moves, axis=1)
        spread = np.linalg.norm(moves - moves.mean(axis=0), axis=1).max(axis=0)
        whole = [
            k
            for k in range(len(self._names))
            if sizes[:, k].max() > 1e-6 and spread[k] < _ALIKE * sizes[:, k].max()
        ]
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
                yield self._handle(
                    "pose", f"{body_name(model, body)} {label}: {', '.join(names)}", body, place, names
                )

    def _handle(self, kind: str, label: str, body: int, place: Place, names: tuple[str, ...]) -> Handle:
        return Handle(f"{kind}:{self.frame}:{body}", label, kind, self.frame, body, place, names)

    def reached(
        self, handle: Handle, target: FloatArray, solution: Solution, setup: Setup
    ) -> tuple[dict[str, float], FloatArray]:
        """See :meth:`stc.steering.handles.Handles.reached`."""
        q = self._start(solution)
        values = {name: solution.constants[name] for name in handle.knobs}
        columns = [self._names.index(name) for name in handle.knobs]
        stance = PosedBody(setup.compiled, qpos_at(setup, solution, self.frame))
        for _ in range(_ITERATIONS):
            given = self._given(solution, values)
            stance.put(self._qpos(stance, q, setup))
            error = target - handle.place.point(stance.data)
            if np.linalg.norm(error) < 1e-5:
                break
            rates = self._rates(q, given, solution)
            if rates is None:
                break
            moves = self._moves(stance, handle.place, q, rates[:, columns], setup)
            damped = np.vstack([moves, 1e-3 * np.eye(len(columns))])
            way = np.linalg.lstsq(damped, np.concatenate([error, np.zeros(len(columns))]), rcond=None)[0]
            way *= min(1.0, 0.3 / max(1e-12, float(np.abs(way).max())))
            values = {name: value + float(step) for (name, value), step in zip(values.items(), way)}
            q = q + rates[:, columns] @ way
            q = self._back(q, self._given(solution, values), solution)
        stance.put(self._qpos(stance, q, setup))
        point = handle.place.point(stance.data)
        return {name: round(value, DECIMALS) for name, value in values.items()}, point

    # ------------------------------------------------------------------- equations

    def _start(self, solution: Solution) -> FloatArray:
        return np.array([solution.trajectories[name, 0].after[self.frame] for name in self._variables])

    def _given(self, solution: Solution, values: Mapping[str, float]) -> dict[str, float]:
        return self._values({**solution.overrides, **values})

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
                        q[self._variables.index(key.name)]
                        if own
                        else solution.trajectories[key.name, 0].after[place]
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
        """(variables, names): how the variables follow the numbers; of several such changes the shortest."""
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
        """Whether the rows determine all coordinates that occur in them."""
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

    def _qpos(self, stance: PosedBody, q: FloatArray, setup: Setup) -> FloatArray:
        """The model's pose for values of the variables."""
        known = self._known(q, setup.solution.constants, setup.solution)
        found = stance.qpos
        for address, body in self._lines:
            found[address] = evaluate(body, known)
        return found

    def _moves(
        self, stance: PosedBody, place: Place, q: FloatArray, rates: FloatArray, setup: Setup
    ) -> FloatArray:
        """(3, k): how a point of the model moves along ways of the variables, (variables, k)."""
        found = np.zeros((3, rates.shape[1]))
        here = stance.qpos
        for k, way in enumerate(rates.T):
            ends = []
            for step in (1e-6, -1e-6):
                stance.put(self._qpos(stance, q + step * way, setup))
                ends.append(place.point(stance.data))
            found[:, k] = (ends[0] - ends[1]) / 2e-6
        stance.put(here)
        return found


def _plain(constants: Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    return {name: constants[name] for name in names}


def joint_lines(setup: Setup) -> list[tuple[int, Expr]]:
    """The address in ``qpos`` and the expression of each coordinate that a ``joint`` line of the replay states."""
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


def stated_frames(problem: Problem, knobs: Knobs, setup: Setup, tree: syntax.SpecTree) -> list[StatedHandles]:
    """The frames at which equations between coordinates hold that constants take part in, with their handles.

    Constants that shape the frames, or that occur in what holds on several frames (as masses and lengths do in the
    equations of motion), are no places, and are left out.
    """
    coordinates = {
        key.name for _, body in joint_lines(setup) for key in symbols(body) if isinstance(key, VariableRef)
    }
    of_poses = {
        name for site in knobs.poses for name in [*site.coordinates.values(), *filter(None, site.shift)]
    }
    needs = _needs(tree, setup.solution.overrides)
    elsewhere: set[str] = set()
    at: dict[int, list[Relation]] = {}
    for relation in problem.relations:
        names = _constants(relation)
        if relation.range.first != relation.range.last:
            elsewhere |= names
        elif relation.is_equality and _is_place(relation, coordinates):
            at.setdefault(relation.range.first, []).append(relation)
    elsewhere |= {
        key.name for line in problem.replay for key in symbols(line.body) if isinstance(key, ConstantRef)
    }
    elsewhere |= {key.name for key in symbols(problem.step) if isinstance(key, ConstantRef)}
    steerable = {name for name in knobs.knobs if name not in elsewhere | of_poses | set(problem.structural)}
    found = []
    for frame, rows in sorted(at.items()):
        used: set[str] = set().union(*(needs.get(name, {name}) for row in rows for name in _constants(row)))
        chosen = [name for name in knobs.knobs if name in used & steerable]
        if chosen:
            found.append(StatedHandles(frame, rows, chosen, tree, setup))
    return [one for one in found if one.handles]


def _needs(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> dict[str, set[str]]:
    """The constants that each constant is made from, itself included."""
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
        key.order == 0
        and key.name in coordinates
        and key.scale in (0, 1)
        and (key.scale == 0 or not key.shift)
        for key in variables
    )
