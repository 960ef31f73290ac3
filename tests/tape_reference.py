"""The meaning of a tape, in NumPy: the oracle for kernels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stc.codegen.tape import Tape
from stc.symbolic.tables import CLIP, REACHES, READ
from stc.symbolic.traverse import NUMPY_MEANING

_CHUNK: Final = 4096
"""Instances per pass: enough to hide the cost of NumPy calls, few enough to stay in cache."""


def run(tape: Tape, uniform: ArrayLike, varying: ArrayLike) -> NDArray[np.float64]:
    """Run the tape on N instances at once.

    ``uniform`` has shape (n_uniform or more,): the numbers of tables follow the inputs.  ``varying`` has shape
    (n_varying, N); the result has shape (n_outputs, N).
    Invalid operations give nan and overflows inf, silently, as IEEE 754 says.

    Raises:
        ValueError: an input has the wrong shape.
    """
    shared = np.asarray(uniform, dtype=np.float64)
    each = np.asarray(varying, dtype=np.float64)
    if shared.ndim != 1 or len(shared) < tape.n_uniform or each.ndim != 2 or each.shape[0] != tape.n_varying:
        raise ValueError(
            f"inputs of shapes {shared.shape} and {each.shape} for a tape of {tape.n_uniform} uniform "
            f"and {tape.n_varying} varying inputs"
        )
    out = np.empty((len(tape.outputs), each.shape[1]))
    with np.errstate(all="ignore"):
        for start in range(0, each.shape[1], _CHUNK):
            _run_chunk(tape, shared, each[:, start : start + _CHUNK], out[:, start : start + _CHUNK])
    return out


def _run_chunk(
    tape: Tape, uniform: NDArray[np.float64], varying: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    meanings: dict[str, Callable[..., Any]] = {
        **NUMPY_MEANING,
        CLIP: _clip,
        REACHES: _reaches,
        READ: partial(_read, uniform),
    }
    values: list[Any] = [*uniform[: tape.n_uniform], *varying, *map(np.float64, tape.constants)]
    last_use = _last_use(tape)
    for number, (op, a, b) in enumerate(tape.ops):
        meaning = meanings[op]
        values.append(meaning(values[a]) if b < 0 else meaning(values[a], values[b]))
        if last_use[a] == number:
            values[a] = None
        if b >= 0 and last_use[b] == number:
            values[b] = None
    for row, slot in enumerate(tape.outputs):
        out[row] = values[slot]


def _last_use(tape: Tape) -> list[int]:
    """Per slot, the last operation that reads it; -1 if none does, ``len(ops)`` for outputs."""
    last = [-1] * tape.n_slots
    for number, (_, a, b) in enumerate(tape.ops):
        last[a] = number
        if b >= 0:
            last[b] = number
    for slot in tape.outputs:
        last[slot] = len(tape.ops)
    return last


def count_ops(tape: Tape, uniform: bool | None = None) -> dict[str, int]:
    """How often each operator occurs, in all operations or, by flag, the uniform or the others."""
    wanted = [
        op for (op, _, _), flag in zip(tape.ops, tape.uniform_ops, strict=True) if uniform in (None, flag)
    ]
    return dict(sorted(Counter(wanted).items()))


def _clip(x: Any, last: Any) -> Any:
    """x rounded down, between 0 and ``last``; 0 where it is no number."""
    return np.floor(np.where(x > 0.0, np.where(x < last, x, last), 0.0))


def _reaches(begin: Any, x: Any) -> Any:
    """1 where ``begin`` is not above x, else 0."""
    return np.where(np.less_equal(begin, x), 1.0, 0.0)


def _read(numbers: NDArray[np.float64], place: Any, k: Any) -> Any:
    """The numbers ``k`` places after given ones."""
    return numbers[np.add(place, k).astype(np.int64)]
