"""Solves systems of all families, and small motions, with the library in the folder that the command line names."""

from __future__ import annotations

import sys

import numpy as np
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, generic

import stc
from stc.core import library as core
from stc.solver.kkt import StructuredKKT


def systems() -> None:
    """Of each structure, several matrices, beside dense algebra."""
    for seed, (name, structure) in enumerate(STRUCTURES.items()):
        for frames in (5, 40):
            rng = np.random.default_rng(seed)
            pattern = structure(rng, frames)
            one, judge = StructuredKKT(*pattern.arguments()), DenseKKT(*pattern.arguments())
            for _ in range(3):
                values = generic(rng, pattern)
                assert one.factorize(*values.arguments()) == judge.factorize(*values.arguments())
                one.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
            print(name, frames, flush=True)


def motions() -> None:
    """Whole solves, the kernels of which are not compiled."""
    for spec, n in (("cart_pole_swing_up", 24), ("arm_reach", 12)):
        print(spec, stc.load(spec).solve(n=n).status, flush=True)


if __name__ == "__main__":
    core.FOLDER = sys.argv[1]
    core.instructions = lambda: "baseline"
    systems()
    motions()
