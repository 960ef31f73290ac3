"""Second-order check of a stationary point, and the way off a saddle."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.globalization import largest_step
from stc.solver.iterate import Iterate, refresh
from stc.solver.newton_system import NewtonSystem, SingularSystem

__all__ = ["leave_saddle"]

POWER_STEPS = 4
NEGLIGIBLE = 1e-7
FRACTION = 0.9


def leave_saddle(form: Formulation, it: Iterate, system: NewtonSystem, seed: int) -> bool:
    """Move off a stationary point along negative curvature of the Lagrangian on the constraints.

    When the matrix at ``it`` has the right inertia only after a shift, inverse iteration with the shifted
    factorisation turns a random vector into the direction of most negative curvature.

    Returns:
        True when ``it`` was moved to a point of lower objective; False when it satisfies the second-order
        conditions as far as can be told.
    """
    mu = float(it.gap @ it.z) / max(1, form.gaps)
    try:
        system.factorize(it, max(mu, 1e-9))
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
        norm = float(np.linalg.norm(v))
        if not np.isfinite(norm) or norm == 0.0:
            return False
        v = v / norm
    dw = dw / norm
    curvature = float(v @ form.hessian_times(it.hess, v))
    if curvature >= -NEGLIGIBLE:
        return False
    if float(it.dual[: form.n] @ v) > 0.0:
        dw = -dw
    return _descend(form, it, dw)


def _descend(form: Formulation, it: Iterate, dw: np.ndarray) -> bool:
    n = form.n
    scale = 0.1 * max(1.0, float(np.abs(it.w[:n]).max(initial=0.0)))
    for direction in (dw, -dw):
        limit = largest_step(it.gap, scale * (form.sign * direction[form.index]), FRACTION)
        alpha = limit * scale
        for _ in range(20):
            w = it.w + alpha * direction
            f, r = form.values(w[:n])
            w[n:] = np.where(form.inequality, w[n:], it.w[n:])
            c = form.residual(r, w)
            theta = float(np.abs(c).sum())
            price = 1.0 + 2.0 * float(np.abs(it.y).max(initial=0.0))
            if np.isfinite(f + theta) and f + price * theta < it.f + price * it.theta - 1e-12 * abs(it.f):
                it.w, it.f, it.r, it.c, it.theta, it.gap = w, f, r, c, theta, form.gap(w)
                return refresh(form, it)
            alpha *= 0.5
    return False
