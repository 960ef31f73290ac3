"""One solve after another on the same sparsity: the next takes over what the last one allocated and planned.

Analysing a sparsity and planning its elimination cost as much as tens of factorisations of a short horizon. A
factorisation that nobody refers to any more is kept, with its arrays and its plan, for the next of the same pattern.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from stc.core.calls import Bound
from stc.solver.kkt.batched import BatchedKKT
from stc.solver.kkt.choice import new_system
from stc.solver.kkt.contract import Inertia
from stc.solver.kkt.entries import ByCopies
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.nlp import Floats, Ints

__all__ = ["StructuredKKT", "forget"]

#: What is kept: so many factorisations, of so many bytes together.
KEPT = 4
KEPT_BYTES = 128 * 2**20
#: Larger systems are not looked up: planning is a small part of their solve.
LARGEST = 200_000

_lock = threading.RLock()  # the garbage collector may give one back while another is looked up
_kept: OrderedDict[bytes, BatchedKKT | MultifrontalKKT] = OrderedDict()


class StructuredKKT(ByCopies):
    """What ``choice`` finds to suit: segments side by side, or a tree of fronts.

    A new one, or one from an earlier solve.

    See ``AttachedKKT`` for arguments and members.

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
        system = None
        if n + m <= LARGEST:
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
        if n + m <= LARGEST:
            weakref.finalize(self, _keep, key, system).atexit = False

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plan."""
        self.system.restart()

    def trust_small_pivots(self, trusted: bool) -> None:
        """See ``AttachedKKT.trust_small_pivots``."""
        self.system.trust_small_pivots(trusted)

    @property
    def factorizations(self) -> int:
        """How many matrices have been factorised so far."""
        return self.system.factorizations

    @property
    def nnz_factor(self) -> int:
        """Entries stored for the last factorisation."""
        return self.system.nnz_factor

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation, updates only."""
        return self.system.operations

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills."""
        return self.system.factor_bytes

    @property
    def last_residual(self) -> float:
        """See ``KKTSystem.last_residual``."""
        return self.system.last_residual

    @property
    def hess(self) -> Floats:
        """See ``AttachedKKT.hess``."""
        return self.system.hess

    @property
    def jac(self) -> Floats:
        """See ``AttachedKKT.jac``."""
        return self.system.jac

    @property
    def primal(self) -> Floats:
        """See ``AttachedKKT.primal``."""
        return self.system.primal

    @property
    def dual(self) -> Floats:
        """See ``AttachedKKT.dual``."""
        return self.system.dual

    @property
    def rhs(self) -> Floats:
        """See ``AttachedKKT.rhs``."""
        return self.system.rhs

    @property
    def solution(self) -> Floats:
        """See ``AttachedKKT.solution``."""
        return self.system.solution

    @property
    def second_rhs(self) -> Floats:
        """See ``AttachedKKT.second_rhs``."""
        return self.system.second_rhs

    @property
    def second_solution(self) -> Floats:
        """See ``AttachedKKT.second_solution``."""
        return self.system.second_solution

    @property
    def report(self) -> Floats:
        """See ``AttachedKKT.report``."""
        return self.system.report

    @property
    def accuracy(self) -> Floats:
        """See ``AttachedKKT.accuracy``."""
        return self.system.accuracy

    @property
    def solve_call(self) -> Bound:
        """See ``AttachedKKT.solve_call``."""
        return self.system.solve_call

    @property
    def solve_both_call(self) -> Bound:
        """See ``AttachedKKT.solve_both_call``."""
        return self.system.solve_both_call

    @property
    def inertia(self) -> NDArray[np.int64]:
        """See ``AttachedKKT.inertia``."""
        return self.system.inertia

    @property
    def attempt_call(self) -> Bound | None:
        """See ``AttachedKKT.attempt_call``."""
        return self.system.attempt_call

    def resume(self, ended: int) -> Inertia:
        """See ``AttachedKKT.resume``."""
        return self.system.resume(ended)

    def refactor(self) -> Inertia:
        """See ``AttachedKKT.refactor``."""
        return self.system.refactor()

    def check_solution(self) -> bool:
        """See ``AttachedKKT.check_solution``."""
        return self.system.check_solution()


def forget() -> None:
    """Give up what is kept."""
    with _lock:
        _kept.clear()


def _keep(key: bytes, system: BatchedKKT | MultifrontalKKT) -> None:
    """Keep a factorisation that has served, and give up the oldest ones beyond the limits."""
    with _lock:
        _kept[key] = system
        _kept.move_to_end(key)
        total = sum(kept.nbytes for kept in _kept.values())
        while _kept and (len(_kept) > KEPT or total > KEPT_BYTES):
            _, oldest = _kept.popitem(last=False)
            total -= oldest.nbytes
