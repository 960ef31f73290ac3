"""NLopt's SLSQP (dense, quasi-Newton) with values and derivatives from CasADi: P2's trapezoidal program."""

from __future__ import annotations

from typing import Any

import casadi as ca
import nlopt
import numpy as np

from bench.peers.casadi_ipopt import _cart_pole
from bench.peers.task import Case, Outcome, Task


def build(case: Case, variant: str) -> Task:
    program, arguments, _ = _cart_pole(case)
    w, f, g = program["x"], program["f"], program["g"]
    cost = ca.Function("cost", [w], [f, ca.gradient(f, w)])
    rows = ca.Function("rows", [w], [g, ca.jacobian(g, w)])
    calls = 0

    def objective(x: np.ndarray, gradient: np.ndarray) -> float:
        nonlocal calls
        value, slope = cost(x)
        if gradient.size:
            calls += 1
            gradient[:] = np.asarray(slope).ravel()
        return float(value)

    def equalities(result: np.ndarray, x: np.ndarray, gradient: np.ndarray) -> None:
        values, slopes = rows(x)
        result[:] = np.asarray(values).ravel()
        if gradient.size:
            gradient[:] = np.asarray(ca.densify(slopes))

    def solve() -> Outcome:
        nonlocal calls
        calls = 0
        optimizer: Any = nlopt.opt(nlopt.LD_SLSQP, arguments["x0"].size)
        optimizer.set_min_objective(objective)
        optimizer.add_equality_mconstraint(equalities, np.full(g.shape[0], 1e-8))
        optimizer.set_lower_bounds(arguments["lbx"])
        optimizer.set_upper_bounds(arguments["ubx"])
        optimizer.set_ftol_rel(1e-10)
        optimizer.set_maxeval(case.max_iterations)
        optimizer.set_maxtime(case.time_limit)
        x = optimizer.optimize(arguments["x0"])
        code = optimizer.last_optimize_result()
        return Outcome(optimizer.last_optimum_value(), calls, 0 < code < 5, str(code), x)

    return Task(solve)
