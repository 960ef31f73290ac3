"""How fast the KKT system is factorised, against MUMPS and SuperLU, and how time and memory grow with the frames.

    python bench/kkt.py [--frames 1000] [--growth 1000,10000,100000] [--rounds 5] [--quick]

The matrices come from solves of P3 (a chain of five rods), P5 and P6 (the lamp's jump) and P4 (20 rods): the last one
of the right inertia of so many iterations. Everybody factorises the same values, which are where it expects them, on
one thread, in turn, ten times in a row, the sparsity analysed before (here: the elimination planned); times are minima
of processor time.

- MUMPS is the library and the settings that IPOPT uses (see mumps.py). It needs CasADi and gcc. It factorises the
  same matrix, and the one of the whole problem, as IPOPT has it: without what the presolve here leaves out.
- SuperLU is that of SciPy. It knows no inertia and no symmetry, and analyses the sparsity every time: a stand-in
  where MUMPS is missing.

The second table is the cart-pole's system (P2) at growing numbers of frames.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402 (threads are counted when NumPy is imported)
import math  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from dataclasses import dataclass  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from mumps import Mumps, unavailable  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

import stc  # noqa: E402
from stc.solver import Options, minimize  # noqa: E402
from stc.solver.kkt import Inertia, MultifrontalKKT, structured_kkt  # noqa: E402

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.peers.problems import constants_of, spec_of  # noqa: E402

#: So often each contender factorises in its turn.
REPEATS = 10

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


@dataclass(frozen=True)
class System:
    """A KKT matrix: the arguments of the factorisation's constructor, and the values of H, J, p and d."""

    frames: int
    pattern: tuple[Any, ...]
    values: tuple[Floats, Floats, Floats, Floats]

    def lower(self) -> tuple[int, Ints, Ints, Floats]:
        """Size, and the lower triangle of the whole matrix."""
        n, m, jac_rows, jac_cols, hess_rows, hess_cols = self.pattern[:6]
        hess, jac, primal, dual = self.values
        diagonal = np.arange(n + m)
        rows = np.concatenate([hess_rows, n + jac_rows, diagonal])
        columns = np.concatenate([hess_cols, jac_cols, diagonal])
        keys, where = np.unique(rows.astype(np.int64) * (n + m) + columns, return_inverse=True)
        values = np.bincount(where, np.concatenate([hess, jac, primal, -dual]))
        return n + m, keys // (n + m), keys % (n + m), values


class Recorder(MultifrontalKKT):
    """Remembers the last matrix of the inertia that a descent direction needs."""

    seen: tuple[Any, ...] = ()

    def __init__(self, *pattern: Any) -> None:
        super().__init__(*pattern)
        self._arguments = pattern

    @property
    def attempt_call(self) -> None:
        """None: each matrix is to be seen here."""
        return None

    def refactor(self) -> Inertia:
        inertia = super().refactor()
        if inertia == (self.n, self.m, 0) and np.any(self.hess):
            values = self.hess, self.jac, self.primal, self.dual
            Recorder.seen = self._arguments, tuple(v.copy() for v in values)
        return inertia


def system_of(spec: str, iterations: int, presolve: bool = True, **constants: Any) -> System:
    """From a solve that is stopped after so many iterations."""
    problem, transcription = stc.load(spec).transcription(**constants)
    bound = transcription.bind(problem.constants)
    Recorder.seen = ()
    minimize(bound, Options(max_iterations=iterations, retries=0, presolve=presolve), new_kkt=Recorder)
    return System(problem.n + 1, *Recorder.seen)


def least(rounds: int, *calls: Callable[[], object]) -> list[float]:
    """Least processor time of each call, taken in turn, REPEATS times in a row: in a solve the caches are its own."""
    best = [math.inf] * len(calls)
    for _ in range(rounds):
        for k, call in [(k, call) for k, call in enumerate(calls) for _ in range(REPEATS)]:
            begin = time.process_time()
            call()
            best[k] = min(best[k], time.process_time() - begin)
    return best


def backward_error(system: System, solution: Floats, rhs: Floats) -> float:
    """Largest residual over ``|K| |s| + |b|``, row by row."""
    _, rows, columns, values = system.lower()
    residual, scale = rhs.copy(), np.abs(rhs)
    off = rows != columns
    for i, j, v in ((rows, columns, values), (columns[off], rows[off], values[off])):
        np.subtract.at(residual, i, v * solution[j])
        np.add.at(scale, i, np.abs(v * solution[j]))
    return float(np.max(np.abs(residual) / np.maximum(scale, 1e-300)))


def compare(name: str, system: System, whole: System, rounds: int, with_mumps: bool) -> str:
    """A line of the table: ours, MUMPS with the same matrix and with that of the whole problem, SuperLU."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    ours = structured_kkt(*system.pattern)
    for _ in range(8):  # the plan may change until it has settled
        ours.factorize(*system.values)
    size, rows, columns, values = system.lower()
    off = rows != columns
    full = csc_array(
        (np.r_[values, values[off]], (np.r_[rows, columns[off]], np.r_[columns, rows[off]])),
        shape=(size, size),
    )
    calls: list[Callable[[], object]] = [ours.refactor, lambda: splu(full)]
    rhs = np.random.default_rng(0).normal(size=size)
    others: list[Mumps] = []
    if with_mumps:
        others = [Mumps(size, rows, columns, values), Mumps(*whole.lower())]
        found = [other.factorize() for other in others]
        if found != [system.pattern[1], whole.pattern[1]]:
            name += " (MUMPS counts another inertia)"
        calls += [other.factorize for other in others]
    seconds = least(rounds, *calls)
    error = backward_error(system, np.concatenate(ours.solve(*np.split(rhs, [system.pattern[0]]))), rhs)
    frames = system.frames
    cells = [f"{1e6 * seconds[0] / frames:.2f}"]
    for k, other in enumerate(others):
        cells += [f"{1e6 * seconds[2 + k] / frames:.1f}", f"{seconds[2 + k] / seconds[0]:.1f}"]
        other.close()
    if not others:
        cells += ["", "", "", ""]
    cells += [
        f"{1e6 * seconds[1] / frames:.1f}",
        f"{ours.operations / frames:.0f}",
        f"{1e-9 * ours.operations / seconds[0]:.1f}",
        f"{1e-3 * ours.factor_bytes / frames:.1f}",
        f"{error:.0e}",
    ]
    return f"| {name} | {frames - 1} | {size / frames:.0f} | {' | '.join(cells)} |"


def costs(system: System, rounds: int) -> tuple[float, float, float, float]:
    """Per frame: seconds of the first factorisation, of a later one, of a solve; kB of the factor."""
    begin = time.process_time()
    kkt = structured_kkt(*system.pattern)
    kkt.factorize(*system.values)
    first = time.process_time() - begin
    rhs = np.ones(system.pattern[0]), np.ones(system.pattern[1])
    again, solve = least(rounds, kkt.refactor, lambda: kkt.solve(*rhs))
    frames = system.frames
    return first / frames, again / frames, solve / frames, 1e-3 * kkt.factor_bytes / frames


def growth(frames: list[int], rounds: int) -> list[str]:
    """Time and memory per frame of one problem at several lengths."""
    lines = [
        "| frames | first, with the plan, us per frame | again, us per frame | solve, us per frame "
        "| factor, kB per frame |",
        "| ---: | ---: | ---: | ---: | ---: |",
    ]
    times = []
    for n in frames:
        first, again, solve, kilobytes = costs(system_of(spec_of("P2", 0), 4, n=n), rounds)
        times.append(again * n)
        cells = [f"{1e6 * t:.2f}" for t in (first, again, solve)]
        lines.append(f"| {n:,} | {' | '.join(cells)} | {kilobytes:.2f} |")
    if len(times) > 1:
        power = math.log(times[-1] / times[0]) / math.log(frames[-1] / frames[0])
        lines += ["", f"A factorisation grows as n^{power:.2f} from {frames[0]:,} to {frames[-1]:,} frames."]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=1000, help="of P3, and about that of P5 and P6")
    parser.add_argument("--growth", default="1000,10000,100000")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="200 frames, growth up to 5000, two rounds")
    options = parser.parse_args()
    if options.quick:
        options.frames, options.growth, options.rounds = 200, "500,5000", 2
    missing = unavailable()
    if missing:
        print(f"Without MUMPS: {missing}.\n")
    print(
        "| problem | n | unknowns per frame | here, us per frame | MUMPS, same matrix | times "
        "| MUMPS, without presolve | times | SuperLU | operations per frame | GF/s | factor, kB per frame "
        "| backward error |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for name, spec, iterations, constants in (
        ("P3", spec_of("P3", 5), 12, {"n": options.frames}),
        ("P5", spec_of("P5", 0), 14, constants_of("P5", max(options.frames // 15, 1) * 15)),
        ("P6", spec_of("P6", 0), 14, constants_of("P6", max(options.frames, 60))),
        ("P4, 20 rods", spec_of("P4", 20), 6, {"n": 50}),
    ):
        print(
            compare(
                name,
                system_of(spec, iterations, **constants),
                system_of(spec, iterations, presolve=False, **constants),
                options.rounds,
                not missing,
            ),
            flush=True,
        )
    print()
    lengths = [int(n) for n in options.growth.split(",")]
    print("\n".join(growth(lengths, max(options.rounds // 3, 3))))


if __name__ == "__main__":
    main()
