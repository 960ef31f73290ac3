"""Groups of statements and their derivatives as programs, which are cached for later processes.

Statements on the same nodes form a *group*.  The derivatives of a group's expressions depend on the expressions alone,
not on numbers or on the number of frames.  Computing them takes most of the time between a text and its machine code,
so the programs are cached beside the machine code (:mod:`stc.codegen.cache`), under a hash of the expressions.
"""

from __future__ import annotations

import marshal
import sys
from collections.abc import Sequence, Set
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stc.codegen import cache, engine
from stc.codegen.tape import Tape, build_tape
from stc.deadline import look
from stc.problem import ParameterRef, VariableRef
from stc.records import dataclass, field
from stc.symbolic.differentiate import gradient, hessian, jacobian
from stc.symbolic.expr import FUNCTIONS, Expr, call, reachable, sum_of, sym, symbols
from stc.symbolic.structure import degrees, mentioning
from stc.transcription.grid import IntArray, Nodes
from stc.transcription.lower import DataRef
from stc.transcription.statements import Row, Summand

REMEMBERED = 64
"""Number of groups whose derivatives this process keeps."""
GRADIENT, JACOBIAN, HESSIAN = 1, 2, 3


@dataclass(frozen=True, slots=True)
class MultiplierRef:
    """The multiplier of a group's row; a kernel input."""

    row: int


@dataclass(frozen=True, slots=True)
class ObjectiveFactor:
    """The factor of the objective in the Lagrangian; a kernel input shared by all nodes."""


class Derivative(NamedTuple):
    """One output of a kernel: an entry of the objective's gradient, the Jacobian or the Lagrangian's Hessian.

    ``row`` numbers the group's rows (Jacobian) or unknowns (Hessian), ``column`` its unknowns.
    """

    matrix: int
    row: int
    column: int


@dataclass(frozen=True, slots=True)
class Derived:
    """The derivatives of a group's statements.

    Attributes:
        values_tape: the rows, then the objective, then function values that derivatives reuse.
        derivatives_tape, constants_tape: ``varying`` and ``constant``; the node inputs of the former are unknowns,
            data, multipliers and reused values, of the latter data.
        kept: number of reused values.
        varying, constant: the objective's gradient, the Jacobian and the lower triangle of the Lagrangian's Hessian,
            nonzeros only: those that change during a solve, and those that do not.
        degrees, objective_degree: of the rows and the objective as polynomials; see :mod:`stc.symbolic.structure`.
        bent: the unknowns, by number, by which second derivatives change with unknowns or multipliers.
    """

    values_tape: Tape
    derivatives_tape: Tape
    constants_tape: Tape
    kept: int
    varying: list[Derivative]
    constant: list[Derivative]
    degrees: list[int]
    objective_degree: int
    bent: list[int]


@dataclass(slots=True)
class Group:
    """Statements on the same nodes, and their kernels.

    ``unknown`` and ``data`` are the inputs that vary from node to node; ``positions`` (len(unknown), k) are the
    positions of each node's decision variables.  ``row_ids`` (rows, k) numbers the rows in the nonlinear program.
    """

    nodes: Nodes
    rows: list[Row]
    summands: list[Summand]
    unknown: list[VariableRef | ParameterRef] = field(default_factory=list)
    data: list[DataRef] = field(default_factory=list)
    positions: IntArray = field(default_factory=lambda: np.zeros((0, 0), np.int64))
    row_ids: IntArray = field(default_factory=lambda: np.zeros((0, 0), np.int64))
    objective: Expr | None = None
    derived: Derived | None = None

    @property
    def size(self) -> int:
        return len(self.nodes)

    @property
    def programs(self) -> Derived:
        """The result of :func:`derive`."""
        assert self.derived is not None
        return self.derived

    @property
    def bodies(self) -> list[Expr]:
        """The expressions of the rows, then that of the objective if there is one."""
        return [row.body for row in self.rows] + ([] if self.objective is None else [self.objective])

    def take_inputs(self) -> None:
        """Record the inputs of the statements."""
        if self.summands:
            self.objective = sum_of([s.body for s in self.summands])
        seen: dict[object, None] = {}
        for e in self.bodies:
            seen.update(dict.fromkeys(symbols(e)))
        self.unknown = [k for k in seen if isinstance(k, VariableRef | ParameterRef)]
        self.data = [k for k in seen if isinstance(k, DataRef)]

    def differentiate(self, uniform: Sequence[object]) -> Derived:
        """The derivatives and their programs, from the expressions."""
        bodies = [row.body for row in self.rows]
        keys: list[object] = list(self.unknown)
        of_bodies = degrees(self.bodies, keys)
        of_rows, objective_degree = of_bodies[: len(bodies)], 0
        entries: dict[Derivative, Expr] = {}
        if self.objective is not None:
            objective_degree = of_bodies[-1]
            slopes = gradient(self.objective, keys)
            entries.update((Derivative(GRADIENT, 0, k), e) for k, e in enumerate(slopes) if not _is_zero(e))
        curved = [sym(MultiplierRef(r)) * e for r, e in enumerate(bodies) if of_rows[r] > 1]
        if self.objective is not None and objective_degree > 1:
            curved.append(sym(ObjectiveFactor()) * self.objective)
        first, second = jacobian(bodies, keys), hessian(sum_of(curved), keys)
        entries.update((Derivative(JACOBIAN, r, k), e) for (r, k), e in first.items())
        entries.update((Derivative(HESSIAN, a, b), e) for (a, b), e in second.items())
        changes = mentioning(list(second.values()), _changes)
        changing = {place for place, does in zip(second, changes, strict=True) if does}
        varies = mentioning(list(entries.values()), _varies)
        varying = [place for place, does in zip(entries, varies, strict=True) if does]
        constant = [place for place, does in zip(entries, varies, strict=True) if not does]
        inputs: list[object] = [*self.unknown, *self.data]
        multipliers = [MultiplierRef(r) for r in range(len(self.rows))]
        kept = _kept(self.bodies, [entries[place] for place in varying], frozenset(inputs))
        return Derived(
            values_tape=build_tape([*self.bodies, *kept], uniform, inputs),
            derivatives_tape=build_tape(
                [entries[place] for place in varying], uniform, [*inputs, *multipliers, *kept]
            ),
            constants_tape=build_tape([entries[place] for place in constant], uniform, self.data),
            kept=len(kept),
            varying=varying,
            constant=constant,
            degrees=of_rows,
            objective_degree=objective_degree,
            bent=sorted({k for place in changing for k in place}),
        )


_PARTNER = {"sin": "cos", "cos": "sin"}
"""Pairs of functions whose joint evaluation takes hardly longer than one."""


def _kept(bodies: Sequence[Expr], derivatives: Sequence[Expr], inputs: Set[object]) -> list[Expr]:
    """The function values that the derivatives need and the values kernel computes, or nearly computes.

    A function takes as long as ten or twenty operations, and storing its result takes one or two.
    """
    had = set(reachable(bodies))
    had_nearly = [
        node
        for node in reachable(derivatives)
        if node.op in FUNCTIONS
        and (node in had or (node.op in _PARTNER and call(_PARTNER[node.op], node.args[0]) in had))
    ]
    vary = mentioning(had_nearly, lambda key: key in inputs)
    return [node for node, does in zip(had_nearly, vary, strict=True) if does]


def derive(groups: Sequence[Group], uniform: Sequence[object]) -> None:
    """Find the derivatives of all groups: in this process, on disk, or by differentiating.

    Args:
        groups: any; ``unknown``, ``data``, ``objective`` and ``derived`` are set.
        uniform: the kernels' inputs that all nodes share.
    """
    for group in groups:
        group.take_inputs()
    # Expressions are unique: the same motion on another number of frames asks for the same derivatives.
    keys = [(tuple(group.bodies), group.objective is None, tuple(uniform)) for group in groups]
    missing = {key: group for key, group in zip(keys, groups, strict=True) if key not in _remembered}
    if missing:
        name = _name_of(list(missing.values()), uniform)
        found = _load(name, len(missing))
        if found is None:
            found = []
            for group in missing.values():
                look()
                found.append(group.differentiate(uniform))
            cache.store(name, marshal.dumps([_plain(one) for one in found]))
        _remembered.update(zip(missing, found, strict=True))
    for key, group in zip(keys, groups, strict=True):
        group.derived = _remembered.pop(key)
        _remembered[key] = group.derived  # the last one used comes last
    while len(_remembered) > max(REMEMBERED, len(groups)):
        del _remembered[next(iter(_remembered))]


_remembered: dict[tuple[object, ...], Derived] = {}


def _name_of(groups: Sequence[Group], uniform: Sequence[object]) -> str:
    """A hash of the groups' expressions, of the inputs that are uniform, and of the code that differentiates them."""
    number: dict[Expr, int] = {}
    lines = []
    for node in reachable(e for group in groups for e in group.bodies):
        number[node] = len(number)
        operands = " ".join([str(number[arg]) for arg in node.args])
        lines.append(f"{node.op} {operands}" if operands else f"{node.op} {node.payload!r}")
    for group in groups:
        bodies = " ".join([str(number[e]) for e in group.bodies])
        lines.append(f"group {len(group.rows)} {bodies}")
    return cache.key_of("derivatives", sys.version, _own_digest(), repr(list(uniform)), "\n".join(lines))


@lru_cache(maxsize=1)
def _own_digest() -> str:
    """Hash of the code on which the kept data depends."""
    package = Path(__file__).parent.parent
    sources = [Path(__file__), *(package / "symbolic").rglob("*.py")]
    return cache.key_of(engine.own_digest(), engine.digest_of(sources))


def _plain(derived: Derived) -> tuple[Any, ...]:
    """The result of :func:`derive` as numbers, texts, lists and tuples alone, to be kept in a file."""
    tapes = [
        (tape.n_uniform, tape.n_varying, tape.constants, tape.ops, tape.outputs, tape.uniform_ops)
        for tape in (derived.values_tape, derived.derivatives_tape, derived.constants_tape)
    ]
    places = [[tuple(place) for place in places] for places in (derived.varying, derived.constant)]
    return tapes, derived.kept, places, derived.degrees, derived.objective_degree, derived.bent


def _derived(
    tapes: Any, kept: int, places: Any, degrees: list[int], objective_degree: int, bent: list[int]
) -> Derived:
    """The result of :func:`derive`, from what :func:`_plain` made of it."""
    values, derivatives, constants = (Tape(*tape) for tape in tapes)
    varying, constant = ([Derivative(*place) for place in some] for some in places)
    return Derived(values, derivatives, constants, kept, varying, constant, degrees, objective_degree, bent)


def _load(name: str, count: int) -> list[Derived] | None:
    """The cached content under a name, None if there is none or it is invalid."""
    kept = cache.load(name)
    if kept is None:
        return None
    try:
        found = [_derived(*plain) for plain in marshal.loads(kept)]
    except (ValueError, TypeError, EOFError):
        return None
    return found if len(found) == count else None


def _changes(key: object) -> bool:
    """Whether a symbol's value changes as a program is solved."""
    return isinstance(key, VariableRef | ParameterRef | MultiplierRef)


def _varies(key: object) -> bool:
    """Whether a symbol's value changes while a program with its numbers is in use."""
    return _changes(key) or isinstance(key, ObjectiveFactor)


def _is_zero(e: Expr) -> bool:
    return e.op == "num" and e.payload == 0.0
