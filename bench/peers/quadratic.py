"""P1 as the quadratic problem that it is: minimise z'Hz/2 subject to Az = b, for tools of quadratic programming.

Unknowns are stage by stage position, velocity, acceleration (x and y each); rows are the trapezoidal defects,
then the waypoints.  A solve includes the factorisation, as it does for every other tool.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from bench.peers import problems
from bench.peers.task import Case, Outcome, Task


@dataclass(frozen=True)
class Quadratic:
    """H (nz, nz) diagonal, A (m, nz) and b (m,)."""

    hessian: Any
    matrix: Any
    target: np.ndarray


def quadratic(n: int) -> Quadratic:
    """P1's matrices."""
    h = problems.POINT_TIME / n
    # One axis: unknowns (position, velocity, acceleration) per stage, rows (position gap, velocity gap).
    here = np.array([[-1.0, -h / 2, 0.0], [0.0, -1.0, -h / 2]])
    there = np.array([[1.0, -h / 2, 0.0], [0.0, 1.0, -h / 2]])
    both = np.eye(2)
    now, then = np.kron(here, both), np.kron(there, both)
    stages = sp.eye(n, n + 1, format="csr")
    shifted = sp.eye(n, n + 1, k=1, format="csr")
    gaps = sp.kron(stages, now) + sp.kron(shifted, then)
    fixed: list[int] = []
    values: list[float] = []
    for share, *point in problems.WAYPOINTS:
        first = 6 * round(share * n)
        known = [*point, 0.0, 0.0] if share in (0.0, 1.0) else list(point)
        fixed += range(first, first + len(known))
        values += known
    pick = sp.csr_matrix((np.ones(len(fixed)), (range(len(fixed)), fixed)), (len(fixed), 6 * (n + 1)))
    matrix = sp.vstack([gaps, pick], format="csc")
    weight = np.full(n + 1, 2.0 * h)
    weight[0] = weight[-1] = h
    diagonal = np.zeros((n + 1, 6))
    diagonal[:, 4:] = weight[:, None]
    return Quadratic(
        sp.diags(diagonal.ravel(), format="csc"), matrix, np.concatenate([np.zeros(4 * n), values])
    )


def build(case: Case, variant: str) -> Task:
    program = quadratic(case.n)
    solvers = {"superlu": _superlu, "clarabel": _clarabel, "piqp": _piqp, "piqp-multistage": _multistage}
    return solvers[variant](program)


def _superlu(program: Quadratic) -> Task:
    """The bare minimum of any solver with general sparsity: one factorisation and one solve."""
    from scipy.sparse.linalg import splu

    size = program.hessian.shape[0]
    system = sp.bmat([[program.hessian, program.matrix.T], [program.matrix, None]], "csc")
    right = np.concatenate([np.zeros(size), program.target])

    def solve() -> Outcome:
        x = splu(system, permc_spec="COLAMD").solve(right)[:size]
        return Outcome(float(0.5 * x @ (program.hessian @ x)), 1, True, "", x)

    return Task(solve, "one factorisation and solve, nothing checked")


def _clarabel(program: Quadratic) -> Task:
    import clarabel

    rows, size = program.matrix.shape
    upper = sp.triu(program.hessian).tocsc()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(rows)]

    def solve() -> Outcome:
        solver = clarabel.DefaultSolver(
            upper, np.zeros(size), program.matrix, program.target, cones, settings
        )
        answer = solver.solve()
        status = str(answer.status)
        return Outcome(float(answer.obj_val), int(answer.iterations), status == "Solved", status, answer.x)

    return Task(solve)


def _multistage(program: Quadratic) -> Task:
    return _piqp(program, multistage=True)


def _piqp(program: Quadratic, multistage: bool = False) -> Task:
    import piqp

    linear = np.zeros(program.hessian.shape[0])

    def solve() -> Outcome:
        solver = piqp.SparseSolver()
        solver.settings.verbose = False
        if multistage:
            solver.settings.kkt_solver = piqp.KKTSolver.sparse_multistage
        solver.setup(program.hessian, linear, program.matrix, program.target)
        status = solver.solve()
        info = solver.result.info
        return Outcome(
            float(info.primal_obj),
            int(info.iter),
            status == piqp.Status.PIQP_SOLVED,
            str(status),
            np.array(solver.result.x),
        )

    return Task(solve)
