"""The number of arithmetic operations for the derivatives of a whole motion, before and after simplification.

Three ways to compute the same numbers are compared, over all frames:

*naive trees*
    the chain rule applied to every statement at every frame for every unknown, nothing simplified, nothing
    shared.  ``all`` differentiates by every unknown of the motion (most of these derivatives are zero), ``own``
    only by the unknowns that the statement holds.
*simplified*
    the same derivatives as trees after simplification, zeros left out.
*shared*
    every common subexpression of one frame's derivatives computed once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.records import dataclass
from stc.symbolic.counting import naive_hessian_ops, naive_jacobian_ops, shared_ops, tree_ops
from stc.symbolic.differentiate import gradient, hessian, jacobian
from stc.symbolic.expr import Expr, sum_of, sym
from stc.transcription.derive import Group, MultiplierRef, ObjectiveFactor
from stc.transcription.statements import unknowns

if TYPE_CHECKING:
    from stc.transcription.transcription import Transcription


@dataclass(slots=True)
class Operations:
    """Operations over the whole motion for one matrix."""

    naive_all: int = 0
    naive_own: int = 0
    simplified: int = 0
    shared: int = 0

    def vanished(self, naive: int) -> float:
        """The share of the naive operations that simplification and sharing remove."""
        return 1.0 - self.shared / naive if naive else 0.0


def count_operations(transcription: Transcription) -> dict[str, Operations]:
    """Operations of the Jacobian (with the objective's gradient) and of the Lagrangian's Hessian."""
    found = {"jacobian": Operations(), "hessian": Operations()}
    for group in transcription.program.groups:
        _add(found["jacobian"], found["hessian"], group, transcription.program.size)
    return found


def _add(first: Operations, second: Operations, group: Group, unknown_count: int) -> None:
    bodies = [row.body for row in group.rows]
    every = bodies + ([] if group.objective is None else [group.objective])
    for body in every:
        own = len(unknowns(body))
        first.naive_all += group.size * naive_jacobian_ops(body, unknown_count)
        first.naive_own += group.size * naive_jacobian_ops(body, own)
        # The Hessian of a row enters times its multiplier.
        weighted = sym(MultiplierRef(0)) * body
        second.naive_all += group.size * naive_hessian_ops(weighted, unknown_count)
        second.naive_own += group.size * naive_hessian_ops(weighted, own)
    slopes = list(jacobian(bodies, group.unknown).values())
    if group.objective is not None:
        slopes += gradient(group.objective, group.unknown)
    lagrangian = [sym(MultiplierRef(number)) * body for number, body in enumerate(bodies)]
    if group.objective is not None:
        lagrangian.append(sym(ObjectiveFactor()) * group.objective)
    curvatures = list(hessian(sum_of(lagrangian), group.unknown).values())
    for into, entries in ((first, slopes), (second, curvatures)):
        into.simplified += group.size * _trees(entries)
        into.shared += group.size * shared_ops(entries)


def _trees(entries: list[Expr]) -> int:
    return sum(tree_ops(entry) for entry in entries)
