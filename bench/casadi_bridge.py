"""The very same nonlinear program for CasADi + IPOPT: what a user of those would write, built from a spec.

Every kernel's values become a CasADi function, mapped over its nodes; CasADi differentiates and IPOPT solves.
Used to compare statuses, objectives and iterations on one and the same problem.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import casadi as ca
import numpy as np

from stc.codegen.tape import Tape
from stc.transcription.assemble import data_of
from stc.transcription.bind import BoundProgram

OPERATORS = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b,
    "neg": lambda a, b: -a,
    "atan2": ca.atan2,
}


@dataclass
class PeerResult:
    status: str
    objective: float
    iterations: int
    seconds: float
    x: np.ndarray


def function_of(tape: Tape, name: str) -> ca.Function:
    """A tape as a CasADi function (uniform, varying) -> outputs."""
    uniform, varying = ca.SX.sym("u", tape.n_uniform), ca.SX.sym("v", tape.n_varying)
    slots = [uniform[k] for k in range(tape.n_uniform)] + [varying[k] for k in range(tape.n_varying)]
    slots += [ca.SX(c) for c in tape.constants]
    for op, a, b in tape.ops:
        if op in OPERATORS:
            slots.append(OPERATORS[op](slots[a], slots[b] if b >= 0 else None))
        else:
            slots.append(getattr(ca, op)(slots[a]))
    return ca.Function(name, [uniform, varying], [ca.vertcat(*[slots[k] for k in tape.outputs])])


def program(bound: BoundProgram) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Decision vector, objective and rows of a bound program as CasADi expressions."""
    structure = bound.program
    w = ca.MX.sym("w", structure.size)
    f = ca.MX(0)
    rows = [ca.MX(0)] * structure.row_count
    stacked, order = [], []
    for g, group in enumerate(structure.groups):
        tape = group.programs.values_tape
        if not tape.outputs:
            continue
        data = data_of(bound.workspace, group, structure.data_start[g])
        inputs = [
            ca.reshape(w[group.positions[k].tolist()], 1, group.size) for k in range(len(group.unknown))
        ]
        inputs += [ca.MX(ca.DM(data[k])).T for k in range(len(group.data))]
        function = function_of(tape, f"g{g}")
        mapped = function.map(group.size)
        out = mapped(ca.repmat(ca.DM(bound.uniform), 1, group.size), ca.vertcat(*inputs))
        for r in range(len(group.rows)):
            stacked.append(out[r, :].T)
            order.append(group.row_ids[r])
        if group.objective is not None:
            f = f + ca.sum2(out[len(group.rows), :])
    if not stacked:
        return w, f, ca.MX(0, 1)
    together = ca.vertcat(*stacked)
    inverse = np.empty(structure.row_count, int)
    inverse[np.concatenate(order)] = np.arange(structure.row_count)
    del rows
    return w, f, together[inverse.tolist()]


def ipopt(bound: BoundProgram, expand: bool = True, **options: object) -> PeerResult:
    """Solves a bound program with IPOPT (MUMPS), exact derivatives, from the same starting point."""
    w, f, r = program(bound)
    settings = {
        "print_time": False,
        "expand": expand,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        **{f"ipopt.{k}": v for k, v in options.items()},
    }
    solver = ca.nlpsol("s", "ipopt", {"x": w, "f": f, "g": r}, settings)
    begin = time.process_time()
    answer = solver(
        x0=bound.x0, lbx=bound.x_lower, ubx=bound.x_upper, lbg=bound.row_lower, ubg=bound.row_upper
    )
    seconds = time.process_time() - begin
    stats = solver.stats()
    return PeerResult(
        stats["return_status"],
        float(answer["f"]),
        stats["iter_count"],
        seconds,
        np.array(answer["x"]).ravel(),
    )
