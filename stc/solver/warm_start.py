"""From the solution of a neighbouring problem: sequential quadratic programming with its active set.

Each step solves one quadratic program, whose active set is guessed from the step before (at first from the
multipliers given), moves all the way, and corrects once more with the same factorisation.  There is no
globalisation: where the error does not fall, the caller starts anew from the point as if it were a guess.
"""

from __future__ import annotations

import numpy as np

from stc.solver.active_set import Projection, project
from stc.solver.monitor import Monitor
from stc.solver.nlp import Floats
from stc.solver.options import Options
from stc.solver.quadratic import QuadraticProgram, guess_from_multipliers
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["from_neighbour"]

STEPS = 12
PATIENCE = 2
"""How many steps in all may fail to reduce the error."""
REDUCTION = 0.5
FARTHEST = 1e3
"""A step that makes the error this many times larger than the smallest one ends the attempt."""


def from_neighbour(
    form: ScaledProblem, x: Floats, y: Floats, options: Options, monitor: Monitor
) -> Projection | None:
    """Solve from a primal-dual point, scaled: (n,) and (m,).

    Returns:
        The solution, with positive curvature on its active set; None when the iteration did not converge.
    """
    x_lower, x_upper = form.true_x
    point = project(form, np.clip(x, x_lower, x_upper), y)
    if point is None:
        return None
    active = guess_from_multipliers(form, point.lagrangian, y)
    smallest, patience = point.error, PATIENCE
    for _ in range(STEPS):
        program = QuadraticProgram(form, point, 0.1 * options.tolerance)
        found = program.solve(active, options)
        if found is None:
            return None
        active = found.active
        new = project(form, np.clip(point.x + found.d, x_lower, x_upper), found.y)
        if new is None:
            return None
        if found.factorised and new.error > 0.1 * options.tolerance:
            dx, dy = program.correct(new)
            corrected = project(form, np.clip(new.x + dx, x_lower, x_upper), new.y + dy)
            if corrected is not None and corrected.error < new.error:
                new = corrected
        monitor.count()
        x_user, f_user, violation = form.user_view(new.x, new.f, new.r)
        step = float(np.abs(new.x - point.x).max(initial=0.0))
        monitor.record(
            x_user, form.user_multipliers(new.y), f_user, violation, new.error, step, 1.0, 0.0, 0.0, "warm"
        )
        if new.error <= options.tolerance:
            return new
        if new.error > REDUCTION * smallest:
            patience -= 1
            if patience < 0 or new.error > FARTHEST * smallest:
                return None
        smallest = min(smallest, new.error)
        point = new
    return None
