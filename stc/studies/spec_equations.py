"""A spec's equations of motion as arrays: linear in the accelerations, at any state.

A spec does not mark its equations of motion.  Between two frames (see :mod:`stc.phases`) its equations are sorted by
the symbols in them.  Call the variables of the joint
lines *coordinates* and all others *auxiliaries* (forces, momenta, speeds of a first-order form):

- an equation without accelerations of coordinates and without derivatives of auxiliaries is a *law*: given
  positions and velocities it restricts auxiliaries (``w = a'``, ``tau = -k*a``);
- any other equation is *dynamic*: it is linear in accelerations and derivatives of auxiliaries.

At a state (positions, velocities and a choice of auxiliaries) the laws are solved for the auxiliaries nearest
to the choice; the derivative of a law ties derivatives of auxiliaries to accelerations; and each dynamic
equation becomes ``A x'' + b = 0``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.phases import Equation, Phase, resolved
from stc.problem import ConstantRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.symbolic.differentiate import jacobian
from stc.symbolic.expr import ZERO, Expr, evaluate_all, substitute, symbols
from stc.symbolic.structure import is_linear
from stc.time_derivatives import time_derivative

FloatArray = NDArray[np.float64]

#: Newton steps that laws are given to find their auxiliaries.
_LAW_STEPS = 30


@dataclass(frozen=True, slots=True)
class State:
    """S states; k coordinates, m auxiliaries.

    Attributes:
        x: (S, k) values of the coordinates.
        v: (S, k) their first derivatives.
        z: (S, m) auxiliaries.
    """

    x: FloatArray
    v: FloatArray
    z: FloatArray


@dataclass(frozen=True, slots=True)
class Linear:
    """``A x'' + b = 0`` for E dynamic equations at S states.

    Attributes:
        matrix: (S, E, k) A.
        offset: (S, E) b.
        state: the state, with auxiliaries that satisfy the laws.
    """

    matrix: FloatArray
    offset: FloatArray
    state: State


class SpecEquations:
    """The equations of one phase.

    Attributes:
        coordinates: names of the variables in joint lines.
        auxiliaries: names of the others that take part.
        dynamic: the dynamic equations.
        laws: those that restrict auxiliaries.
        skipped: equations with second derivatives that are not linear in them, or that contain other frames.
        stepping: equations without derivatives that relate variables to their values at other frames.
    """

    def __init__(
        self,
        problem: Problem,
        phase: Phase,
        joints: Sequence[Expr],
        forces: Sequence[Expr],
        numbers: Mapping[object, float],
    ) -> None:
        """Sort the equations of a phase.

        Args:
            problem: the spec.
            phase: where.
            joints: expressions of the joint lines, k of them.
            forces: expressions of actuator and outer force lines.
            numbers: values of constants and parameters by their references.
        """
        self.phase, self.numbers = phase, dict(numbers)
        self.numbers[IndexRef()] = 0.5 * (phase.first + phase.last)
        self.joints = [resolved(problem, body, phase.first) for body in joints]
        self.forces = [resolved(problem, body, phase.first) for body in forces]
        self.coordinates = _variables(self.joints)
        self.skipped: list[Equation] = []
        self.stepping: list[Equation] = []
        self.dynamic: list[Equation] = []
        laws: list[Equation] = []
        for equation in phase.equations:
            self._sort(equation, laws)
        self.laws, self.auxiliaries = self._connected(laws)
        self._accelerations = [VariableRef(name, 2) for name in self.coordinates]
        self._prepare()

    # ------------------------------------------------------------------ sorting

    def _sort(self, equation: Equation, laws: list[Equation]) -> None:
        keys = [key for key in symbols(equation.body) if isinstance(key, VariableRef)]
        own = set(self.coordinates)
        top = [k for k in keys if k.order >= 2 or (k.order >= 1 and k.name not in own)]
        elsewhere = any((k.scale, k.shift) != (1, 0) for k in keys)
        if not top:
            handed = {k.name for body in self.forces for k in symbols(body) if isinstance(k, VariableRef)}
            if keys and not elsewhere:
                laws.append(equation)
            elif any(k.shift for k in keys if k.name not in handed):
                self.stepping.append(equation)  # a force that is held over some frames is not a motion
        elif elsewhere or any(k.order > 2 for k in keys) or not is_linear(equation.body, top):
            self.skipped.append(equation)
        else:
            self.dynamic.append(equation)

    def _connected(self, laws: list[Equation]) -> tuple[list[Equation], list[str]]:
        """The laws that influence dynamic equations or forces through auxiliaries, and these auxiliaries."""
        own = set(self.coordinates)
        names = dict.fromkeys(_variables([e.body for e in self.dynamic] + self.forces))
        auxiliaries = {name: None for name in names if name not in own}
        kept: list[Equation] = []
        rest, grown = list(laws), True
        while grown:
            grown = False
            for equation in list(rest):
                mine = [name for name in _variables([equation.body]) if name not in own]
                if any(name in auxiliaries for name in mine):
                    kept.append(equation)
                    rest.remove(equation)
                    auxiliaries.update(dict.fromkeys(mine))
                    grown = True
        return kept, list(auxiliaries)

    # -------------------------------------------------------- symbolic preparation

    def _prepare(self) -> None:
        """Compute all derivatives that are evaluated later."""
        self._z = [VariableRef(name) for name in self.auxiliaries]
        self._law_bodies = [e.body for e in self.laws]
        self._law_jacobian = jacobian(self._law_bodies, self._z)
        rates = sorted(
            {
                key
                for equation in self.dynamic
                for key in symbols(equation.body)
                if isinstance(key, VariableRef) and key.order >= 1 and key.name in self.auxiliaries
            },
            key=str,
        )
        moving = {key.name for key in rates}
        bodies = [equation.body for equation in self.dynamic]
        ties = [time_derivative(e.body, 1) for e in self.laws if moving & set(_variables([e.body]))]
        extra = {
            key
            for body in ties
            for key in symbols(body)
            if isinstance(key, VariableRef) and key.order == 1 and key.name in self.auxiliaries
        }
        self._unknown = [*self._accelerations, *rates, *sorted(extra - set(rates), key=str)]
        zero = dict.fromkeys(self._unknown, ZERO)
        self._rows, self._ties = len(bodies), len(ties)
        self._row_jacobian = jacobian([*bodies, *ties], self._unknown)
        self._row_offset = [substitute(body, zero) for body in [*bodies, *ties]]
        keys = [VariableRef(name) for name in self.coordinates]
        speeds = [time_derivative(body, 1) for body in self.joints]
        self._joint_jacobian = jacobian(self.joints, keys)
        accelerations = dict.fromkeys(self._accelerations, ZERO)
        self._joint_rest = [substitute(time_derivative(s, 1), accelerations) for s in speeds]
        self._force_jacobian = jacobian(self.forces, self._z)

    # ------------------------------------------------------------------ numbers

    def _values(self, state: State) -> dict[object, FloatArray | float]:
        found: dict[object, FloatArray | float] = dict(self.numbers)
        for k, name in enumerate(self.coordinates):
            found[VariableRef(name)] = state.x[:, k]
            found[VariableRef(name, 1)] = state.v[:, k]
        for k, name in enumerate(self.auxiliaries):
            found[VariableRef(name)] = state.z[:, k]
        return found

    def _table(
        self, entries: Mapping[tuple[int, int], Expr], shape: tuple[int, int], state: State
    ) -> FloatArray:
        """(S, rows, columns) values of a sparse table of expressions."""
        found = np.zeros((len(state.x), *shape))
        values = evaluate_all(list(entries.values()), self._values(state))
        for (row, column), value in zip(entries, values):
            found[:, row, column] = value
        return found

    def _vector(self, bodies: Sequence[Expr], state: State) -> FloatArray:
        """(S, len(bodies)) values of expressions."""
        found = np.zeros((len(state.x), len(bodies)))
        for k, value in enumerate(evaluate_all(list(bodies), self._values(state))):
            found[:, k] = value
        return found

    def joint_positions(self, state: State) -> FloatArray:
        """(S, k) positions of the joints."""
        return self._vector(self.joints, state)

    def joint_map(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Joints' velocities are J v, their accelerations J x'' + r: (S, k, k) J and (S, k) r."""
        k = len(self.joints)
        jacobian_ = self._table(self._joint_jacobian, (k, len(self.coordinates)), state)
        return jacobian_, self._vector(self._joint_rest, state)

    def force_values(self, state: State) -> FloatArray:
        """(S, l) values of the actuator and outer force lines."""
        return self._vector(self.forces, state)

    def lawful(self, state: State) -> State:
        """The same positions and velocities with the nearest auxiliaries that satisfy the laws."""
        if not self.laws:
            return state
        z = state.z.copy()
        shape = (len(self.laws), len(self.auxiliaries))
        for _ in range(_LAW_STEPS):
            at = State(state.x, state.v, z)
            error = self._vector(self._law_bodies, at)
            slope = self._table(self._law_jacobian, shape, at)
            good = np.isfinite(error).all(axis=1) & np.isfinite(slope).all(axis=(1, 2))
            step = np.zeros_like(z)
            step[good] = -(np.linalg.pinv(slope[good]) @ error[good][..., None])[..., 0]
            z = z + step
            if np.all(np.abs(step) <= 1e-14 * (1.0 + np.abs(z))):
                break
        return State(state.x, state.v, z)

    def linear(self, state: State) -> Linear:
        """The dynamic equations in the accelerations of the coordinates at lawful states."""
        state = self.lawful(state)
        count, k = self._rows + self._ties, len(self.coordinates)
        matrix = self._table(self._row_jacobian, (count, len(self._unknown)), state)
        offset = self._vector(self._row_offset, state)
        rows, ties = matrix[:, : self._rows], matrix[:, self._rows :]
        if len(self._unknown) == k:
            return Linear(rows, offset[:, : self._rows], state)
        # Derivatives of auxiliaries follow from the derived laws: y = -pinv(T_y) (T_x x'' + t).
        finite = np.isfinite(ties).all(axis=(1, 2))
        solve = np.full((len(state.x), len(self._unknown) - k, self._ties), np.nan)
        if self._ties:
            solve[finite] = np.linalg.pinv(ties[finite][:, :, k:])
        else:
            solve = np.zeros_like(solve)
        through = rows[:, :, k:] @ solve
        rest = offset[:, : self._rows] - (through @ offset[:, self._rows :, None])[..., 0]
        return Linear(rows[:, :, :k] - through @ ties[:, :, :k], rest, state)

    @property
    def size(self) -> int:
        """Number of dynamic equations."""
        return self._rows


def _variables(bodies: Sequence[Expr]) -> list[str]:
    """Names of the variables in some expressions, in the order of first occurrence."""
    found: dict[str, None] = {}
    for body in bodies:
        for key in symbols(body):
            if isinstance(key, VariableRef):
                found.setdefault(key.name)
    return list(found)


def constant_values(problem: Problem, parameters: Mapping[str, float], t: float) -> dict[object, float]:
    """Values of all constants and parameters, by reference."""
    found: dict[object, float] = {ConstantRef(name): value for name, value in problem.constants.items()}
    found.update({ParameterRef(name): value for name, value in parameters.items()})
    found[TimeRef()] = t
    return found
