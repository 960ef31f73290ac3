"""Who takes part in which problem, up to which size."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any


@dataclass(frozen=True, slots=True)
class Contender:
    """One tool in one of its ways of use.

    Attributes:
        name: what tables call it; variants of one tool share ``tool`` and the best one counts.
        tool: the tool.
        module: of this package, with its ``build``.
        variant: passed to ``build``.
        needs: the package that must be importable.
        sizes: per problem, the largest n worth running (dense or very slow tools stop early).
        same: solves the very same program; else it is shown and not compared.
    """

    name: str
    tool: str
    module: str
    variant: str = ""
    needs: str = ""
    sizes: dict[str, int] = field(default_factory=dict)
    same: bool = True


_EVERY = {"P1": 100_000, "P2": 100_000, "P3": 10_000, "P3s": 200, "P4": 50}
_LAMP = {"P5": 10_000, "P6": 10_000}
_ROBOTS = {"P7": 60, "P8": 60}

CONTENDERS = (
    Contender("stc", "stc", "ours", sizes={**_EVERY, **_LAMP, **_ROBOTS}),
    *(
        Contender(
            f"IPOPT, {variant}",
            "CasADi + IPOPT",
            "casadi_ipopt",
            variant,
            "casadi",
            {**_EVERY, **_LAMP, **_ROBOTS},
        )
        for variant in ("mapped", "expanded")
    ),
    # Compiling straight-line C of a long horizon takes gcc minutes.
    Contender(
        "IPOPT, compiled",
        "CasADi + IPOPT",
        "casadi_ipopt",
        "compiled",
        "casadi",
        {"P2": 10_000, "P3": 1000, "P3s": 200, "P4": 50, "P5": 120},
    ),
    *(
        Contender(f"fatrop, {variant}", "CasADi + fatrop", "casadi_fatrop", variant, "casadi", _EVERY)
        for variant in ("mapped", "expanded")
    ),
    Contender("PIQP", "PIQP", "quadratic", "piqp", "piqp", {"P1": 100_000}),
    Contender("PIQP, multistage", "PIQP", "quadratic", "piqp-multistage", "piqp", {"P1": 100_000}),
    Contender("Clarabel", "Clarabel", "quadratic", "clarabel", "clarabel", {"P1": 100_000}),
    Contender("SuperLU", "SuperLU (SciPy)", "quadratic", "superlu", "scipy", {"P1": 100_000}),
    Contender(
        "Sleipnir",
        "Sleipnir",
        "sleipnir_python",
        "",
        "sleipnir",
        {"P1": 10_000, "P2": 10_000, "P3": 1000, "P3s": 200, "P4": 50},
    ),
    Contender("NLopt SLSQP", "NLopt", "nlopt_slsqp", "", "nlopt", {"P2": 50}),
    Contender("Drake, SNOPT", "Drake", "drake_collocation", "snopt", "pydrake", {"P2": 50}, same=False),
    Contender(
        "Crocoddyl", "Crocoddyl", "crocoddyl_shooting", "", "crocoddyl", {"P2": 1000, "P3": 1000}, same=False
    ),
    Contender("Crocoddyl, legs", "Crocoddyl", "crocoddyl_quadruped", "", "crocoddyl", {"P7": 60}, same=False),
)


def contender(name: str) -> Contender:
    """By name.

    Raises:
        KeyError: there is none.
    """
    for known in CONTENDERS:
        if known.name == name:
            return known
    raise KeyError(name)


def module_of(name: str) -> tuple[Any, str]:
    """A contender's module and variant."""
    found = contender(name)
    return import_module(f"bench.peers.{found.module}"), found.variant
