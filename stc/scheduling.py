"""From contacts that the solver has found to a schedule: the same spec with ranges of frames in place of ``free:``.

Time steps find in which order contacts come and go, roughly.  A schedule states it, is solved to the full order of its
method, and is judged by MuJoCo as any other.  The motion that was found goes along as a table of poses, from which the
new spec starts.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc import atomic
from stc.arrays import stretches_of
from stc.errors import Source, SpecError, UsageError
from stc.language import syntax
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.problem import FreeContact, VariableRef
from stc.restated import source_of, stated_again
from stc.solution import Solution
from stc.symbolic.expr import symbols

__all__ = ["found_ranges", "write_schedule"]

Range = tuple[int, int]

#: A contact stands where it bears this share of the weight.
BEARS = 1e-2
#: A flight of fewer frames than this between two stances is none: steps are not that fine.
SHORTEST_FLIGHT = 2
#: Farther than this, in m, a contact slides that moves while it stands.
SLIDES = 0.01
#: What the new spec calls the motion that it starts from.
STEPS = "steps"


def found_ranges(solution: Solution) -> dict[str, list[Range]]:
    """The frames on which each free contact stands, first and last.

    Parameters
    ----------
    solution
        Of a spec with contacts under ``free:``.

    Raises
    ------
    UsageError
        Its spec has none, or one of them slides where it bears something, which no schedule can state.
    """
    stated = stated_again(solution)
    contacts = stated.problem.free_contacts
    if not contacts:
        hint = "write `free: NAME;` under `contact:` in place of its ranges, and solve that"
        raise UsageError(f"no contact of {solution.name} is left to the solver", hint)
    recovery = stated.recovery(solution.x, solution.constants)
    steps = np.append(0.0, np.diff(solution.time))

    def values(contact: FreeContact) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        speeds = [recovery.channel(rate).before for rate in contact.slip]
        return recovery.channel(contact.pressure).before, np.sqrt(np.sum(np.square(speeds), axis=0))

    found = {}
    for contact in contacts:
        pressure, speed = values(contact)
        bears = pressure > BEARS * contact.weight
        found[contact.name] = _ranges(bears)
        for first, last in found[contact.name]:
            way = float((speed * steps)[first + 2 : last].sum())  # an impact takes two steps
            if way > SLIDES:
                raise UsageError(
                    f"`{contact.name}` slides by {way:.3g} m on frames {first} to {last}, and what a schedule says of "
                    "a contact is that it stands",
                    "let the solver look for a motion in which it stands: leave out `slides`, or ask more for the "
                    "accelerations of what makes many small steps",
                )
    return found


def _ranges(bears: NDArray[np.bool_]) -> list[Range]:
    """Stretches of frames on which a contact bears something, without gaps that are too short to be flights."""
    found: list[Range] = []
    for first, end in stretches_of(bears):
        if found and first - found[-1][1] <= SHORTEST_FLIGHT:
            found[-1] = found[-1][0], end - 1
        else:
            found.append((first, end - 1))
    return found


def _text(solution: Solution, ranges: Mapping[str, Sequence[Range]], table: str) -> str:
    """The spec with ranges in place of what is under ``free:``, and a guess from the poses in a file."""
    tree = parse(source_of(solution))
    text = tree.source.text
    for block in reversed([block for block in tree.blocks("contact") if block.free]):
        places = [one for one in block.statements if isinstance(one, syntax.ContactPlace)]
        lines = []
        for place in places:
            on = "" if place.on is None else f" on {place.on.name}"
            for first, last in ranges[place.name.name]:
                lines.append(f"{_header(first, last, solution.n)} {place.name.name}{on};")
        end = max((place.end for place in places), default=block.end)
        end = text.find(";", end) + 1 or end
        text = text[: block.start] + "\n  ".join(lines) + text[end:]
    name = STEPS
    while re.search(rf"\b{name}\b", text):
        name += "_"
    return f'{text.rstrip()}\n\n# what was found in time steps\ndata: {name} = "{table}";\nguess: {name};\n'


def _header(first: int, last: int, n: int) -> str:
    """A range that means the same share of the motion on as many frames, twice as many and so on."""

    def frame(k: int) -> str:
        return "0" if k == 0 else "n" if k == n else f"{k}*n/{n}"

    return f"[{frame(first)}]:" if first == last else f"[{frame(first)}, {frame(last)}]:"


def _poses(solution: Solution) -> Iterator[list[str]]:
    """The rows of a table of the joints' coordinates over time."""
    problem = stated_again(solution).problem
    rates = {name for rotation in problem.rotations for name in rotation.velocity}
    names = [
        key.name
        for line in problem.replay
        if line.kind == "joint"
        for key in symbols(line.body)
        if isinstance(key, VariableRef) and key.name not in rates
    ]
    yield ["time", *names]
    columns = [solution.time, *(solution.trajectories[name, 0].before for name in names)]
    for row in zip(*columns, strict=True):
        yield [repr(float(number)) for number in row]


def write_schedule(solution: Solution, path: Path) -> tuple[dict[str, list[Range]], Path]:
    """Write the spec with a schedule, and beside it a table of the poses that it starts from.

    Returns
    -------
    dict, Path
        What :func:`found_ranges` tells, which the spec states, and the file of the table.

    Raises
    ------
    UsageError
        As :func:`found_ranges`; or what is written would be no spec there.
    """
    ranges, table = found_ranges(solution), path.with_suffix(".csv")
    text = _text(solution, ranges, table.name)
    with atomic.replacing(table) as temporary, temporary.open("w", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerows(_poses(solution))
    try:
        elaborate(parse(Source(str(path), text, str(path))), solution.overrides)
    except SpecError as error:
        table.unlink(missing_ok=True)
        first = error.diagnostics[0].message
        hint = "what it names is looked up beside it: write it there with -o"
        raise UsageError(f"{path} would be no spec: {first}", hint) from error
    with atomic.replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return ranges, table
