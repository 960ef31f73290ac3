"""Writes the KKT systems of bundled motions as files: for work on linear systems without the rest of the solver.

    python bench/record_kkt.py                                     the motions of three dimensions, into out/kkt
    python bench/record_kkt.py luxo_jump --every 5 -o /some/folder

Each motion is solved from its own file, with the plain sparse factorisation. Of every tenth matrix, and of the last
one, ``NAME-NUMBER.npz`` holds the last system that is solved with it:

=============  ==================================================================================================
``n``, ``m``   decision variables and rows, after the presolve
``hess_rows``  with ``hess_cols``, ``hess``: the lower triangle of the Hessian of the Lagrangian, entries unique
``jac_rows``   with ``jac_cols``, ``jac``: the Jacobian of the rows
``primal``     what is added to the diagonal of the Hessian: barrier terms, regularisation; (n,)
``dual``       what is subtracted on the diagonal of the rows; (m,)
``stages``     the frame that each decision variable and then each row belongs to, for orderings; (n + m,)
``rhs``        of ``[[H + diag(primal), J'], [J, -diag(dual)]]``; (n + m,)
``solution``   by SuperLU (SciPy) and iterative refinement with residuals in extended precision; (n + m,)
``error``      its backward error: the largest residual over ``|K| |s| + |b|``, row by row
``inertia``    numbers of positive, negative and zero eigenvalues as the factorisation counts them
=============  ==================================================================================================
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

import stc
from stc.solver import Options, minimize
from stc.solver.kkt import Inertia, MultifrontalKKT

MOTIONS = (
    "quadruped_hop",
    "quadruped_trot",
    "humanoid_jump",
    "humanoid_step",
    "arm_swing",
    "falling_cat",
)

Floats = NDArray[np.float64]


class Recorder(MultifrontalKKT):
    """Keeps each matrix of the inertia that a descent direction needs, with the first system solved with it."""

    systems: list[dict[str, Any]] = []
    last: Recorder

    def __init__(self, *pattern: Any) -> None:
        super().__init__(*pattern)
        self._entries = dict(
            zip(("jac_rows", "jac_cols", "hess_rows", "hess_cols"), pattern[2:6], strict=True)
        )
        self._frames = np.concatenate(pattern[6:8])
        self._matrix: dict[str, Any] = {}
        Recorder.last = self

    @property
    def attempt_call(self) -> None:
        """None: each matrix is to be seen here."""
        return None

    def refactor(self) -> Inertia:
        self.keep()
        inertia = super().refactor()
        if inertia == (self.n, self.m, 0):
            values = {key: getattr(self, key).copy() for key in ("hess", "jac", "primal", "dual")}
            sizes = {"n": self.n, "m": self.m, "inertia": np.array(inertia), "stages": self._frames}
            self._matrix = {**sizes, **self._entries, **values}
        return inertia

    def keep(self) -> None:
        """Appends the last matrix with what was last solved with it: in machine code, so it is seen only afterwards."""
        if self._matrix and np.any(self.rhs):
            Recorder.systems.append({**self._matrix, "rhs": self.rhs.copy()})
        self._matrix = {}


def product(system: dict[str, Any], vector: Floats) -> Floats:
    """The whole matrix times a vector; both halves of the Hessian."""
    n = system["n"]
    x, y = vector[:n], vector[n:]
    rows, cols, hess = system["hess_rows"], system["hess_cols"], system["hess"]
    off = rows != cols
    top: Any = system["primal"] * x
    np.add.at(top, rows, hess * x[cols])
    np.add.at(top, cols[off], hess[off] * x[rows[off]])
    np.add.at(top, system["jac_cols"], system["jac"] * y[system["jac_rows"]])
    bottom = -system["dual"] * y
    np.add.at(bottom, system["jac_rows"], system["jac"] * x[system["jac_cols"]])
    return np.concatenate([top, bottom])


def magnitude(system: dict[str, Any], vector: Floats) -> Floats:
    """The product of absolute values: the scale of the rounding errors, row by row."""
    of = {key: np.abs(system[key]) for key in ("hess", "jac", "primal", "dual")}
    return product({**system, **of, "dual": -of["dual"]}, np.abs(vector))


def backward_error(system: dict[str, Any]) -> float:
    """Largest residual over ``|K| |s| + |b|``, row by row; tiny scales are raised."""
    residual = np.abs(system["rhs"] - product(system, system["solution"]))
    scale = magnitude(system, system["solution"]) + np.abs(system["rhs"])
    return float(np.max(residual / np.maximum(scale, 1e-16 * np.max(scale))))


def solved(system: dict[str, Any], refinements: int = 5) -> Floats:
    """Solve a recorded KKT system by SuperLU, refined with residuals in extended precision. (n + m,)"""
    n, m = system["n"], system["m"]
    rows, cols, hess = system["hess_rows"], system["hess_cols"], system["hess"]
    off, diagonal = rows != cols, np.arange(n + m)
    below, right = n + system["jac_rows"], system["jac_cols"]
    i = np.concatenate([rows, cols[off], below, right, diagonal])
    j = np.concatenate([cols, rows[off], right, below, diagonal])
    values = np.concatenate(
        [hess, hess[off], system["jac"], system["jac"], system["primal"], -system["dual"]]
    )
    factors = splu(csc_array((values, (i, j)), shape=(n + m, n + m)))
    solution = np.zeros(n + m, np.longdouble)
    for _ in range(1 + refinements):
        residual = system["rhs"] - product(system, solution)
        solution += factors.solve(residual.astype(float))
    return solution.astype(float)


def record(name: str, every: int, folder: Path) -> list[Path]:
    """Solves a spec and writes its systems.

    Parameters
    ----------
    name : of a bundled spec, or the path of one.
    every : every so many-th factorisation of the right inertia is written, and the last.
    folder : where to; it is made.
    """
    problem, transcription = stc.load(name).transcription()
    bound = transcription.bind(problem.constants)
    Recorder.systems = []
    minimize(bound, Options(), new_kkt=Recorder)
    Recorder.last.keep()
    folder.mkdir(parents=True, exist_ok=True)
    last = len(Recorder.systems) - 1
    written = []
    for k, system in enumerate(Recorder.systems):
        if k % every == 0 or k == last:
            path = folder / f"{Path(name).stem}-{k:04d}.npz"
            system["solution"] = solved(system)
            np.savez_compressed(path, **system, error=backward_error(system))
            written.append(path)
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("specs", nargs="*", default=MOTIONS)
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/kkt"))
    options = parser.parse_args()
    print("| file | unknowns | rows | entries of H | entries of J | backward error |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for spec in options.specs:
        for path in record(spec, options.every, options.output):
            with np.load(path) as file:
                sizes = file["n"], file["m"], file["hess"].size, file["jac"].size
                print(
                    f"| {path.name} | {' | '.join(f'{s:,}' for s in sizes)} | {file['error']:.0e} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
