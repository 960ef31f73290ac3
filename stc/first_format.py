"""Solution files of the first format.

They held the motion three times: the decision vector, the curves by name, and the inputs of the replay.  The curves are
used, everything else is computed from them as for files of the present format; if one of the others differs, the file
was altered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.errors import SolutionError
from stc.stored import Stored
from stc.trajectory import FloatArray

if TYPE_CHECKING:
    from stc.solution import Solution

#: How far apart two statements of one number may be, as a share of the largest one of its kind: they were evaluated by
#: another version, perhaps on another machine.
ROUNDING = 1e-9

_PARTS = ("value", "rate", "acceleration")


def columns(facts: dict[str, Any]) -> list[tuple[str, None]]:
    """For each column of the nodes' table, the place of its values in a file of the first format.

    The second entry is None: such a file states the values on both sides of every jump.
    """
    places = ["time"]
    places += [f"trajectory/{name}{chr(39) * order}" for name, order in facts["trajectories"]]
    places += [f"replay/{k}/{part}" for k, line in enumerate(facts["replay"]) for part in line["parts"]]
    return [(place, None) for place in places]


def read_first(stored: Stored, solution_of: Callable[[Stored], Solution]) -> Solution:
    """The solution of a file of the first format.

    Args:
        stored: the content of the file.
        solution_of: function that makes a solution from the content of a file of the present format.

    Raises:
        SolutionError: it contradicts itself.
    """
    facts = dict(stored.facts)
    facts.setdefault("optimizer", "sqp")  # what files from before there was a choice do not say
    unknowns, members = [], {}
    for variable, order in facts["trajectories"]:
        if order and facts["method"] == "central":
            continue
        name = variable + "'" * order
        before, after, mid = _sides(stored, f"trajectory/{name}")
        apart = np.flatnonzero((before != after) & ~(np.isnan(before) & np.isnan(after)))
        unknowns.append({"name": name, "after": apart.tolist()})
        members[f"unknowns/{name}"] = before
        if mid is not None:
            members[f"unknowns/{name}/mid"] = mid
        if len(apart):
            members[f"unknowns/{name}/after"] = after[apart]
    members["parameters"] = np.array(list(facts["parameters"].values()), dtype=np.float64)
    for k, _ in enumerate(facts["multipliers"]):
        members[f"multipliers/{k}"] = stored.vector(f"multipliers/{k}/values")
    facts |= {"unknowns": unknowns, "parameters": list(facts["parameters"]), "files": []}
    solution = solution_of(Stored(facts, members))
    for name, found, stated in _said_again(stored, solution):
        scale = max(float(np.abs(stated).max(initial=0.0, where=np.isfinite(stated))), 1e-300)
        if found.shape != stated.shape or not np.allclose(
            found, stated, rtol=0.0, atol=ROUNDING * scale, equal_nan=True
        ):
            raise SolutionError(
                f"the file was altered: its {name} is not the one that follows from its curves and its text"
            )
    return solution


def _sides(stored: Stored, place: str) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Values at the frames before and after jumps, and at midpoints; tables name the first as the whole."""
    before = stored.vector(f"{place}/before" if f"{place}/before" in stored.members else place)
    after = stored.vector(f"{place}/after") if f"{place}/after" in stored.members else before
    mid = stored.vector(f"{place}/mid") if f"{place}/mid" in stored.members else None
    return before, after, mid


def _said_again(stored: Stored, solution: Solution) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Everything that a file says besides its curves: name, as it says, as it is."""
    yield "time", stored.vector("time"), solution.time
    for key in ("x", "row_multipliers", "bound_multipliers"):
        yield f"solver/{key}", stored.vector(f"solver/{key}"), getattr(solution, key)
    channels = {
        f"trajectory/{name}{chr(39) * order}": c for (name, order), c in solution.trajectories.items()
    }
    for k, line in enumerate(solution.replay):
        for part in _PARTS:
            if (channel := getattr(line, part)) is not None:
                channels[f"replay/{k}/{part}"] = channel
    for place, channel in channels.items():
        before, after, mid = _sides(stored, place)
        yield place, before, channel.before
        yield place, after, channel.after
        if mid is not None and channel.mid is not None:
            yield place, mid, channel.mid
