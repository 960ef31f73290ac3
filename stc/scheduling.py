"""From the contacts that a solve found to a schedule: the same spec with ranges of frames in place of ``free:``.

Time stepping finds the order of contacts, roughly.  A schedule states it as ranges, is solved to the full order of its
method, and is validated like any other motion.  The motion that was found is written as a table of poses, from which
the new spec starts.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc import atomic
from stc.arrays import stretches_of
from stc.errors import Source, SpecError, UsageError
from stc.language import syntax
from stc.language.elaborate import elaborate
from stc.language.model.schedule import WAYS
from stc.language.parser import parse
from stc.problem import Problem, VariableRef
from stc.solution import Solution
from stc.solution_restated import source_of, stated_again
from stc.symbolic.expr import ZERO, symbols

__all__ = ["found_ranges", "write_schedule"]

Range = tuple[int, int, str]
"""First and last frame, and the direction in which the contact slides; empty if it stands."""

#: A contact stands where it bears this share of the weight; at the first and the last frame also where its gap is less
#: than this, in m.  There it has to bear as much on the frame beside it: what only touches there would have a force
#: that must be zero, and an impulse as well, since rest fixes the speed before an impact too.
BEARS, TOUCHES = 1e-2, 1e-4
#: A flight of fewer frames than this between two stances is none: steps are not that fine.
SHORTEST_FLIGHT = 2
#: Farther than this, in m, a contact slides that moves while it bears something; on frames on which it is faster than
#: this, in m/s.
SLIDES, SLOWLY = 0.01, 1e-2
#: By how many steps the time between two changes of contact may change, and the least share of it that remains; it
#: grows by the inverse of that at most.
ROOM, LEAST = 1.5, 0.5
#: Which part of its height at an end of the motion a contact there keeps as clearance.
CLEAR = 0.9
#: What the new spec calls the motion that it starts from.
STEPS = "steps"


def found_ranges(solution: Solution) -> dict[str, list[Range]]:
    """The frames on which each free contact stands or slides.

    Parameters
    ----------
    solution
        Of a spec with contacts under ``free:``.

    Raises
    ------
    UsageError
        Its spec has none, or one of them slides in three dimensions, which no schedule can state.
    """
    stated = stated_again(solution)
    contacts = stated.problem.free_contacts
    if not contacts:
        hint = "write `free: NAME;` under `contact:` in place of its ranges, and solve that"
        raise UsageError(f"no contact of {solution.name} is left to the solver", hint)
    recovery = stated.recovery(solution.x, solution.constants)
    steps = np.append(0.0, np.diff(solution.time))

    stances = {}
    for contact in contacts:
        stands = recovery.channel(contact.pressure).before > BEARS * contact.weight
        for end, beside in ((0, 1), (-1, -2)):
            touches = all(recovery.channel(gap).before[end] < TOUCHES for gap in contact.gaps)
            stands[end] = stands[beside] and (touches or stands[end])
        stances[contact.name] = _stances(stands)
    landings = {first for some in stances.values() for first, _ in some}
    for some in stances.values():
        # What leaves as another lands is pushed off by that, or hands its load over.
        some[:] = [(first, last + (last + 1 in landings)) for first, last in some]
    found: dict[str, list[Range]] = {}
    for contact in contacts:
        moving = [rate for rate in contact.slip if rate is not ZERO]
        speeds = np.array([recovery.channel(rate).before for rate in moving]).reshape(len(moving), len(steps))
        found[contact.name] = []
        for first, last in stances[contact.name]:
            way = np.abs(speeds * steps)[:, first + 2 : last].sum(axis=1)  # an impact takes two steps
            if way.max(initial=0.0) <= SLIDES:
                found[contact.name].append((first, last, ""))
            elif len(moving) == 1:
                found[contact.name] += _slides(speeds[0], first, last, landings)
            else:
                raise UsageError(
                    f"`{contact.name}` slides by {way.max():.3g} m on frames {first} to {last}, and a schedule can say "
                    "that of motions in a plane alone",
                    "let the solver look for a motion in which it stands: leave out `slides`, or ask more for the "
                    "accelerations of what makes many small steps",
                )
    return found


def _slides(speed: NDArray[np.float64], first: int, last: int, landings: Set[int]) -> Iterator[Range]:
    """A stance divided into parts that stand and parts that slide, with their direction.

    It begins to slide at the beginning of the first step in which it does; if another contact lands at the end of that
    step, as what hits it may, with that landing.
    """
    ways = np.where(np.abs(speed) > SLOWLY, np.sign(speed), 0.0)
    reached = first
    moves = [
        (max(first, begin + first - (begin + first not in landings)), min(last, end + first), word)
        for word, way in WAYS.items()
        for begin, end in stretches_of(ways[first : last + 1] == way)
    ]
    for begin, end, word in sorted(moves):
        begin = max(begin, reached)
        if begin - reached > 0:
            yield reached, begin, ""
        yield begin, end, word
        reached = end
    if reached < last:
        yield reached, last, ""


def _stances(bears: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Intervals of frames on which a contact carries load, without gaps that are too short to be flights."""
    found: list[tuple[int, int]] = []
    for first, end in stretches_of(bears):
        if found and first - found[-1][1] <= SHORTEST_FLIGHT:
            found[-1] = found[-1][0], end - 1
        else:
            found.append((first, end - 1))
    return found


def _text(solution: Solution, ranges: Mapping[str, Sequence[Range]], table: str) -> str:
    """The spec with ranges in place of ``free:``, and a guess from the poses in a file."""
    text = source_of(solution).text
    low = _low_ends(solution, ranges)
    declared = [one for block in parse(Source("", text, "")).blocks("contact") for one in block.statements]
    for one in reversed([one for one in declared if isinstance(one, syntax.ContactDeclaration)]):
        for option, value in one.options:
            if option.name == "clearance" and value is not None and one.name.name in low:
                asked = f"min({text[value.start : value.end]}, {low[one.name.name]:.2g})"
                text = text[: value.start] + asked + text[value.end :]
    tree = parse(Source("", text, ""))
    for block in reversed([block for block in tree.blocks("contact") if block.free]):
        places = [one for one in block.statements if isinstance(one, syntax.ContactPlace)]
        lines = []
        for place in places:
            on = "" if place.on is None else f" on {place.on.name}"
            for first, last, way in ranges[place.name.name]:
                slides = f" slides {way}" if way else ""
                lines.append(f"{_header(first, last, solution.n)} {place.name.name}{on}{slides};")
        end = max((place.end for place in places), default=block.end)
        end = text.find(";", end) + 1 or end
        text = text[: block.start] + "\n  ".join(lines) + text[end:]
    name = _unused(STEPS, text)
    head = f"# {solution.name}, with the contacts that were found in time steps as ranges of frames.\n#\n"
    return f'{head}{text.rstrip()}\n\n# what was found in time steps\ndata: {name} = "{table}";\nguess: {name};\n'


def _low_ends(solution: Solution, ranges: Mapping[str, Sequence[Range]]) -> dict[str, float]:
    """The clearance that contacts have at the ends of the motion where they do not stand, in m.

    An arch of flight that goes on beyond the motion is highest there: where the pose is given, it cannot be higher.
    """
    stated, n = stated_again(solution), solution.n
    recovery = stated.recovery(solution.x, solution.constants)
    found = {}
    for contact in stated.problem.free_contacts:
        standing = {frame for first, last, _ in ranges[contact.name] for frame in (first, last)}
        heights = [recovery.channel(gap).before[end] for gap in contact.gaps for end in {0, n} - standing]
        if heights:
            found[contact.name] = CLEAR * max(0.0, float(min(heights)))
    return found


def _unused(name: str, text: str) -> str:
    """A name with which no name of a text begins."""
    while re.search(rf"\b{name}", text):
        name += "_"
    return name


def _with_paces(text: str, ranges: Mapping[str, Sequence[Range]], n: int) -> str:
    """The spec with an unknown step between two changes of contact each.

    An impact happens within a step of time stepping, and need not happen at a frame of equal steps: what falls from a
    given height lands when it does.  All steps together last as long as before.
    """
    tree = parse(Source("", text, ""))
    steps = [
        statement.name
        for kind in ("constants", "definitions")
        for block in tree.blocks(kind)
        for statement in block.statements
        if isinstance(statement, syntax.Declaration | syntax.Assignment) and statement.name.name == "h"
    ]
    changes = sorted({0, n}.union(*({first, last} for some in ranges.values() for first, last, _ in some)))
    if len(steps) != 1 or len(changes) == 2:
        return text
    even, pace = _unused("h_even", text), _unused("pace", text)
    paces = [(first, last - first, f"{pace}{k}") for k, (first, last) in enumerate(pairwise(changes), 1)]
    lines = ["\n# between changes of contact the step is unknown, so that these can happen at any time"]
    lines += [f"parameters: {', '.join(name for _, _, name in paces)};", "definitions:"]
    for first, frames, name in paces:
        lines.append(f"  [{first}*n/{n}, {first + frames}*n/{n} - 1]: h = {name}*{even};")
    lines += ["constraints:", f"  {' + '.join(f'{frames}*{name}' for _, frames, name in paces)} = {n};"]
    for _, frames, name in paces:
        least, most = max(LEAST, 1.0 - ROOM / frames), min(1.0 / LEAST, 1.0 + ROOM / frames)
        lines.append(f"  {least:.6g} <= {name} <= {most:.6g};")
    lines.append(f"guess: {' '.join(f'{name} = 1;' for _, _, name in paces)}\n")
    place = steps[0]
    return text[: place.start] + even + text[place.end :] + "\n".join(lines)


def _header(first: int, last: int, n: int) -> str:
    """A range as shares of n, so that it keeps its meaning with more frames."""

    def frame(k: int) -> str:
        return "0" if k == 0 else "n" if k == n else f"{k}*n/{n}"

    return f"[{frame(first)}]:" if first == last else f"[{frame(first)}, {frame(last)}]:"


def joint_coordinates(problem: Problem) -> list[str]:
    """The variables that give the positions of joints to the replay, without their velocities."""
    rates = {name for rotation in problem.rotations for name in rotation.velocity}
    found = [
        key.name
        for line in problem.replay
        if line.kind == "joint"
        for key in symbols(line.body)
        if isinstance(key, VariableRef) and key.name not in rates
    ]
    return list(dict.fromkeys(found))


def _poses(solution: Solution) -> Iterator[list[str]]:
    """The rows of a table of the joints' coordinates over time."""
    names = joint_coordinates(stated_again(solution).problem)
    yield ["time", *names]
    columns = [solution.time, *(solution.trajectories[name, 0].before for name in names)]
    for row in zip(*columns, strict=True):
        yield [repr(float(number)) for number in row]


def write_schedule(solution: Solution, path: Path) -> tuple[dict[str, list[Range]], Path]:
    """Write the spec with a schedule, and beside it a table of the poses from which it starts.

    Returns
    -------
    dict, Path
        The ranges of :func:`found_ranges`, and the file of the table.

    Raises
    ------
    UsageError
        As :func:`found_ranges`; or the written text would not be a valid spec at that place.
    """
    ranges, table = found_ranges(solution), path.with_suffix(".csv")
    plain = _text(solution, ranges, table.name)
    text = _with_paces(plain, ranges, solution.n)
    with atomic.replacing(table) as temporary, temporary.open("w", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows(_poses(solution))
    try:
        try:
            elaborate(parse(Source(str(path), text, str(path))), solution.overrides)
        except SpecError:  # a step that is given otherwise, or used where no unknown may be
            text = plain
            elaborate(parse(Source(str(path), text, str(path))), solution.overrides)
    except SpecError as error:
        table.unlink(missing_ok=True)
        first = error.diagnostics[0].message
        hint = "what it names is looked up beside it: write it there with -o"
        raise UsageError(f"{path} would be no spec: {first}", hint) from error
    with atomic.replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return ranges, table
