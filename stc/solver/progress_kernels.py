"""What is noted of every iterate and step, compiled; :mod:`stc.solver.progress` tells what it is for."""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i64, native
from stc.solver.filter_line_search import HALF, SMALL_VIOLATION
from stc.solver.outcome import ACCEPTABLE, PROGRESS
from stc.solver.products import NOTHING
from stc.solver.state import (
    ATTENTION,
    BEST_KNOWN,
    BEST_NEW,
    BEST_OBJECTIVE,
    BEST_VIOLATION,
    DUAL_BEFORE,
    DUAL_ERROR,
    DUAL_NOW,
    ERROR,
    FARTHEST,
    FEASIBILITY,
    LENGTH_TAKEN,
    MADE,
    MU,
    NEAREST_ERROR,
    OBJECTIVE,
    OBJECTIVE_BEFORE,
    OBJECTIVE_NOW,
    ROW,
    ROW_ERROR,
    ROW_LENGTH,
    ROW_MU,
    ROW_OBJECTIVE,
    ROW_SHIFT,
    ROW_STEP,
    ROW_VIOLATION,
    SHIFT,
    SHORT_STEPS,
    SMALL_STEPS,
    STATED,
    STEP_TAKEN,
    THETA_BEFORE,
    TINY_STEPS,
    VIOLATION,
    WAITING,
)
from stc.solver.unboundedness import FAR, LOW

ITS_PATIENCE = 15
MOST_TINY_STEPS = 2
SHORT = 1e-2
MOST_SHORT_STEPS = 5
LARGEST_ERROR = 1e50


@native
def note_objective(s: f64s) -> None:
    """For :class:`Drift`: the objective and the dual error of the iterate just measured."""
    s[OBJECTIVE_BEFORE] = s[OBJECTIVE_NOW]
    s[OBJECTIVE_NOW] = s[OBJECTIVE]
    s[DUAL_BEFORE] = s[DUAL_NOW]
    s[DUAL_NOW] = s[DUAL_ERROR]


@native
def note_iterate(
    size: i64, m: i64, gaps: i64, w: f64s, y: f64s, z: f64s, kept_w: f64s, kept_y: f64s, kept_z: f64s, s: f64s
) -> i64:
    """For :class:`Nearest`: the iterate just measured.

    Returns:
        1 where more is to be looked at: the error is small, or anything is large, or nothing moves any more.
    """
    error = s[ERROR]
    nearest = s[NEAREST_ERROR]
    if error < PROGRESS * nearest:
        s[WAITING] = 0.0
    elif nearest <= ACCEPTABLE:
        s[WAITING] += 1.0
    if error < nearest:
        s[NEAREST_ERROR] = error
        for i in range(size):
            kept_w[i] = w[i]
        for r in range(m):
            kept_y[r] = y[r]
        for k in range(gaps):
            kept_z[k] = z[k]
    ordinary = error > s[ATTENTION] and error < LARGEST_ERROR and s[FARTHEST] <= FAR and s[OBJECTIVE] >= LOW
    still = s[WAITING] >= ITS_PATIENCE or s[TINY_STEPS] >= MOST_TINY_STEPS or s[SMALL_STEPS] >= ITS_PATIENCE
    return 0 if ordinary and not still else 1


@native
def note_step(size: f64, tiny: i64, s: f64s) -> None:
    """For :class:`Stall`: the relative size of a step.

    ``tiny``: it was below rounding error, and no change of the barrier explains it.
    """
    s[TINY_STEPS] = s[TINY_STEPS] + 1.0 if tiny != 0 else 0.0
    s[SMALL_STEPS] = s[SMALL_STEPS] + 1.0 if size <= NOTHING else 0.0


@native
def block(length: f64, theta: f64, s: f64s) -> i64:
    """1 after several very short steps in a row that did not even halve the violation ``theta``."""
    if length >= SHORT or theta < HALF * s[THETA_BEFORE]:
        s[SHORT_STEPS] = 0.0
        s[THETA_BEFORE] = theta
    s[SHORT_STEPS] += 1.0
    return 1 if s[SHORT_STEPS] > MOST_SHORT_STEPS and theta > SMALL_VIOLATION else 0


@native
def is_better(
    objective: f64, violation: f64, best_objective: f64, best_violation: f64, tolerance: f64
) -> i64:
    """Whether a point is better than the best so far: violations up to ``tolerance`` count as none."""
    if max(violation, best_violation) <= tolerance:
        return 1 if objective < best_objective else 0
    return 1 if violation < best_violation else 0


@native
def record(n: i64, m: i64, w: f64s, y: f64s, best_x: f64s, best_y: f64s, rows: f64s, s: f64s) -> None:
    """Record the iterate, and keep its variables (n,) and row multipliers (m,) where it is the best so far."""
    row = rows[ROW * int(s[MADE]) :]
    row[ROW_OBJECTIVE] = s[STATED]
    row[ROW_VIOLATION] = s[VIOLATION]
    row[ROW_ERROR] = s[ERROR]
    row[ROW_STEP] = s[STEP_TAKEN]
    row[ROW_LENGTH] = s[LENGTH_TAKEN]
    row[ROW_MU] = s[MU]
    row[ROW_SHIFT] = s[SHIFT]
    s[MADE] += 1.0
    better = is_better(s[STATED], s[VIOLATION], s[BEST_OBJECTIVE], s[BEST_VIOLATION], s[FEASIBILITY])
    if s[BEST_KNOWN] != 0.0 and better == 0:
        return
    s[BEST_KNOWN] = 1.0
    s[BEST_NEW] = 1.0
    s[BEST_VIOLATION] = s[VIOLATION]
    s[BEST_OBJECTIVE] = s[STATED]
    for i in range(n):
        best_x[i] = w[i]
    for r in range(m):
        best_y[r] = y[r]
