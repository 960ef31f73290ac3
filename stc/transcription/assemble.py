"""From lowered statements to kernels, index tables and the sparsity of the nonlinear program.

Statements on the same nodes form a *group* (:mod:`stc.transcription.derive`): one kernel evaluates them,
LANES nodes at a time.  Each kernel reads its inputs from one workspace through an index table and writes its outputs in
blocks; a gather then adds the outputs up to rows, gradient, Jacobian and Hessian entries::

    workspace = | decision variables | multipliers | group 0: [node][data] | group 1 | ... | copies |
    buffer    = | group 0: [block][output][lane] | group 1 | ... | constants of group 0 | ...

Derivatives that do not depend on unknowns, multipliers or the factor of the objective are constants: they have a
separate part of the buffer, which is filled once, when numbers are bound.

Everything here depends on the text and on structural constants only; numbers are bound in
:mod:`stc.transcription.bind`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.codegen.engine import LANES
from stc.codegen.runs import RUN, Runs, find_runs
from stc.codegen.tape import Tape
from stc.problem import ConstantRef
from stc.records import dataclass, field
from stc.symbolic.expr import tables
from stc.transcription.derive import (
    GRADIENT,
    HESSIAN,
    JACOBIAN,
    Derivative,
    Group,
    ObjectiveFactor,
    derive,
)
from stc.transcription.gather import Folding
from stc.transcription.grid import IntArray
from stc.transcription.grouping import build_groups, number_rows
from stc.transcription.layout import Layout
from stc.transcription.statements import Statements

AT_ONCE = 1_000_000
"""Number of output places that are processed together."""


class _Outputs:
    """The matrix, and the position in it, of each output in a buffer of kernels."""

    def __init__(self, size: int) -> None:
        self.matrix = np.zeros(size, np.int8)  # 0: none, as where there are no nodes
        self.rows = np.empty(size, np.int32)
        self.cols = np.empty(size, np.int32)
        self.doubled: list[IntArray] = []

    def add_all(self, group: Group, derivatives: Sequence[Derivative], start: int) -> None:
        """All outputs of a group's kernel at ``start``, some at a time where there are many nodes."""
        some = max(1, AT_ONCE // max(1, group.size))
        for first in range(0, len(derivatives), some):
            self._add(group, derivatives[first : first + some], start, len(derivatives), first)

    def _add(
        self, group: Group, derivatives: Sequence[Derivative], start: int, width: int, first: int
    ) -> None:
        """Add the entries of one group: ``width`` of them, from number ``first`` on."""
        matrix, row, column = np.array(derivatives).T
        cols = group.positions[column]
        rows = np.zeros_like(cols)
        of_jacobian, of_hessian = matrix == JACOBIAN, np.flatnonzero(matrix == HESSIAN)
        rows[of_jacobian] = group.row_ids[row[of_jacobian]]
        one, other = group.positions[row[of_hessian]], cols[of_hessian]
        rows[of_hessian], cols[of_hessian] = np.maximum(one, other), np.minimum(one, other)
        # Two inputs that are one unknown at a node: the entry and its mirror count there.
        apart = (row != column)[of_hessian]
        number, node = np.nonzero((one == other) & apart[:, None])
        output = first + of_hessian[number]
        self.doubled.append(start + (node // LANES * width + output) * LANES + node % LANES)

        count, size = cols.shape
        whole, rest = divmod(size, LANES)
        kinds = np.repeat(matrix[:, None], size, axis=1)
        for entries, values in ((self.matrix, kinds), (self.rows, rows), (self.cols, cols)):
            of_kernel = entries[start : start + -(-size // LANES) * width * LANES].reshape(-1, width, LANES)
            ours = of_kernel[:, first : first + count]
            ours[:whole] = values[:, : size - rest].reshape(count, whole, LANES).transpose(1, 0, 2)
            if rest:
                ours[whole, :, :rest] = values[:, size - rest :]


@dataclass(slots=True)
class Sparsity:
    """Entries of a sparse matrix in coordinate form, and their positions in a kernels' buffer.

    ``rows``, ``cols``, ``first`` (nnz,) int32: entry e is at ``buffer[first[e]]`` after ``folding``, which is made
    of each evaluation, and ``constant_folding``, which is made once.  The entries are in the order of the buffer, so
    that most come from consecutive places, and the constants among them last.
    """

    rows: NDArray[np.int32]
    cols: NDArray[np.int32]
    first: NDArray[np.int32]
    folding: Folding
    constant_folding: Folding

    @classmethod
    def of(cls, outputs: _Outputs, matrix: int, constants: int) -> Sparsity:
        """One of the matrices, with each position once; from ``constants`` on the buffer's positions are constants."""
        held = np.flatnonzero(outputs.matrix == matrix)
        r, c, place = outputs.rows[held], outputs.cols[held], held.astype(np.int32)
        code = r * (np.int64(c.max(initial=0)) + 1) + c
        order = np.argsort(code, kind="stable")
        code = code[order]
        new = np.ones(len(code), bool)
        np.not_equal(code[1:], code[:-1], out=new[1:])
        twice = np.concatenate([held[:0], *(outputs.doubled if matrix == HESSIAN else ())])
        if new.all():
            return cls(r, c, place, *_foldings(np.zeros(1, np.int64), held[:0], twice, constants))
        count = np.diff(np.flatnonzero(new), append=len(code))
        several = count > 1
        start = np.concatenate([[0], np.cumsum(count[several])])
        foldings = _foldings(start, held[order[np.repeat(several, count)]], twice, constants)
        first = np.zeros(len(place), bool)
        first[order[new]] = True
        return cls(r[first], c[first], place[first], *foldings)

    def __len__(self) -> int:
        return len(self.rows)


def _foldings(
    start: IntArray, source: IntArray, doubled: IntArray, constants: int
) -> tuple[Folding, Folding]:
    """The foldings made at each evaluation, and those made once.

    An entry's places are in the order of the buffer: its sum goes to one that varies, if any does.
    """
    once = source[start[:-1]] >= constants
    count = np.diff(start)

    def those(wanted: NDArray[np.bool_], twice: NDArray[np.bool_]) -> Folding:
        begins = np.concatenate([[0], np.cumsum(count[wanted])])
        return Folding.of(begins, source[np.repeat(wanted, count)], doubled[twice])

    return those(~once, doubled < constants), those(once, doubled >= constants)


@dataclass(slots=True)
class Program:
    """The nonlinear program's structure: groups, tables and sparsity.

    Attributes:
        runs: of the inputs of the groups' values kernels, then of their derivatives kernels.
        index_values, index_derivatives: per group (blocks, runs, LANES) int32 where they begin in the workspace.
        data_start: per group where its node data begins in the workspace, (nodes, data).
        row_group, row_number, row_instance: (m,) where each row comes from.
        values_start, derivatives_start, constants_start: per group where its outputs begin in a buffer.
        values_size, derivatives_size: of the two buffers; constants take the rest of the second one.
        varying_size: where in the second one constants begin.
        row_source: (m,) int32 where each row is in the values kernels' buffer.
        objective_source: int32 places there that add up to the objective.
        fixed_curvature: (size,) variables by which all second derivatives are constants.
        wanted: how all of its numbers, or those of a part, leave the kernels (:mod:`stc.transcription.wanted`),
            which is found once for all constants.
    """

    groups: list[Group]
    size: int
    row_count: int
    uniform: list[object]
    row_stage: NDArray[np.int32]
    row_linear: NDArray[np.bool_]
    row_group: IntArray
    row_number: IntArray
    row_instance: IntArray
    workspace_size: int
    data_start: list[int]
    runs: list[Runs]
    index_values: list[NDArray[np.int32]]
    index_derivatives: list[NDArray[np.int32]]
    values_start: list[int]
    derivatives_start: list[int]
    constants_start: list[int]
    values_size: int
    varying_size: int
    derivatives_size: int
    row_source: NDArray[np.int32]
    objective_source: NDArray[np.int32]
    gradient: Sparsity
    jacobian: Sparsity
    hessian: Sparsity
    objective_degree: int
    fixed_curvature: NDArray[np.bool_]
    wanted: list[Any] = field(default_factory=list)


def assemble(
    statements: Statements, layout: Layout, constants: Sequence[str], with_tables: bool = False
) -> Program:
    """Derive every group, and lay out workspace, buffers and sparsity.

    Args:
        statements: lowered rows and objective.
        layout: of the decision variables.
        constants: names of all constants, the kernels' uniform inputs in this order.
        with_tables: whether there may be tables in the statements.
    """
    groups = build_groups(statements)
    used = (
        tables([*(r.body for r in statements.rows), *(s.body for s in statements.summands)])
        if with_tables
        else []
    )
    uniform: list[object] = [*(ConstantRef(name) for name in constants), *used, ObjectiveFactor()]
    derive(groups, uniform)
    for group in groups:
        group.positions = np.array(
            [layout.position(k, group.nodes) for k in group.unknown], np.int64
        ).reshape(len(group.unknown), group.size)
    row_stage, row_group, row_number, row_instance = number_rows(groups)
    row_linear = _linear(groups, row_group, row_number)
    m, n = len(row_stage), layout.size
    at = n + m
    data_start, inputs = [], []
    for group in groups:
        data_start.append(at)
        data = at + np.arange(group.size * len(group.data)).reshape(group.size, len(group.data)).T
        at += data.size
        inputs.append(np.concatenate([group.positions, data, n + group.row_ids]))
    of_values = [
        find_runs(g.programs.values_tape, each[: len(each) - len(g.rows)])
        for g, each in zip(groups, inputs, strict=True)
    ]
    of_derivatives = []
    for g, each in zip(groups, inputs, strict=True):
        width = len(g.programs.values_tape.outputs)
        kept = (width - g.programs.kept, width) if g.programs.kept else (0, 0)
        of_derivatives.append(find_runs(g.programs.derivatives_tape, each, kept))
    values_start, values_size = _starts(groups, [g.programs.values_tape for g in groups])
    derivatives_start, varying_size = _starts(groups, [g.programs.derivatives_tape for g in groups])
    constants_start, derivatives_size = _starts(
        groups, [g.programs.constants_tape for g in groups], varying_size
    )
    row_source = np.zeros(m, np.int32)
    objective_source: list[IntArray] = []
    outputs = _Outputs(derivatives_size)
    for k, (group, start) in enumerate(zip(groups, values_start, strict=True)):
        width = len(group.programs.values_tape.outputs)
        for r in range(len(group.rows)):
            row_source[group.row_ids[r]] = outputs_at(start, width, r, group.size)
        if group.objective is not None:
            objective_source.append(outputs_at(start, width, len(group.rows), group.size))
        outputs.add_all(group, group.programs.varying, derivatives_start[k])
        outputs.add_all(group, group.programs.constant, constants_start[k])
    fixed = np.ones(n, bool)
    for group in groups:
        fixed[group.positions[group.programs.bent]] = False
    degrees = [g.programs.objective_degree for g in groups if g.objective is not None]
    return Program(
        groups=groups,
        size=n,
        row_count=m,
        uniform=uniform,
        row_stage=row_stage,
        row_linear=row_linear,
        row_group=row_group,
        row_number=row_number,
        row_instance=row_instance,
        workspace_size=at + RUN - 1,
        data_start=data_start,
        runs=[runs for runs, _ in (*of_values, *of_derivatives)],
        index_values=[blocks(starts, np.int32) for _, starts in of_values],
        index_derivatives=[blocks(starts, np.int32) for _, starts in of_derivatives],
        values_start=values_start,
        derivatives_start=derivatives_start,
        constants_start=constants_start,
        values_size=values_size,
        varying_size=varying_size,
        derivatives_size=derivatives_size,
        row_source=row_source,
        objective_source=np.concatenate([np.zeros(0, np.int32), *objective_source]).astype(np.int32),
        gradient=Sparsity.of(outputs, GRADIENT, varying_size),
        jacobian=Sparsity.of(outputs, JACOBIAN, varying_size),
        hessian=Sparsity.of(outputs, HESSIAN, varying_size),
        objective_degree=max(degrees, default=0),
        fixed_curvature=fixed,
    )


def data_of(workspace: NDArray[np.float64], group: Group, start: int) -> NDArray[np.float64]:
    """A group's node data in the workspace, from ``start`` on: a view (data, nodes)."""
    count = len(group.data)
    return workspace[start : start + group.size * count].reshape(group.size, count).T


def outputs_at(start: int, width: int, output: int, size: int) -> IntArray:
    """Buffer positions of one output of a kernel with ``width`` outputs for its ``size`` nodes. (size,)"""
    k = np.arange(size)
    return start + (k // LANES) * (width * LANES) + output * LANES + k % LANES


def blocks(table: NDArray[Any], dtype: type[np.generic]) -> NDArray[Any]:
    """The values of each of k nodes, (rows, k), as (blocks, rows, LANES); the last node fills the last block."""
    rows, size = table.shape
    count = -(-size // LANES)
    padded = np.concatenate([table, np.repeat(table[:, -1:], count * LANES - size, axis=1)], axis=1)
    return np.ascontiguousarray(padded.reshape(rows, count, LANES).transpose(1, 0, 2), dtype)


def _starts(groups: Sequence[Group], tapes: Sequence[Tape], at: int = 0) -> tuple[list[int], int]:
    """The start of each group's outputs in a buffer, from ``at`` on, and the end of all."""
    starts = []
    for group, tape in zip(groups, tapes, strict=True):
        starts.append(at)
        at += -(-group.size // LANES) * LANES * len(tape.outputs)
    return starts, at


def _linear(groups: Sequence[Group], row_group: IntArray, row_number: IntArray) -> NDArray[np.bool_]:
    """Which rows are affine, (m,), given the group of each and its number there."""
    degrees = np.concatenate([np.zeros(0, np.int64), *(g.programs.degrees for g in groups)])
    first = np.cumsum([0, *(len(group.rows) for group in groups)])
    return np.asarray(degrees[first[row_group] + row_number] <= 1)
