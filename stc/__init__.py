"""Spacetime constraints: state a motion as constraints and an objective, solve it, and validate it in MuJoCo.

    import stc

    problem = stc.load("particle_waypoints")
    solution = problem.solve(n=120, method="hermite-simpson")
    solution.time, solution["x"], solution["x'"]     # values at the frames 0..n
    solution.at(0.25)["x"]                            # between the frames, by the method's polynomials
    solution.save("a.npz")
    stc.read("a.npz")

Names are imported when they are first used, so that ``import stc`` is fast.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

from stc.version import __version__ as __version__

_HOME = {
    "Diagnostic": "stc.errors",
    "EndedError": "stc.errors",
    "EvaluationError": "stc.errors",
    "Model": "stc.pipeline",
    "Solution": "stc.solution",
    "SolutionError": "stc.errors",
    "SpecError": "stc.errors",
    "StcError": "stc.errors",
    "UsageError": "stc.errors",
    "load": "stc.pipeline",
    "read": "stc.solution",
    "sweep": "stc.sweeps",
}

__all__ = sorted([*_HOME, "__version__"])

# An installation holds validate/, models/ and specs/ in this folder.  In a checkout they lie beside it; then
# their parent is searched too, so that `stc.validate` is found wherever Python picked up this file.
_HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 (pathlib would double the import time)
if not os.path.isdir(os.path.join(_HERE, "validate")):  # noqa: PTH112, PTH118
    __path__.append(os.path.dirname(_HERE))  # noqa: PTH120


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'stc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
