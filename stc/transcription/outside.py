"""Tables that a motion uses outside of their numbers, which is extrapolation."""

from __future__ import annotations

import numpy as np

from stc.problem import DefinitionRef, FrameRange
from stc.symbolic.expr import Expr, reachable, symbols
from stc.symbolic.tables import TableRef
from stc.transcription.recover import Recovery

__all__ = ["used_outside"]

#: So far beyond an end, as a share of a table's length, is rounding.
_ROUNDING = 1e-9

_MEANT = {
    "extend": "there it continues linearly with its last slope",
    "hold": "there it keeps its last value",
    "error": "there it has no value",
}


def used_outside(recovery: Recovery) -> list[str]:
    """A note for each table that a motion uses outside of its numbers."""
    problem = recovery.problem
    if not problem.data:
        return []
    stated = [(r.body, r.range) for r in problem.relations] + [(o.body, o.range) for o in problem.objective]
    worst: dict[str, tuple[float, float, float, TableRef]] = {}
    seen: set[tuple[Expr, FrameRange]] = set()
    while stated:
        body, where = stated.pop()
        for key in symbols(body):
            if isinstance(key, DefinitionRef):
                stated += [(piece.body, where) for piece in problem.definitions[key.name]]
        for node in reachable([body]):
            if node.op != "look" or (node, where) in seen:
                continue
            seen.add((node, where))
            for argument, ref, number in _arguments(node):
                found = _farthest(recovery, argument, where, ref, number)
                if found is not None and found[0] > worst.get(ref.name, (0.0,))[0]:
                    worst[ref.name] = (*found, ref)
    return [_told(name, *found) for name, found in sorted(worst.items())]


def _arguments(node: Expr) -> list[tuple[Expr, TableRef, int]]:
    """The arguments of a look-up, with the table and the number of the argument."""
    x, place = node.args
    leaf = place.args[1] if place.op == "at" else place
    if leaf.payload.table.kind == "steps":  # where a recording is there: it is looked up besides
        return []
    both = [x, *place.args[:1]]
    return [(argument, leaf.payload.base, k) for k, argument in enumerate(both)]


def _farthest(
    recovery: Recovery, argument: Expr, where: FrameRange, ref: TableRef, number: int
) -> tuple[float, float, float] | None:
    """The largest distance of an argument from its table's range, relative to that range; its value; the frame."""
    axis = ref.table.axes[number].x
    values = recovery.channel(argument).before[where.first : where.last + 1]
    beyond = np.maximum(axis[0] - values, values - axis[-1]) / (axis[-1] - axis[0])
    if not (beyond > _ROUNDING).any():
        return None
    k = int(np.nanargmax(beyond))
    return float(beyond[k]), float(values[k]), float(where.first + k)


def _told(name: str, share: float, value: float, frame: float, ref: TableRef) -> str:
    if ref.of_time:
        begin, end = ref.table.axes[0].x[[0, -1]]
        return (
            f"`{name}` is recorded from {begin:.6g} to {end:.6g} s, and this motion reads it outside, farthest at "
            f"frame {frame:g} ({value:.6g} s): integrals do not count it there, other statements take its last value"
        )
    ends = " and ".join(f"{axis.x[0]:.6g} to {axis.x[-1]:.6g}" for axis in ref.table.axes)
    return (
        f"the table `{name}` is from {ends}, and this motion uses it outside, farthest at frame {frame:g} "
        f"({value:.6g}): {_MEANT[ref.table.outside]}"
    )
