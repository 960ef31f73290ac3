"""How CasADi is asked for its solvers."""

from __future__ import annotations

from typing import Any

from bench.peers.task import Case

#: Ways to evaluate: CasADi's virtual machine over mapped functions, over one expanded expression, or compiled C.
WAYS: dict[str, dict[str, Any]] = {
    "mapped": {},
    "expanded": {"expand": True},
    "compiled": {
        "jit": True,
        "compiler": "shell",
        "jit_options": {"flags": ["-O3", "-march=native"], "compiler": "gcc", "verbose": False},
    },
}


def ipopt_options(case: Case, variant: str, **more: Any) -> dict[str, Any]:
    """Silent, exact Hessian, MUMPS; all else as IPOPT has it."""
    return {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.linear_solver": "mumps",
        "ipopt.max_iter": case.max_iterations,
        "ipopt.max_cpu_time": case.time_limit,
        **WAYS[variant],
        **more,
    }


def fatrop_options(case: Case, variant: str, **more: Any) -> dict[str, Any]:
    """Silent; all else as fatrop has it."""
    return {
        "print_time": False,
        "fatrop.print_level": 0,
        "fatrop.max_iter": min(case.max_iterations, 1000),
        **WAYS[variant],
        **more,
    }
