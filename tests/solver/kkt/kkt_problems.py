"""Structured KKT systems with random values: what the factorisations are tried on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pattern:
    """The arguments of a KKT system, by name."""

    n: int
    m: int
    jac_rows: NDArray[np.int32]
    jac_cols: NDArray[np.int32]
    hess_rows: NDArray[np.int32]
    hess_cols: NDArray[np.int32]
    var_stage: NDArray[np.int32]
    row_stage: NDArray[np.int32]

    def arguments(self) -> tuple[object, ...]:
        return (
            self.n,
            self.m,
            self.jac_rows,
            self.jac_cols,
            self.hess_rows,
            self.hess_cols,
            self.var_stage,
            self.row_stage,
        )

    def matrix(self, values: Values) -> Floats:
        """K written out, by an indexing of its own."""
        k = np.zeros((self.n + self.m, self.n + self.m))
        for i, j, v in zip(self.hess_rows, self.hess_cols, values.hess, strict=True):
            k[i, j] = k[j, i] = v
        for i, j, v in zip(self.jac_rows, self.jac_cols, values.jac, strict=True):
            k[self.n + i, j] = k[j, self.n + i] = v
        for i, v in enumerate(values.primal):
            k[i, i] += v
        for i, v in enumerate(values.dual):
            k[self.n + i, self.n + i] -= v
        return k


@dataclass
class Values:
    hess: Floats
    jac: Floats
    primal: Floats
    dual: Floats

    def arguments(self) -> tuple[Floats, Floats, Floats, Floats]:
        return self.hess, self.jac, self.primal, self.dual


class Builder:
    """Collects variables, rows and couplings of a motion by frames."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.var_stage: list[int] = []
        self.row_stage: list[int] = []
        self.jac: dict[tuple[int, int], None] = {}
        self.hess: dict[tuple[int, int], None] = {}

    def variables(self, count: int, stage: int) -> list[int]:
        self.var_stage.extend([stage] * count)
        return list(range(len(self.var_stage) - count, len(self.var_stage)))

    def row(self, stage: int, variables: list[int], density: float = 1.0) -> None:
        number = len(self.row_stage)
        self.row_stage.append(stage)
        chosen = [v for v in variables if self.rng.random() < density] or variables[:1]
        for v in chosen:
            self.jac[number, v] = None

    def curvature(self, variables: list[int], density: float) -> None:
        for v in variables:
            for w in variables:
                if w <= v and self.rng.random() < density:
                    self.hess[v, w] = None

    def pattern(self) -> Pattern:
        """The result, its entries shuffled: nothing may depend on their order."""
        jac = self.rng.permutation(np.array(list(self.jac), dtype=np.int32).reshape(-1, 2))
        hess = self.rng.permutation(np.array(list(self.hess), dtype=np.int32).reshape(-1, 2))
        return Pattern(
            len(self.var_stage),
            len(self.row_stage),
            np.ascontiguousarray(jac[:, 0]),
            np.ascontiguousarray(jac[:, 1]),
            np.ascontiguousarray(hess[:, 0]),
            np.ascontiguousarray(hess[:, 1]),
            np.array(self.var_stage, dtype=np.int32),
            np.array(self.row_stage, dtype=np.int32),
        )


def chain(rng: np.random.Generator, frames: int) -> Pattern:
    """Frames linked with the next one, as trapezoidal transcription makes them, pinned at both ends."""
    b = Builder(rng)
    width = int(rng.integers(2, 6))
    x = [b.variables(width, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 0.4)
        b.row(i, x[i], 0.7)
        if i + 1 < frames:
            for _ in range(width - 2):
                b.row(i, x[i] + x[i + 1], 0.6)
    b.row(0, x[0][:1])
    b.row(frames - 1, x[-1][-1:])
    return b.pattern()


def bordered(rng: np.random.Generator, frames: int) -> Pattern:
    """A chain with two parameters in every frame, one row over everything, and integral curvature."""
    b = Builder(rng)
    x = [b.variables(4, i) for i in range(frames)]
    parameters = b.variables(2, frames - 1)
    for i in range(frames):
        b.curvature(x[i] + parameters, 0.3)
        b.row(i, x[i] + parameters)
        if i + 1 < frames:
            b.row(i, x[i] + x[i + 1] + parameters[:1], 0.8)
    b.row(frames - 1, [v for frame in x for v in frame[:1]])
    return b.pattern()


def absolute(rng: np.random.Generator, frames: int) -> Pattern:
    """Every frame refers to frame 0 and to a frame in the middle; the last one closes on the first."""
    b = Builder(rng)
    x = [b.variables(3, i) for i in range(frames)]
    middle = x[frames // 2]
    for i in range(frames):
        b.curvature(x[i], 0.5)
        b.row(i, x[i] + x[0][:2] + middle[:1])
        if i + 1 < frames:
            b.row(i, x[i] + x[i + 1])
    b.row(frames - 1, x[0][:1] + x[-1][:1])
    return b.pattern()


def stencil(rng: np.random.Generator, frames: int, reach: int = 1) -> Pattern:
    """Rows and curvature over ``2 reach + 1`` frames, as central differences make them."""
    b = Builder(rng)
    x = [b.variables(3, i) for i in range(frames)]
    for i in range(frames):
        near = [v for j in range(max(i - reach, 0), min(i + reach + 1, frames)) for v in x[j]]
        b.curvature(near, 0.15)
        b.row(i, near, 0.8)
        b.row(i, x[i], 0.8)
    return b.pattern()


def five_points(rng: np.random.Generator, frames: int) -> Pattern:
    """Five frames in each stencil."""
    return stencil(rng, frames, 2)


def mirrored(rng: np.random.Generator, frames: int) -> Pattern:
    """A chain whose frame i is also coupled with frame n - i."""
    b = Builder(rng)
    x = [b.variables(3, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 0.6)
        b.row(i, x[i][:1] + x[frames - 1 - i][1:2])
        if i + 1 < frames:
            b.row(i, x[i] + x[i + 1])
    return b.pattern()


def single(rng: np.random.Generator, frames: int) -> Pattern:
    """Everything in one stage."""
    b = Builder(rng)
    x = b.variables(3 * frames, 0)
    b.curvature(x, 0.15)
    for _ in range(2 * frames):
        b.row(0, [int(v) for v in rng.choice(x, size=3, replace=False)])
    return b.pattern()


def awkward(rng: np.random.Generator, frames: int) -> Pattern:
    """Rows long before their variables, empty stages, negative stage numbers, frames counted backwards."""
    b = Builder(rng)
    x = [b.variables(3, 3 * (frames - i) - 7) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i][1:], 0.3)
        b.row(-10, x[i][:2])
        if i + 1 < frames:
            b.row(3 * i, x[i] + x[i + 1], 0.5)
    return b.pattern()


def variable_major(rng: np.random.Generator, frames: int) -> Pattern:
    """A chain whose unknowns are numbered variable by variable instead of frame by frame."""
    p = chain(rng, frames)
    of_var, of_row = rng.permutation(p.n).astype(np.int32), rng.permutation(p.m).astype(np.int32)
    var_stage, row_stage = np.empty_like(p.var_stage), np.empty_like(p.row_stage)
    var_stage[of_var], row_stage[of_row] = p.var_stage, p.row_stage
    a, b = of_var[p.hess_rows], of_var[p.hess_cols]
    return Pattern(
        p.n,
        p.m,
        of_row[p.jac_rows],
        of_var[p.jac_cols],
        np.maximum(a, b),
        np.minimum(a, b),
        var_stage,
        row_stage,
    )


STRUCTURES: dict[str, Callable[[np.random.Generator, int], Pattern]] = {
    f.__name__: f
    for f in (
        chain,
        bordered,
        absolute,
        stencil,
        five_points,
        mirrored,
        single,
        awkward,
        variable_major,
    )
}


def generic(rng: np.random.Generator, p: Pattern) -> Values:
    """An indefinite H, positive diagonals: regular with probability 1."""
    return Values(
        rng.normal(size=p.hess_rows.size),
        rng.normal(size=p.jac_rows.size),
        rng.uniform(0.1, 2.0, p.n),
        rng.uniform(0.1, 2.0, p.m),
    )


def sparse_diagonals(rng: np.random.Generator, p: Pattern) -> Values:
    """Most diagonal entries are zero: pivots of two are needed."""
    values = generic(rng, p)
    values.primal *= rng.random(p.n) < 0.4
    values.dual *= rng.random(p.m) < 0.2
    return values


def barrier(rng: np.random.Generator, p: Pattern) -> Values:
    """An interior point iterate: diagonals from nothing to 1e16."""
    values = generic(rng, p)
    values.primal = np.where(rng.random(p.n) < 0.7, 10.0 ** rng.uniform(-10, 16, p.n), 1e-2)
    values.dual = np.where(rng.random(p.m) < 0.5, 10.0 ** rng.uniform(-16, 10, p.m), 1e-8)
    values.hess *= 10.0
    return values


def badly_scaled(rng: np.random.Generator, p: Pattern) -> Values:
    """A generic matrix with rows and columns scaled by 1e-6 to 1e6."""
    values = generic(rng, p)
    scale = 10.0 ** rng.uniform(-6, 6, p.n + p.m)
    values.hess *= scale[p.hess_rows] * scale[p.hess_cols]
    values.jac *= scale[p.n + p.jac_rows] * scale[p.jac_cols]
    values.primal *= scale[: p.n] ** 2
    values.dual *= scale[p.n :] ** 2
    return values


VALUES: dict[str, Callable[[np.random.Generator, Pattern], Values]] = {
    f.__name__: f for f in (generic, sparse_diagonals, barrier, badly_scaled)
}


def exact_inertia(matrix: Floats) -> tuple[int, int, int]:
    """Inertia by elimination with fractions: no rounding, hence no doubt."""
    rest = [[Fraction(v) for v in row] for row in matrix]
    positive = negative = zero = 0
    while rest:
        size = len(rest)
        k = next((i for i in range(size) if rest[i][i] != 0), None)
        if k is not None:
            d = rest[k][k]
            positive, negative = positive + (d > 0), negative + (d < 0)
            kept = [i for i in range(size) if i != k]
            rest = [[rest[i][j] - rest[i][k] * rest[k][j] / d for j in kept] for i in kept]
            continue
        pair = next(((i, j) for i in range(size) for j in range(i) if rest[i][j] != 0), None)
        if pair is None:
            zero += size
            break
        i0, j0 = pair
        b = rest[i0][j0]
        positive, negative = positive + 1, negative + 1
        kept = [i for i in range(size) if i not in pair]
        rest = [
            [rest[i][j] - (rest[i][i0] * rest[j0][j] + rest[i][j0] * rest[i0][j]) / b for j in kept]
            for i in kept
        ]
    return positive, negative, zero
