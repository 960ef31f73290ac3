"""Columns of angles that jump by whole turns, and their unwrapping."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from stc.data_sets import DataSet
from stc.symbolic.expr import Expr

__all__ = ["TURNS", "bare", "remark", "unwrapped"]

FloatArray = NDArray[np.float64]

#: What a whole turn is in the units that angles are measured in, and how a spec writes it.
TURNS = ((2.0 * math.pi, ""), (360.0, " = 360"))
#: A jump is nearly a whole turn from this share of one on; what is left of it is a small part of one.
NEARLY, LEFT = 0.75, 0.25
#: So many times as large as what is left of a jump may be the steps beside it differ from it, or the usual ones.
ALIKE = 3.0


def unwrapped(values: FloatArray, turn: float) -> FloatArray:
    """The numbers with whole turns added, so that consecutive ones differ by half a turn at most.

    Parameters
    ----------
    values : (k,) array
        NaN where there is a gap; those stay.
    turn : float
        A whole turn, in the unit of the values.
    """
    found = values.copy()
    known = np.isfinite(values)
    found[known] = np.unwrap(values[known], period=turn)
    return found


def remark(data: DataSet, name: str) -> tuple[str, str] | None:
    """The message and hint for a column that jumps by whole turns; None if it does not.

    That is a column whose numbers all lie within one turn, and which jumps across nearly all of it at a row where a
    number one turn further would continue the rows before and after.
    """
    values = data.columns[name]
    rows = np.flatnonzero(np.isfinite(values)) if values.ndim == 1 else np.zeros(0, np.int64)
    for turn, written in TURNS:
        k = _leap(values[rows], turn)
        if k is None:
            continue
        before, after = int(rows[k]), int(rows[k + 1])
        path = name if all(part.isidentifier() for part in name.split(".")) else f'"{name}"'
        message = (
            f"`{data.name}.{path}` leaps from {values[before]:.5g} on {data.place(before)} to {values[after]:.5g} on "
            f"{data.place(after).split(' of ')[0]}: it seems to be an angle that begins anew after a whole turn"
        )
        hint = f'`{data.name} = "{data.where}", unwrap {path}{written};` under `data:` adds the turns that it lacks'
        return message, hint if data.file is not None else "add the whole turns that it lacks"
    return None


def _leap(values: FloatArray, turn: float) -> int | None:
    """The first number after a jump by a whole turn; None if there is none."""
    if len(values) < 4 or np.ptp(values) > turn * (1.0 + 1e-6):
        return None
    leaps = np.abs(np.diff(values)) >= NEARLY * turn
    steps = np.diff(np.unwrap(values, period=turn))
    if not leaps.any() or np.abs(steps).max() > LEFT * turn:
        return None
    usual = float(np.median(np.abs(steps[~leaps]))) if not leaps.all() else 0.0
    for k in np.flatnonzero(leaps).tolist():
        beside = [steps[j] for j in (k - 1, k + 1) if 0 <= j < len(steps) and not leaps[j]]
        if not any(abs(steps[k] - step) <= ALIKE * max(abs(step), usual) for step in beside):
            return None
    return int(np.flatnonzero(leaps)[0])


def bare(e: Expr) -> Iterator[object]:
    """The keys of all symbols of an expression outside of sines and cosines."""
    waiting, seen = [e], set[Expr]()
    while waiting:
        node = waiting.pop()
        if node in seen or node.op in ("sin", "cos"):
            continue
        seen.add(node)
        if node.op == "sym":
            yield node.payload
        waiting += node.args
