"""Second-order check of a stationary point, and the way off a saddle."""

from __future__ import annotations

import numpy as np

from stc.solver.globalization import largest_step
from stc.solver.iterate import evaluate
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.nlp import Floats
from stc.solver.products import inner, norm

__all__ = ["leave_saddle"]

POWER_STEPS = 8
NEGLIGIBLE = 1e-7
FRACTION = 0.9
FIRST_TRIAL = 0.1
TRIALS = 16
RETURNS = 3
SIGNIFICANT = 1e-11


def leave_saddle(system: NewtonSystem, seed: int) -> bool:
    """Move off a stationary point along negative curvature of the Lagrangian on the constraints.

    When the matrix at ``it`` has the right inertia only after a shift, inverse iteration with the shifted
    factorisation turns a random vector into the direction of most negative curvature.

    Returns:
        True when the iterate was moved to a point of lower objective; False when it satisfies the second-order
        conditions as far as can be told.
    """
    form, work = system.form, system.work
    it = work.it
    mu = inner(it.gap, it.z) / max(1, form.gaps)
    try:
        system.factorize(max(mu, 1e-9), exact=True)
        system.tighten()
    except SingularSystem:
        return False
    if system.shift <= NEGLIGIBLE:
        return False
    v = np.random.default_rng(seed).standard_normal(form.n) * form.free
    zeros = np.zeros(form.m)
    rhs = np.zeros(form.size)
    for _ in range(POWER_STEPS):
        rhs[: form.n] = v
        dw, _ = system.solve(rhs, zeros)
        v = dw[: form.n]
        length = norm(v)
        if not np.isfinite(length) or length == 0.0:
            return False
        v = v / length
    dw = dw / length
    curvature = inner(v, form.hessian_times(it.hess, v))
    if curvature >= -NEGLIGIBLE:
        return False
    if inner(it.dual[: form.n], v) > 0.0:
        dw = -dw
    return _descend(system, dw)


def _descend(system: NewtonSystem, dw: Floats) -> bool:
    """Walk along ``dw`` or its opposite, back onto the rows after each trial, as far as the objective falls."""
    form, work = system.form, system.work
    it, n = work.it, form.n
    scale = FIRST_TRIAL * max(1.0, float(np.abs(it.w[:n]).max(initial=0.0)))
    price = 1.0 + 2.0 * float(np.abs(it.y).max(initial=0.0))
    merit = it.f + price * it.theta
    for direction in (dw, -dw):
        alpha = scale * largest_step(it.gap, scale * (form.sign * direction[form.index]), FRACTION)
        for _ in range(TRIALS):
            w = it.w + alpha * direction
            for _ in range(RETURNS):
                f, r = form.values(w[:n])
                c = form.residual(r, w)
                theta = float(np.abs(c).sum())
                if not np.isfinite(f + theta):
                    break
                if f + price * theta < merit - SIGNIFICANT * (1.0 + abs(it.f)):
                    moved = evaluate(form, w, it.y.copy(), it.z.copy())
                    if not moved.is_finite:
                        return False
                    work.load(moved)
                    return True
                if theta <= it.theta:
                    break
                back, _ = system.solve(np.zeros(form.size), c)
                w = w + largest_step(form.gap(w), form.sign * back[form.index], FRACTION) * back
            alpha *= 0.5
    return False
