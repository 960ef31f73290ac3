"""The starting point: fixed values, guesses of the spec, and straight lines between.

A variable whose bounds coincide starts at this fixed value.  Elsewhere it starts at values given by the caller, else
at the spec's guess; without either the start is linear between the fixed frames, constant outside of them, and 0 if
nothing is fixed.  Derivatives that are unknowns start from differences of these values, and angular velocities from
differences of the orientation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.errors import Diagnostic, EvaluationError, SpecError, UsageError
from stc.problem import (
    ConstantRef,
    DefinitionRef,
    Guess,
    IndexRef,
    Jump,
    ParameterRef,
    Problem,
    TimeRef,
    VariableRef,
)
from stc.symbolic.expr import evaluate, symbols
from stc.transcription.grid import Grid, Nodes
from stc.transcription.layout import Layout
from stc.transcription.lower import Expander
from stc.transcription.settle import Settling
from stc.transcription.steps import Steps
from stc.transcription.turns import turns_between

if TYPE_CHECKING:
    from stc.guesses.values import GivenValues, NodeValues
    from stc.solution import Solution

FloatArray = NDArray[np.float64]

#: A motion whose duration nobody has guessed may last so many seconds, at least and at most.
_SHORTEST, _LONGEST = 0.1, 10.0

#: So many starts are tried to find such a duration.
_MOST_STARTS = 6


# A guess may be too large for its derivatives: what is not finite is refused where the program is evaluated first.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def starting_point(
    problem: Problem,
    grid: Grid,
    layout: Layout,
    steps: Steps,
    coefficients: FloatArray,
    constants: Mapping[str, float],
    lower: FloatArray,
    upper: FloatArray,
    given: GivenValues | None = None,
) -> FloatArray:
    """The decision vector to start from, inside its bounds. (layout.size,)

    Raises:
        SpecError: a step would be zero or negative: a parameter in it needs a guess.
        EvaluationError: a written guess has no value.
    """
    x = np.zeros(layout.size)
    values: dict[object, float] = {ConstantRef(k): v for k, v in constants.items()}
    for guess in problem.guesses:
        if guess.name in layout.parameters:
            start = float(evaluate(guess.body, dict(values)))
            if not np.isfinite(start):
                raise _no_value(guess, None)
            x[layout.parameters[guess.name]] = start
    for name, at in layout.parameters.items():
        number = None if given is None else given.parameter(name)
        if number is not None:
            x[at] = number
    parameters = list(layout.parameters.values())
    x[parameters] = np.clip(x[parameters], lower[parameters], upper[parameters])
    values.update({ParameterRef(name): x[p] for name, p in layout.parameters.items()})
    h = steps.lengths(coefficients, values)
    if grid.n and not (h > 0).all():
        bad = int(np.flatnonzero(~(h > 0))[0])
        free = [parameter.name for parameter in steps.parameters]
        unguessed = [
            name
            for name in free
            if name not in {guess.name for guess in problem.guesses}
            and (given is None or given.parameter(name) is None)
        ]
        hint = "the time from a frame to the next"
        if free:
            hint = _step_hint(steps, coefficients, values, unguessed or free)
        message = f"the step from frame {bad} to {bad + 1} starts at {h[bad]:g}; it must be positive"
        raise SpecError([Diagnostic("error", message, problem.step_span, hint)])
    time = np.concatenate([[0.0], np.cumsum(h)])
    halfway = grid.has_midpoints
    outside = {
        name: None if given is None else given.values(name, 0, time, halfway) for name in problem.variables
    }
    written = _written(problem, grid, values, time, outside)
    starts = {}
    for name, order, before, after, middle in layout.slots():
        if order == 0:
            known = _known(written.get(name), outside[name])
            starts[name] = _start_of(before, after, middle, lower, upper, known, time)
    if problem.fixtures and given is None:
        _settle(problem, starts, time, values)
    # The way between a model's poses has kinks where it jumps, but no jumps: slopes on both sides count.
    jump = np.zeros_like(grid.jump) if problem.of_model else grid.jump
    turning = {name: (one, k) for one in problem.rotations for k, name in enumerate(one.velocity)}
    for name, order, before, after, middle in layout.slots():
        if order == 0 and name in turning and outside[name] is None and name not in written:
            rotation, axis = turning[name]
            q = np.array([starts[part][0][0] for part in rotation.quaternion])
            frames, mids = _at_nodes(turns_between(q[:, :-1], q[:, 1:])[axis] / h, h, jump)
        elif order == 0:
            frames, mids = starts[name]
        else:
            known = None if given is None else given.values(name, order, time, halfway)
            if known is not None and _is_whole(known):
                frames, mids = known[:2], known[2]
            else:
                frames, mids = _slope(frames, h, jump)
                if known is not None:
                    frames = _over(frames[0], known[0]), _over(frames[1], known[1])
                    mids = _over(mids, known[2])
        x[before], x[after] = frames[0], frames[1]
        if len(middle):
            x[middle] = mids
    _follow(problem, layout, values, outside, x)
    return np.clip(x, lower, upper)


def _follow(
    problem: Problem,
    layout: Layout,
    values: Mapping[object, float],
    outside: Mapping[str, NodeValues | None],
    x: FloatArray,
) -> None:
    """Start variables whose guess depends on the starting values of others, such as the directions of distances."""
    following = [g for g in problem.guesses if _follows(g) and not _is_whole(outside[g.name])]
    if not following:
        return
    places = {name: parts for name, order, *parts in layout.slots() if order == 0}
    for guess in following:
        for side, at in enumerate(places[guess.name]):
            known: dict[object, float | FloatArray] = dict(values)
            known.update({VariableRef(name): x[parts[side]] for name, parts in places.items()})
            if len(at):
                x[at] = evaluate(guess.body, known)


def _follows(guess: Guess) -> bool:
    """Whether a guess is made of the starting values of other variables, on all frames."""
    return any(isinstance(key, VariableRef) for key in symbols(guess.body))


def _settle(
    problem: Problem,
    starts: dict[str, tuple[tuple[FloatArray, FloatArray], FloatArray]],
    time: FloatArray,
    known: Mapping[object, float],
) -> None:
    """Move the held constraints of a model to their places; ``starts`` are values of variables, which are changed."""
    n, middles = len(time) - 1, any(len(mids) for _, mids in starts.values())
    at = np.arange(2 * n + 1) / 2.0 if middles else np.arange(n + 1.0)
    paths = {}
    for name, ((before, _), mids) in starts.items():
        paths[name] = np.empty(len(at))
        paths[name][:: 2 if middles else 1] = before
        if middles:
            paths[name][1::2] = mids
    whole = {**known, TimeRef(): np.interp(at, np.arange(n + 1.0), time)}
    settling = Settling(problem, paths, at, whole)
    settling.run()
    for name in settling.moved:
        frames = paths[name][:: 2 if middles else 1]
        starts[name] = (frames, frames), paths[name][1::2] if middles else starts[name][1]


def check_names(given: GivenValues, problem: Problem) -> None:
    """Refuse values for names that the spec does not have (a solution may contain some, but not only such), and report
    unused values.

    Raises:
        UsageError: with the nearest name.
    """
    known = [*problem.variables, *problem.parameters]
    unknown = [name for name in given.names() if name.rstrip("'") not in known]
    if not unknown or (not given.strict and len(unknown) < len(list(given.names()))):
        from stc.guesses.values import warn_of_unused

        warn_of_unused(given, problem.name, {**_used(problem), **dict.fromkeys(problem.parameters)})
        return
    from difflib import get_close_matches

    name = unknown[0]
    near = get_close_matches(name.rstrip("'"), known, n=1, cutoff=0.5)
    hint = f"did you mean `{near[0]}`?" if near else f"it has {', '.join(known) or 'none'}"
    raise UsageError(
        f"the guess names `{name}`, which is not a variable or parameter of {problem.name}", hint
    )


def check_motion(earlier: Solution, problem: Problem) -> None:
    """Refuse the motion of another spec without a common variable; report unused values.

    Raises:
        UsageError: with the variables of both.
    """
    from stc.guesses.values import SolutionValues

    if problem.variables and not set(problem.variables).intersection(earlier.variables):
        raise UsageError(
            f"the motion of {earlier.name} has no variable of {problem.name}",
            f"it has {', '.join(earlier.variables)}, and {problem.name} {', '.join(problem.variables)}",
        )
    check_names(SolutionValues(earlier), problem)


def _used(problem: Problem) -> dict[str, int]:
    """The highest derivative of each variable in statements and jumps, with definitions expanded."""
    pieces = [piece.body for named in problem.definitions.values() for piece in named]
    bodies = [*(r.body for r in problem.relations), *(o.body for o in problem.objective), *pieces]
    keys = [key for body in bodies for key in symbols(body)]
    primes = sum({key: key.order for key in keys if isinstance(key, DefinitionRef)}.values())
    found = dict.fromkeys(problem.variables, 0)
    for key in (*keys, *problem.jumps):
        if isinstance(key, VariableRef | Jump):
            found[key.name] = max(found[key.name], key.order)
    return {name: order + primes for name, order in found.items()}


def _written(
    problem: Problem,
    grid: Grid,
    values: Mapping[object, float],
    time: FloatArray,
    outside: Mapping[str, NodeValues | None],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """The spec's guesses at frames (n+1,) and midpoints (n,) per variable, NaN without one.

    Those that there are numbers for from outside at every node are left out.
    """
    result: dict[str, tuple[FloatArray, FloatArray]] = {}
    expand = Expander(problem, grid)
    for guess in problem.guesses:
        if guess.name not in problem.variables or _is_whole(outside[guess.name]) or _follows(guess):
            continue
        if guess.name not in result:
            result[guess.name] = np.full(grid.n + 1, np.nan), np.full(grid.n, np.nan)
        at_frames, at_mids = result[guess.name]
        first, last = guess.range.first, guess.range.last
        position = np.arange(2 * first, 2 * last + 1)
        for body, nodes in expand(guess.body, Nodes(position, np.zeros(len(position), np.int64))):
            half = nodes.is_midpoint
            t = time[nodes.frame].copy()
            t[half] = 0.5 * (time[nodes.frame[half]] + time[nodes.frame[half] + 1])
            known = {**values, IndexRef(): nodes.position / 2.0, TimeRef(): t}
            value = np.broadcast_to(evaluate(body, known), t.shape)
            wrong = ~np.isfinite(value) & (grid.has_midpoints | ~half)
            if wrong.any():
                raise _no_value(guess, float(nodes.position[wrong][0]) / 2)
            at_frames[nodes.frame[~half]] = value[~half]
            at_mids[nodes.frame[half]] = value[half]
    return result


def _step_hint(
    steps: Steps, coefficients: FloatArray, values: Mapping[object, float], names: Sequence[str]
) -> str:
    """The hint for a step that is not positive at the start because of the start of some parameters.

    The line that is proposed has every step positive and the whole motion last some seconds, if such values are found.
    """
    starts = [1.0, 10.0, 100.0]
    for start in starts:
        lengths = steps.lengths(coefficients, {**values, **{ParameterRef(name): start for name in names}})
        if not (lengths > 0).all():
            continue
        total = float(lengths.sum())
        if _SHORTEST <= total <= _LONGEST:
            line = " ".join(f"{name} = {start:g};" for name in names)
            return f"write `guess: {line}`, or any other start that makes every step positive"
        if len(starts) < _MOST_STARTS and np.isfinite(total):
            starts.append(float(f"{start / total:.1g}"))  # a second where steps grow as their parameters do
    return f"give {' and '.join(f'`{name}`' for name in names)} a guess that makes every step positive"


def _no_value(guess: Guess, frame: float | None) -> EvaluationError:
    """The error for a guess that is not a number at a frame."""
    hint = "a guess is a number on every frame of its range"
    return EvaluationError("this guess has no value", frame=frame, span=guess.span, hint=hint)


def _is_whole(values: NodeValues | None) -> bool:
    """Whether there are numbers at every node."""
    return values is not None and not any(np.isnan(part).any() for part in values)


def _known(written: tuple[FloatArray, FloatArray] | None, outside: NodeValues | None) -> NodeValues | None:
    """The values of a variable given by the caller or the spec, the caller's first."""
    if written is None:
        return outside
    frames, mids = written
    if outside is None:
        return frames, frames, mids
    return _over(frames, outside[0]), _over(frames, outside[1]), _over(mids, outside[2])


def _over(values: FloatArray, better: FloatArray) -> FloatArray:
    """The better values where they are numbers; midpoints may be missing."""
    return np.where(np.isnan(better), values, better) if len(better) else values


def _start_of(
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    middle: NDArray[np.int64],
    lower: FloatArray,
    upper: FloatArray,
    known: NodeValues | None,
    time: FloatArray,
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Values of a variable: ((before, after) at frames, at midpoints)."""
    pinned_before, pinned_after = lower[before] == upper[before], lower[after] == upper[after]
    if known is not None and _is_whole(known):
        left, right, line_mids = known
    else:
        pins = np.flatnonzero(pinned_before | pinned_after)
        value = np.where(pinned_before, lower[before], np.where(pinned_after, lower[after], 0.0))
        line = np.interp(time, time[pins], value[pins]) if len(pins) else np.zeros(len(time))
        left, right, line_mids = line, line, 0.5 * (line[:-1] + line[1:])
        if known is not None:
            left, right = _over(line, known[0]), _over(line, known[1])
            line_mids = _over(0.5 * (right[:-1] + left[1:]), known[2])
    frames = np.where(pinned_before, lower[before], left), np.where(pinned_after, lower[after], right)
    if len(middle):
        pinned = lower[middle] == upper[middle]
        line_mids = np.where(pinned, lower[middle], line_mids)
    return frames, line_mids


def _slope(
    frames: tuple[FloatArray, FloatArray], h: FloatArray, jump: NDArray[np.bool_]
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """The derivative of a variable from its values (before, after) at frames: ((before, after), at midpoints)."""
    return _at_nodes((frames[0][1:] - frames[1][:-1]) / h, h, jump)


def _at_nodes(
    slope: FloatArray, h: FloatArray, jump: NDArray[np.bool_]
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Slopes of steps, (n,), at the nodes: centred inside, one-sided at the ends and on either side of a jump."""
    n = len(h)
    if n == 0:
        zero = np.zeros(1)
        return (zero, zero), np.zeros(0)
    before, after = np.empty(n + 1), np.empty(n + 1)
    before[1:], after[:-1] = slope, slope
    before[0], after[n] = after[0], before[n]
    smooth = ~jump
    smooth[[0, n]] = False
    k = np.flatnonzero(smooth)
    mean = (h[k] * slope[k - 1] + h[k - 1] * slope[k]) / (h[k - 1] + h[k])
    before[k] = after[k] = mean
    return (before, after), slope
