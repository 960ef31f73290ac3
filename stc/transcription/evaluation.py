"""The calls of a program's evaluators: scaled variables in, kernels, scaled entries out.

Large steps are divided into pieces that two threads share; the results have the same bits either way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen import threads
from stc.codegen.kernel import LANES, KernelSet, compile_tapes
from stc.core.calls import Bound, chain, chain_until
from stc.solver.evaluator import Evaluator, Indices, Part, Scaling
from stc.transcription.assemble import Program, blocks
from stc.transcription.gather import add_up, all_same, begin, note, place, total
from stc.transcription.wanted import Wanted

FloatArray = NDArray[np.float64]

#: Operations of kernels, on all nodes together, and numbers copied, that take about 10 microseconds: a piece.
OPERATIONS = 300_000
NUMBERS = 40_000
#: A piece's outputs, which are copied before they leave the processor's own cache (of 128 kB).
OUTPUTS = 16_000
#: Fewer pieces are left to one thread: waking another one up, and waiting for it, would take as long.
SHARED = 12


class Piece(NamedTuple):
    """A call of a kernel, the range of its outputs in a buffer, and its number of operations."""

    call: Bound
    begin: int
    end: int
    operations: int


def kernel_calls(
    program: Program,
    kernels: KernelSet,
    workspace: FloatArray,
    uniform: FloatArray,
    buffers: tuple[FloatArray, FloatArray],
    values: bool,
    cut: bool = False,
) -> list[Piece]:
    """Calls of the kernels of all groups, those of values or those of derivatives, whole or in pieces.

    Their outputs follow one another in the ``buffers``, of values and of derivatives.
    """
    starts, indices, buffer = program.derivatives_start, program.index_derivatives, buffers[1]
    if values:
        starts, indices, buffer = program.values_start, program.index_values, buffers[0]
    calls = []
    for k, (index, start) in enumerate(zip(indices, starts, strict=True)):
        number = k if values else k + len(program.groups)
        tape = kernels.tapes[number]
        count = len(tape.outputs)
        blocks, _, lanes = index.shape
        width = count * lanes
        if width and blocks:
            out = _in_blocks(buffer, start, blocks, count, lanes)
            kept = None
            if not values:
                # All that the values kernel finds is there; the derivatives kernel knows what it needs of it.
                found = len(kernels.tapes[k].outputs)
                kept = _in_blocks(buffers[0], program.values_start[k], blocks, found, lanes)
            work = lanes * len(tape.ops)
            pieces = max(blocks * work / OPERATIONS, blocks * width / OUTPUTS) if cut else 1
            for piece in _pieces(blocks, pieces, 2):
                given = None if kept is None else kept[piece]
                call = kernels[number].bind(workspace, uniform, index[piece], out[piece], given)
                ends = start + piece.start * width, start + piece.stop * width
                calls.append(Piece(call, *ends, work * (piece.stop - piece.start)))
    return calls


def _in_blocks(buffer: FloatArray, start: int, *shape: int) -> FloatArray:
    """A kernel's outputs, which begin at ``start``: a view (blocks, outputs, lanes)."""
    return buffer[start : start + math.prod(shape)].reshape(shape)


def _together(pieces: Sequence[Piece]) -> Iterator[list[Piece]]:
    """Consecutive pieces merged up to a size, since copying their outputs takes some calls each time."""
    some: list[Piece] = []
    operations = 0
    for piece in pieces:
        operations += piece.operations
        if some and (piece.end - some[0].begin > OUTPUTS or operations > OPERATIONS):
            yield some
            some, operations = [], piece.operations
        some.append(piece)
    if some:
        yield some


def fill_constants(program: Program, workspace: FloatArray, uniform: FloatArray, buffer: FloatArray) -> None:
    """Evaluate the constant derivatives into their part of ``buffer``, and sum those of one entry.

    That is done once, and takes less time by interpreting than compiling it would.
    """
    for group, data_start, start in zip(
        program.groups, program.data_start, program.constants_start, strict=True
    ):
        tape = group.programs.constants_tape
        if tape.outputs and group.size:
            width = len(group.data)
            places = data_start + np.arange(width)[:, None] + width * np.arange(group.size)
            index = blocks(places, np.int32)
            out = _in_blocks(buffer, start, len(index), len(tape.outputs), LANES)
            compile_tapes([tape], backend="interpreter")[0](workspace, uniform, index, out)
    for matrix in (program.gradient, program.jacobian, program.hessian):
        for call in matrix.constant_folding.bind(buffer):
            call()


def _pieces(count: int, pieces: float, multiple: int = 8) -> Iterator[slice]:
    """Divide a range into slices of whole multiples."""
    if count <= multiple or pieces <= 1:
        yield slice(0, count)
        return
    step = multiple * int(np.ceil(count / np.ceil(pieces) / multiple))
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


def _effort(program: Program, kernels: KernelSet, values: bool) -> float:
    """The number of pieces (see ``OPERATIONS``) that an evaluation amounts to."""
    first = 0 if values else len(program.groups)
    operations = sum(group.size * len(kernels.tapes[first + k].ops) for k, group in enumerate(program.groups))
    numbers = program.values_size if values else program.varying_size
    return operations / OPERATIONS + (program.size + program.row_count + numbers) / NUMBERS


class _Steps:
    """Collects the phases of one evaluator's calls."""

    def __init__(
        self, status: FloatArray, counter: NDArray[np.int64], shared: bool, pace: threads.Record
    ) -> None:
        self.status, self.counter, self.shared, self.pace = status, counter, shared, pace
        self.phases: list[list[Bound]] = []
        self.cells: list[FloatArray] = []
        self.same = np.zeros(0, np.int64)

    def cell(self) -> FloatArray:
        """The cell in which a call records that its numbers are not finite; a separate one for simultaneous calls."""
        if not self.shared:
            return self.status
        self.cells.append(np.zeros(8)[:1])  # a cache line each
        return self.cells[-1]

    def cut(self, count: int) -> Iterator[slice]:
        return _pieces(count, count / NUMBERS if self.shared else 1)

    def note(self, variables: FloatArray, noted: FloatArray) -> list[Bound]:
        """Record the variables, and in ``same`` whether they were recorded already."""
        cuts = list(self.cut(len(variables)))
        self.same = np.zeros(len(cuts), np.int64)
        return [note(variables[at], noted[at], self.same[k : k + 1]) for k, at in enumerate(cuts)]

    def place(self, values: FloatArray, scale: FloatArray, into: FloatArray) -> list[Bound]:
        return [place(values[at], scale[at], into[at]) for at in self.cut(len(values))]

    def place_variables(
        self, values: FloatArray, scale: FloatArray, its: Wanted, into: FloatArray
    ) -> list[Bound]:
        """Place a part's variables among the others, which do not change."""
        if its.part is None:
            return self.place(values, scale, into)
        others = its.others(len(into))
        return [
            *self._spread(its, its.part.x[others], np.ones(len(others)), others, into),
            *self._spread(its, values, scale, its.part.cols, into),
        ]

    def place_multipliers(
        self, values: FloatArray, scale: FloatArray, its: Wanted, into: FloatArray
    ) -> list[Bound]:
        """Place the multipliers of a part's rows; entries of a part do not depend on other rows' multipliers."""
        if its.part is None:
            return self.place(values, scale, into)
        return self._spread(its, values, scale, its.part.rows, into)

    def _spread(
        self, its: Wanted, values: FloatArray, scale: FloatArray, at: Indices, into: FloatArray
    ) -> list[Bound]:
        return [
            chain(calls)
            for piece in self.cut(len(at))
            if (calls := its.spread(at, piece).bind(values[piece], scale[piece], into, self.cell()))
        ]

    def collect(self, its: Wanted, buffer: FloatArray, scale: FloatArray, out: FloatArray) -> list[Bound]:
        return [
            chain(its.rows(at).bind(buffer, scale[at], out[at], self.cell()))
            for at in self.cut(len(its.row_source))
        ]

    def call(self) -> Bound:
        calls = [begin(self.status, self.counter)]
        if self.shared:
            calls.append(threads.parallel(self.phases, self.pace))
            calls += [add_up(cell, self.status) for cell in self.cells]
        else:
            calls += [call for phase in self.phases for call in phase]
        return chain(calls)


class Evaluation:
    """The kernels of a program with its numbers, and what their calls share, whatever the scaling.

    Attributes:
        workspace, uniform: what kernels read; ``factor``, (1,), is the objective's among the latter.
        values_buffer, derivatives_buffer: what they write.
        keeps: whether the derivatives kernels take what the values kernels have found; ``noted`` are the variables
            that these were evaluated for, (n,).
        foldings: what adds up outputs of gradient, Jacobian and Hessian.
        values_kernels, derivatives_kernels: the kernels alone: what is at ``workspace`` in, their buffers out.
        counts: how often values and derivatives were evaluated.
        paces: how long these take on one thread and on two.
    """

    def __init__(
        self, program: Program, kernels: KernelSet, workspace: FloatArray, uniform: FloatArray
    ) -> None:
        self.program, self.kernels, self.workspace, self.uniform = program, kernels, workspace, uniform
        self.n, self.m = program.size, program.row_count
        self.factor = uniform[len(program.uniform) - 1 : len(program.uniform)]
        self.values_buffer = aligned_zeros(program.values_size)
        self.derivatives_buffer = aligned_zeros(program.derivatives_size)
        fill_constants(program, workspace, uniform, self.derivatives_buffer)
        self.keeps = any(group.programs.kept for group in program.groups)
        self.noted = np.full(self.n, np.nan)  # for none yet
        self._wanted: list[tuple[Part | None, Wanted]] = []
        self._pieces: dict[tuple[bool, bool], list[Piece]] = {}
        matrices = program.gradient, program.jacobian, program.hessian
        self.foldings = [matrix.folding.bind(self.derivatives_buffer) for matrix in matrices]
        self.values_kernels = chain([piece.call for piece in self.pieces(values=True, cut=False)])
        self.derivatives_kernels = chain([piece.call for piece in self.pieces(values=False, cut=False)])
        self.counts = np.zeros(2, np.int64)
        self.paces = threads.record(), threads.record()

    @property
    def evaluations(self) -> int:
        """The number of evaluations of objective and rows."""
        return int(self.counts[0])

    @property
    def derivative_evaluations(self) -> int:
        """The number of evaluations of derivatives."""
        return int(self.counts[1])

    def wanted(self, part: Part | None) -> Wanted:
        """The requested part of the program, and how it leaves the kernels; the last two are kept."""
        for other, known in self._wanted:
            if other is part:
                return known
        made = Wanted.of(self.program, part)
        self._wanted[:] = [*self._wanted[-1:], (part, made)]
        return made

    def pieces(self, values: bool, cut: bool) -> list[Piece]:
        """See :func:`kernel_calls`."""
        if (values, cut) not in self._pieces:
            buffers = self.values_buffer, self.derivatives_buffer
            common = self.program, self.kernels, self.workspace, self.uniform
            self._pieces[values, cut] = kernel_calls(*common, buffers, values, cut)
        return self._pieces[values, cut]


def evaluator(nlp: Evaluation, scaling: Scaling, part: Part | None = None) -> Evaluator:
    """Arrays for one scaling, and the calls that fill them; for a part of the program, if one is given."""
    its = nlp.wanted(part)
    result = Evaluator.allocate(len(scaling.variable), len(scaling.row), len(its.jacobian), len(its.hessian))
    objective = np.array([scaling.objective])
    result.values_call = _values_call(nlp, its, scaling, objective, result)
    result.derivatives_call = _derivatives_call(nlp, its, scaling, objective, result)
    return result


def unless(condition: Bound, calls: Sequence[Bound]) -> Bound:
    """A call that makes the others if the first one returns 0."""
    return chain_until([(condition, True), *((call, False) for call in calls)])


def _shared(nlp: Evaluation, values: bool) -> bool:
    return (
        nlp.kernels.backend == "llvm"
        and _effort(nlp.program, nlp.kernels, values) >= SHARED
        and threads.allowed() > 1
    )


def _values_call(
    nlp: Evaluation, its: Wanted, scaling: Scaling, objective: FloatArray, result: Evaluator
) -> Bound:
    buffer, shared = nlp.values_buffer, _shared(nlp, values=True)
    steps = _Steps(result.values_status, nlp.counts[:1], shared, nlp.paces[0])
    variables = nlp.workspace[: nlp.n]
    steps.phases = [
        steps.place_variables(result.x, scaling.variable, its, variables),
        steps.note(variables, nlp.noted) if nlp.keeps else [],
        [piece.call for piece in nlp.pieces(values=True, cut=shared)],
        [
            total(buffer, nlp.program.objective_source, objective, result.f, steps.cell()),
            *steps.collect(its, buffer, scaling.row, result.r),
        ],
    ]
    return steps.call()


def _derivatives_call(
    nlp: Evaluation, its: Wanted, scaling: Scaling, objective: FloatArray, result: Evaluator
) -> Bound:
    program, buffer = nlp.program, nlp.derivatives_buffer
    n, m = nlp.n, nlp.m
    scales = (
        scaling.gradient()[its.gradient.cols],
        scaling.jacobian(its.jacobian.rows, its.jacobian.cols),
        scaling.hessian(its.hessian.rows, its.hessian.cols),
    )
    outs = result.gradient, result.jac, result.hess
    shared = _shared(nlp, values=False)
    steps = _Steps(result.derivatives_status, nlp.counts[1:], shared, nlp.paces[1])
    variables = nlp.workspace[:n]

    def copied(begin: int, end: int, status: FloatArray) -> Iterator[Bound]:
        """Copy the outputs at these positions of the buffer to their targets."""
        for number, at, copying in its.outputs(begin, end):
            yield from copying.bind(buffer, scales[number][at], outs[number], status)

    def folded() -> Iterator[Bound]:
        """Sum outputs of one entry, and copy the sum again."""
        status = steps.cell()
        for number, calls in enumerate(nlp.foldings):
            if calls:
                yield from calls
                at, copying = its.folded(number)
                yield from copying.bind(buffer, scales[number][at], outs[number], status)

    def constants() -> list[Bound]:
        """The remaining work for constants at each evaluation: a check that they are finite."""
        status = np.zeros(1)
        for call in copied(program.varying_size, program.derivatives_size, status):
            call()
        if status[0] == 0.0:
            return []
        return list(copied(program.varying_size, program.derivatives_size, steps.cell()))

    def values() -> Iterator[list[Bound]]:
        """Evaluate the values kernels, unless they were last evaluated for the same variables."""
        if not nlp.keeps:
            return
        notes = steps.note(variables, nlp.noted)
        calls = [piece.call for piece in nlp.pieces(values=True, cut=shared)]
        if shared:
            yield notes
            yield [unless(all_same(steps.same), [call]) for call in calls]
        else:
            yield [unless(notes[0], calls)]

    steps.phases = [
        [
            *steps.place_variables(result.x, scaling.variable, its, variables),
            *steps.place_multipliers(result.y, scaling.row, its, nlp.workspace[n : n + m]),
            place(result.weight, objective, nlp.factor),
        ],
        *values(),
        [
            *constants(),
            *(
                chain([*(piece.call for piece in some), *copied(some[0].begin, some[-1].end, steps.cell())])
                for some in _together(nlp.pieces(values=False, cut=True))
            ),
        ],
        [chain(calls)] if (calls := list(folded())) else [],
    ]
    return steps.call()
