"""From the solution of a neighbouring problem: sequential quadratic programming with its active set.

Each step solves one quadratic program, whose active set is guessed from the step before (at first from the
multipliers given), moves all the way, and corrects once more with the same factorisation.  There is no
globalisation: where the error does not fall, the caller starts anew from the point as if it were a guess.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from stc.solver.active_set import PATIENCE, STEPS
from stc.solver.constants import ACCURATE, HALF
from stc.solver.monitor import Monitor
from stc.solver.nlp import Floats
from stc.solver.projection import AGAINST_DEPENDENT_ROWS
from stc.solver.quadratic import (
    PrimalDual,
    QuadraticProgram,
    QuadraticSolution,
    guess_from_multipliers,
    measure,
)
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["from_neighbour"]


def from_neighbour(
    form: ScaledProblem,
    x: Floats,
    y: Floats,
    z: Floats,
    tolerance: float,
    monitor: Monitor,
) -> tuple[PrimalDual | None, bool]:
    """Solve from a primal-dual point, scaled: variables (n,), multipliers of rows (m,) and bounds (n,).

    Returns:
        The solution, or None when the iteration did not converge; and whether the last factorisation showed positive
        curvature on its active set.
    """
    point = measure(form, x, y, z)
    if point is None:
        return None, False
    active = guess_from_multipliers(form, point)
    smallest, patience = point.error, PATIENCE
    regularity = 0
    for _ in range(STEPS):
        program = QuadraticProgram(form, point, ACCURATE * tolerance, regularity, monitor.check_time)
        found = program.solve(active)
        # The shift of the Hessian slows the next steps down, and is tried anew.
        regularity = min(program.regularity, AGAINST_DEPENDENT_ROWS)
        if found is None:
            return None, False
        active = found.active
        new = _moved(form, point, program, found, ACCURATE * tolerance)
        if new is None:
            return None, False
        monitor.count()
        f_user, violation = form.user_objective(new.f), form.violation(new.x, new.r)
        step = float(np.abs(new.x - point.x).max(initial=0.0))
        monitor.record("warm", partial(form.as_stated, new.x, new.y), f_user, violation, new.error, step)
        if new.error <= tolerance:
            return new, program.regularity <= AGAINST_DEPENDENT_ROWS
        if new.error > HALF * smallest:
            patience -= 1
            if patience < 0:
                return None, False
        smallest = min(smallest, new.error)
        point = new
    return None, False


def _moved(
    form: ScaledProblem,
    point: PrimalDual,
    program: QuadraticProgram,
    found: QuadraticSolution,
    tolerance: float,
) -> PrimalDual | None:
    """The whole step, and the second one with the same factorisation where that comes closer."""
    balancing = found.active.x != 0
    new = measure(form, point.x + found.d, found.y, found.z, balancing)
    if new is None or new.error <= tolerance:
        return new
    dx, dy = program.correct(new, found.active)
    closer = measure(form, new.x + dx, new.y + dy, found.z, balancing)
    return closer if closer is not None and closer.error < new.error else new
