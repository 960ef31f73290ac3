"""Both sides of the equations of motion as tables: a row per joint, a column per term.

Each static force, product of velocities and damping has a column, evaluated at rest and at unit velocities.  If the
equations are undefined there (friction against the direction of a velocity is undefined at rest), static and
velocity-dependent forces share a column, evaluated at random velocities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass
from stc.studies.spec_equations import State
from stc.studies.terms import DAMPING, FORCE, MASS, PRODUCT, STATIC, TOGETHER, Term
from stc.validate.model_equations import ModelEquations

FloatArray = NDArray[np.float64]

#: Size of the force by which the share of each is measured, N or N m: the forces are linear in it.
_PULL = 10.0


@dataclass(frozen=True, slots=True)
class Sample:
    """The spec and the model at the same S states, in joint coordinates.

    The spec says ``matrix q'' + offset = 0``, the model ``mass q'' + bias = force``.
    """

    state: State
    q: FloatArray
    qd: FloatArray
    lines: FloatArray
    matrix: FloatArray
    offset: FloatArray
    mass: FloatArray
    bias: FloatArray
    force: FloatArray

    def first(self, count: int) -> Sample:
        """The first ``count`` states."""
        state = State(self.state.x[:count], self.state.v[:count], self.state.z[:count])
        arrays = (self.q, self.qd, self.lines, self.matrix, self.offset, self.mass, self.bias, self.force)
        return Sample(state, *(array[:count] for array in arrays))


@dataclass(frozen=True, slots=True)
class Tables:
    """Both sides taken apart at the positions of S states.

    Attributes:
        terms: the C columns: the mass matrix, one column without accelerations, then the others.
        spec: (S, k, C) according to the spec, rows as it writes them.
        model: (S, k, C) according to the model.
        base: the states of the column without accelerations.
        at_rest: whether what velocities do has columns of its own.
    """

    terms: list[Term]
    spec: FloatArray
    model: FloatArray
    base: Sample
    at_rest: bool


def static_words(mechanics: ModelEquations) -> str:
    """The names of a model's static forces."""
    return "static force (gravity and springs)" if mechanics.has_springs else "gravity"


class _NoValueError(Exception):
    """The equations have no value at some state that a column takes."""


class TakingApart:
    """Builds the tables of one phase."""

    def __init__(
        self,
        mechanics: ModelEquations,
        evaluated: Callable[[State], Sample | None],
        base: Sample,
        rows: Sequence[int],
        maps: FloatArray,
        forces: Sequence[str],
    ) -> None:
        """The source of the tables.

        Args:
            mechanics: the model.
            evaluated: spec and model at those of some states where both have values.
            base: states at which both have values.
            rows: which of the spec's equations.
            maps: (S, k, k) how velocities of the coordinates give those of the joints.
            forces: what gives each force, in words.
        """
        self.evaluated, self.base, self.rows, self.forces = evaluated, base, list(rows), forces
        self.joints, self.back = mechanics.joints, np.linalg.inv(maps)
        self.static = static_words(mechanics)
        self.terms: list[Term] = []
        self.spec: list[FloatArray] = []
        self.model: list[FloatArray] = []

    def tables(self) -> Tables | None:
        """The tables with as many columns as can be evaluated; None if no column can."""
        z, v = self.base.state.z, self.base.state.v
        still, quiet = np.zeros_like(v), np.zeros_like(z)
        for make, velocity, force in (
            (self._by_velocity, still, quiet),
            (self._together, v, quiet),
            (self._together, v, z),
        ):
            try:
                return make(velocity, force)
            except _NoValueError:
                continue
        return None

    def _at(self, v: FloatArray, z: FloatArray) -> Sample:
        """Spec and model at the positions, at other velocities and forces."""
        with np.errstate(all="ignore"):
            found = self.evaluated(State(self.base.state.x, v, z))
        if found is None or len(found.q) < len(self.base.q):
            raise _NoValueError
        return found

    def _sides(self, v: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The residuals of either side without accelerations, (S, k) each."""
        at = self._at(v, z)
        return at.offset[:, self.rows], at.bias - at.force

    def _column(self, kind: str, words: str, pair: Sequence[FloatArray]) -> None:
        self.terms.append(Term(kind, words))
        self.spec.append(pair[0])
        self.model.append(pair[1])

    def _begin(self, kind: str, words: str, without: Sample) -> None:
        """The mass matrix and the column without accelerations."""
        self.terms = [Term(MASS, "", joint) for joint in self.joints]
        self.spec = [*np.moveaxis(self.base.matrix[:, self.rows], 2, 0)]
        self.model = [*np.moveaxis(self.base.mass, 2, 0)]
        self._column(kind, words, (without.offset[:, self.rows], without.bias - without.force))

    def _made(self, base: Sample, *, at_rest: bool) -> Tables:
        return Tables(self.terms, np.stack(self.spec, axis=2), np.stack(self.model, axis=2), base, at_rest)

    def _by_velocity(self, still: FloatArray, quiet: FloatArray) -> Tables:
        """Each joint's velocity has columns of its own: differences around rest."""
        base = self._at(still, quiet)
        self._begin(STATIC, self.static, base)
        zero = self._sides(still, quiet)
        unit = np.eye(len(self.joints))
        ahead = [self._sides(self.back @ one, quiet) for one in unit]
        behind = [self._sides(self.back @ -one, quiet) for one in unit]
        for j, name in enumerate(self.joints):
            even = [0.5 * (a + b) - z for a, b, z in zip(ahead[j], behind[j], zero)]
            odd = [0.5 * (a - b) for a, b in zip(ahead[j], behind[j])]
            self._column(PRODUCT, f"velocity product {name}'^2", even)
            self._column(DAMPING, f"damping by {name}'", odd)
            for other in range(j):
                both = self._sides(self.back @ (unit[j] + unit[other]), quiet)
                cross = [c - a - b + z for c, a, b, z in zip(both, ahead[j], ahead[other], zero)]
                self._column(PRODUCT, f"velocity product {self.joints[other]}'*{name}'", cross)
        self._controls(still, quiet)
        return self._made(base, at_rest=True)

    def _together(self, v: FloatArray, z: FloatArray) -> Tables:
        """Static and velocity-dependent forces in one column, at random velocities."""
        base = self._at(v, z)
        self._begin(TOGETHER, TOGETHER, base)
        self._controls(v, z)
        return self._made(base, at_rest=False)

    def _controls(self, v: FloatArray, z: FloatArray) -> None:
        """Add a column for each force of the spec: how both sides of the equations change with it."""
        zero = self._sides(v, z)
        for m, words in enumerate(self.forces):
            pulled = z.copy()
            pulled[:, m] += _PULL
            given = [(b - a) / _PULL for a, b in zip(self._sides(v, pulled), zero)]
            self._column(FORCE, f"force of {words}", given)
