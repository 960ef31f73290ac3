"""Solves systems of all families, and a small motion, with the library in the folder that the command line names."""

from __future__ import annotations

import os
import sys

os.environ["STC_BACKEND"] = "python"  # kernels of specs are not what this is about

from stc.core import library as core

core.FOLDER = sys.argv[1]
core.instructions = lambda: "baseline"
sys.path.insert(0, os.getcwd())

import numpy as np
from solver.kkt.kkt_problems import STRUCTURES, generic

import stc
from stc.solver.kkt import DenseKKT, structured_kkt

for seed, (name, structure) in enumerate(STRUCTURES.items()):
    for frames in (5, 40):
        rng = np.random.default_rng(seed)
        pattern = structure(rng, frames)
        one, judge = structured_kkt(*pattern.arguments()), DenseKKT(*pattern.arguments())
        for _ in range(3):
            values = generic(rng, pattern)
            assert one.factorize(*values.arguments()) == judge.factorize(*values.arguments())
            one.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        print(name, frames, type(one).__name__, flush=True)
for spec, n in (("cart_pole_swing_up", 24), ("luxo_jump", 12)):
    print(spec, stc.load(spec).solve(n=n).status, flush=True)
