"""One solve after another on the same sparsity: the next takes over what the last one allocated and planned.

Analysing a sparsity and planning its elimination cost as much as tens of factorisations of a short horizon. A
factorisation that nobody refers to any more is kept, with its arrays and its plan, for the next of the same pattern.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.segments import find_segments, number_stages
from stc.solver.nlp import Ints

__all__ = ["StructuredKKT", "forget", "new_system"]

#: What is kept: so many factorisations, of so many bytes together.
KEPT = 4
KEPT_BYTES = 128 * 2**20

_lock = threading.RLock()  # the garbage collector may give one back while another is looked up
_kept: OrderedDict[bytes, MultifrontalKKT] = OrderedDict()


class StructuredKKT:
    """The factorisation that suits a sparsity: segments side by side, or a tree of fronts.

    A new one, or one from an earlier solve; it is used like any ``KKTSystem``.

    Attributes:
        system: which one it is. Whoever uses that instead keeps this object, too: it is given back with it.

    It behaves like a new one, but for the order of elimination that the earlier solve ended with, so that results
    may differ in the last digits.
    """

    def __init__(
        self,
        n: int,
        m: int,
        jac_rows: Ints,
        jac_cols: Ints,
        hess_rows: Ints,
        hess_cols: Ints,
        var_stage: Ints,
        row_stage: Ints,
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        held = np.zeros(n, dtype=bool) if held is None else held
        arrays = jac_rows, jac_cols, hess_rows, hess_cols, var_stage, row_stage, held
        digest = blake2b(f"{n} {m}".encode(), digest_size=16)
        for array in arrays:
            digest.update(np.ascontiguousarray(array, dtype=np.int32).data)
            digest.update(b"|")
        key = digest.digest()
        with _lock:
            system = _kept.pop(key, None)
        if system is None:
            system = new_system(n, m, *arrays)
        else:
            system.restart()
        self.system = system
        weakref.finalize(self, _keep, key, system).atexit = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self.system, name)


def forget() -> None:
    """Give up what is kept."""
    with _lock:
        _kept.clear()


def _keep(key: bytes, system: MultifrontalKKT) -> None:
    """Keep a factorisation that has served, and give up the oldest ones beyond the limits."""
    with _lock:
        _kept[key] = system
        _kept.move_to_end(key)
        total = sum(kept.nbytes for kept in _kept.values())
        while _kept and (len(_kept) > KEPT or total > KEPT_BYTES):
            _, oldest = _kept.popitem(last=False)
            total -= oldest.nbytes


def new_system(
    n: int, m: int, jac_rows: Ints, jac_cols: Ints, hess_rows: Ints, hess_cols: Ints,
    var_stage: Ints, row_stage: Ints, held: NDArray[np.bool_],
) -> MultifrontalKKT:  # fmt: skip
    """The factorisation that suits a sparsity, made anew; arguments as for ``StructuredKKT``."""
    couplings = Couplings.of(n, m, jac_rows, jac_cols, hess_rows, hess_cols)
    stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
    numbered = number_stages(couplings, stage, held)
    found = None if numbered is None else find_segments(numbered)
    return MultifrontalKKT.of_couplings(couplings, stage, found)
