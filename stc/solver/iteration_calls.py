"""The stages of an iteration as prepared calls, and the iteration as a chain of them.

Each stage is a compiled function that makes the calls of the workspace's table and leaves its numbers (see
:mod:`stc.solver.state`).  It returns 0, or tells what it cannot do itself: :mod:`stc.solver.newton_system` and
:mod:`stc.solver.interior` do that, and go on from there.  So iterations
where all is as usual are one call together, however small the problem.
"""

from __future__ import annotations

import numpy as np

from stc.core.calls import Bound, chain, chain_until
from stc.core.functions import function
from stc.solver import barrier_update, filter_line_search, inertia_correction, state
from stc.solver.progress_kernels import note_iterate, note_objective, record
from stc.solver.state import (
    ITERATION,
    MEASURED,
)
from stc.solver.workspace import Workspace

__all__ = ["BLOCKED", "FACTORIZATION", "LOOK", "SEARCH", "Stages", "stages_of"]

#: Where the calls of an iterate and of an iteration may end.
LOOK = 1
FACTORIZATION, STEP_FOUND, SEARCH, BLOCKED = 3, 4, 5, 6

#: Note the step taken; 1 where steps are too short to go on.
settle = function("progress_settle")
#: Measure, record and iterate, ``s[MOST]`` times at most, the first of them without the iteration where that is 0.
repeat = function("progress_repeat")


def stages_of(work: Workspace) -> Stages:
    """The stages that a workspace keeps."""
    if work.stages is None:
        work.stages = Stages(work)
    return work.stages


class Stages:
    """Prepared calls over one workspace.

    Attributes:
        measure: the iterate's errors; 1 where more is to be looked at.
        iterate: one iteration; ends at FACTORIZATION and so on where that stage needs help.
        begin, factorize: prepare a factorisation, and go on with it.
        find_step, search, backtrack: the step, and the search along it.
        advance: what comes after the factorisation; ends at STEP_FOUND - FACTORIZATION and so on.
        settle: note what was done.
        record: add the iterate to the records.
        repeat: all of that again and again, see :func:`repeat`.
    """

    def __init__(self, work: Workspace) -> None:
        form, it, ev, s = work.form, work.it, work.evaluator, work.numbers
        n, m, gaps, size = form.n, form.m, form.gaps, form.size
        kkt, correction = work.kkt, work.correction
        table = work.calls
        fixed: dict[int, Bound] = {
            state.MEASURE: work.measure_call,
            state.DIAGONALS: work.diagonals_call,
            state.SHIFTED: work.shifted_call,
            state.COMBINE: work.combine_call,
            state.CENTRE: work.centre_call,
            state.LENGTHS: work.lengths_call,
            state.TRY_STEP: work.trial_call,
            state.TRY_POINT: chain([ev.values_call, work.inspect_call]),
            state.MOVE: work.move_call,
            state.RETURN: work.return_call,
        }
        for place, call in fixed.items():
            table.put(place, call)
        cells = table.cells
        note: Bound = note_iterate.bind(size, m, gaps, it.w, it.y, it.z, *work.kept, s)
        self.measure: Bound = chain_until(
            [
                (work.measure_call, False),
                (note_objective.bind(s), False),
                (note, True),
            ]
        )
        update: Bound = barrier_update.update.bind(cells, gaps, work.target, work.accepted.array, s)
        self.begin: Bound = inertia_correction.begin.bind(cells, s)
        diagonal = form.hess_diagonal
        self.factorize: Bound = inertia_correction.factorize.bind(
            cells, n, m, diagonal.size, diagonal, work.bend, it.hess, np.zeros(diagonal.size), work.inertia,
            kkt.accuracy, s,
        )  # fmt: skip
        self.find_step: Bound = barrier_update.find_step.bind(
            cells, gaps, work.mu, work.tau, work.factor, kkt.report, s
        )
        searching = (
            cells, n, m, gaps, form.index, form.sign, it.w, it.y, it.c, it.gap, work.step.dy, work.trial_w,
            work.trial_c, ev.x, ev.f, correction.dw, work.correction_c, work.alpha, work.mu, work.shifted, kkt.report,
            work.filter.array, s,
        )  # fmt: skip
        self.search: Bound = filter_line_search.search.bind(*searching)
        self.backtrack: Bound = filter_line_search.backtrack.bind(*searching)
        self.settle: Bound = settle.bind(s)
        after = [(self.find_step, True), (self.search, True), (self.settle, True)]
        self.advance: Bound = chain_until(after)
        self.iterate: Bound = chain_until(
            [(update, False), (self.begin, False), (self.factorize, True), *after]
        )
        table.put(MEASURED, self.measure)
        table.put(ITERATION, self.iterate)
        recorded = n, m, it.w, it.y, *work.best, work.rows, s
        self.record: Bound = record.bind(*recorded)
        self.repeat: Bound = repeat.bind(cells, *recorded)
