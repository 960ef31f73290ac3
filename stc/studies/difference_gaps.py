"""The error of central differences, compared with wider ones that are two orders more accurate."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.phases import named_cuts, resolved, stretches
from stc.problem import IndexRef, Problem, TimeRef, VariableRef
from stc.records import dataclass
from stc.solution import Solution
from stc.studies.discretisation import derivative_at_frames
from stc.symbol_values import fixed_values
from stc.symbolic.expr import Expr, evaluate_all, symbols
from stc.transcription.schemes import stencil_reach

FloatArray = NDArray[np.float64]

__all__ = ["Gaps", "ends_of_sums", "gaps_of", "moved_rows", "moved_terms"]


@dataclass(frozen=True, slots=True)
class Gaps:
    """For every (variable, order) in use: the wider differences minus the method's own, at the frames. (n+1,)

    Zero where the wider ones would reach over a frame at which something jumps, begins or ends.
    """

    of: dict[tuple[str, int], FloatArray]
    lengths: FloatArray

    def by_step(self) -> dict[tuple[str, int], FloatArray]:
        """The error of the next lower derivative in each step, (n,), for the highest order of each variable."""
        highest = dict(sorted(self.of))  # of each variable the last
        # The motion whose differences meet the equations has derivatives that are off by the gap.
        return {
            (name, order): -0.5 * self.lengths * (self.of[name, order][1:] + self.of[name, order][:-1])
            for name, order in highest.items()
        }


def gaps_of(problem: Problem, solution: Solution) -> Gaps:
    """The gaps of all derivatives that statements use."""
    n, time = solution.n, solution.time
    used = {
        (key.name, key.order)
        for body, a, _ in _bodies(problem)
        for key in symbols(resolved(problem, body, a))
        if isinstance(key, VariableRef) and key.order and (key.name, 0) in solution.trajectories
    }
    cuts = np.array([k for k in named_cuts(problem) if 0 < k < n], int)
    found = {}
    for name, order in used:
        width = 2 * stencil_reach(order) + 1
        if width + 2 > n + 1:
            continue
        x = solution[name]
        gap = derivative_at_frames(time, x, order, width + 2) - derivative_at_frames(time, x, order, width)
        reach = width // 2 + 1
        for cut in cuts:
            gap[max(cut - reach, 0) : cut + reach + 1] = 0.0
        if order > 1:  # where the stencil does not fit no statement holds
            ends = stencil_reach(order)
            gap[:ends], gap[n + 1 - ends :] = gap[ends], gap[n - ends]
        found[name, order] = gap
    return Gaps(found, np.diff(time))


def moved_rows(problem: Problem, solution: Solution, gaps: Gaps) -> float:
    """The change of the objective if all rows use the wider differences."""
    total = 0.0
    blocks = {block.label: block for block in solution.multipliers if block.kind == "row"}
    for relation in problem.relations:
        block = blocks.get(relation.text)
        if block is None:
            continue
        at = np.unique(np.rint(block.nodes).astype(int))
        at = at[(at >= relation.range.first) & (at <= relation.range.last)]
        prices = np.zeros(solution.n + 1)
        np.add.at(prices, np.rint(block.nodes).astype(int), block.values)
        for first, last in _pieces(problem, relation.range.first, relation.range.last):
            here = at[(at >= first) & (at <= last)]
            moved = _moved(solution, resolved(problem, relation.body, first), gaps, here)
            total += float(prices[here] @ moved)
    return total


def moved_terms(problem: Problem, solution: Solution, gaps: Gaps) -> float:
    """The change of the objective if its own terms use the wider differences, with integrals by the trapezoid rule."""
    total = 0.0
    lengths = np.diff(solution.time)
    weights = 0.5 * np.concatenate([[0.0], lengths]) + 0.5 * np.concatenate([lengths, [0.0]])
    for term in problem.objective:
        for first, last in _pieces(problem, term.range.first, term.range.last):
            here = np.arange(first, last + 1)
            moved = _moved(solution, resolved(problem, term.body, first), gaps, here)
            total += float(moved @ (weights[here] if term.integral else np.ones(len(here))))
    return total


def ends_of_sums(problem: Problem, solution: Solution) -> float:
    """The errors at the ends of sums over the frames that stand for integrals.

    A plain term with the step `h` as a factor is such a sum.  Over the whole motion it counts half a step too much
    at either end; where it leaves out the ends, half a step too little.
    """
    if problem.method == "hermite-simpson":  # whose sums are weighed as integrals are, but for their ends
        return 0.0
    total = 0.0
    for term in problem.objective:
        first, last = term.range.first, term.range.last
        if term.integral or first == last or not re.search(r"\bh\b", term.text):
            continue
        for frame, whole in ((first, first == 0), (last, last == problem.n)):
            at = np.array([frame])
            keys = symbols(body := resolved(problem, term.body, min(frame, problem.n - 1)))
            values: dict[object, Any] = {
                **fixed_values(solution),
                TimeRef(): solution.time[at],
                IndexRef(): at + 0.0,
            }
            values.update(
                {
                    key: solution.trajectories[key.name, key.order].after[at]
                    for key in keys
                    if isinstance(key, VariableRef) and (key.name, key.order) in solution.trajectories
                }
            )
            if all(key in values for key in keys):
                total += (-0.5 if whole else 0.5) * float(np.ravel(evaluate_all([body], values)[0])[0])
    return total


def _pieces(problem: Problem, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Intervals of a range on which definitions are one piece each; every frame is in one of them."""
    for a, b in [*stretches(problem, ()), (problem.n, problem.n)]:
        low, high = max(a, first), min(max(b - 1, a), last)
        if low <= high:
            yield low, high


def _bodies(problem: Problem) -> Iterator[tuple[Expr, int, int]]:
    for body, where in [(s.body, s.range) for s in problem.relations] + [
        (s.body, s.range) for s in problem.objective
    ]:
        for first, last in _pieces(problem, where.first, where.last):
            yield body, first, last


def _moved(solution: Solution, body: Expr, gaps: Gaps, frames: NDArray[np.int_]) -> FloatArray:
    """The change of an expression at some frames if its derivatives are the wider differences. (k,)"""
    keys = [key for key in symbols(body) if isinstance(key, VariableRef)]
    mine = [key for key in keys if (key.name, key.order) in gaps.of]
    if not mine or not len(frames) or any((k.scale, k.shift) != (1, 0) for k in keys):
        return np.zeros(len(frames))
    if any((key.name, key.order) not in solution.trajectories for key in keys):
        return np.zeros(len(frames))
    values: dict[object, Any] = {**fixed_values(solution), TimeRef(): solution.time[frames]}
    values[IndexRef()] = frames.astype(float)
    values.update({key: solution.trajectories[key.name, key.order].after[frames] for key in keys})
    if any(key not in values for key in symbols(body)):  # what only rows of data have
        return np.zeros(len(frames))
    before = np.asarray(evaluate_all([body], values)[0], float)
    values.update({key: values[key] + gaps.of[key.name, key.order][frames] for key in mine})
    after = np.asarray(evaluate_all([body], values)[0], float)
    moved = np.broadcast_to(after - before, frames.shape)
    return np.where(np.isfinite(moved), moved, 0.0)
