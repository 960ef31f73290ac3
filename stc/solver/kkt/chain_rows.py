"""Products with the matrix of a chain, as it is kept for them (see stc.solver.kkt.chain_elimination).

For one vector or for two, which share the reading of the matrix.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import load8, masked8, splat8, store8, sums8
from stc.solver.kkt.chain_elimination import (
    BASE,
    BLOCK,
    BLOCKS_AT,
    BORDER,
    CODE,
    FIELDS,
    INSIDE,
    MATRIX,
    OUTER,
    RECORD,
    ROWS,
    ROWS_AT,
    SIZE,
    entries_at,
    gather_rows,
    padded,
)

__all__ = ["HELD", "VECTORS", "begin_products", "end_products", "subtract", "subtract_rows"]

#: Vectors of a stage in the work space, for each of two: the part of x that belongs to its rows; what is held back
#: meanwhile; the part once it is scaled; sums of products with the matrix, by columns and by rows, of which there are
#: eight for each row first.
HELD, SCALED, SUMS, TOTALS, DOTS, VECTORS = 1, 2, 3, 4, 5, 13


@native(fast=True, inline=True)
def subtract_rows(
    both: i64, first: i64, last: i64, program: i32s, kept: f64s, at: i64, stride: i64, work: f64s
) -> i64:
    """Add products of rows of a stage's entries, from the row ``first`` on; where the next row's blocks are."""
    entries = kept[entries_at(program) :]
    blocks = program[program[BLOCKS_AT] :]
    rows = program[program[ROWS_AT] :]
    x = work[SCALED * stride :]
    sums = work[SUMS * stride :]
    dots = work[DOTS * stride :]
    other = work[VECTORS * stride :]
    other_x = other[SCALED * stride :]
    other_sums = other[SUMS * stride :]
    other_dots = other[DOTS * stride :]
    block = at
    for r in range(first, last):
        i = rows[2 * r]
        end = block + rows[2 * r + 1]
        dot = splat8(0.0)
        other_dot = splat8(0.0)
        x_i = x[i]
        other_x_i = other_x[i]
        while block < end:
            j = blocks[RECORD * block]
            value = masked8(entries, blocks[RECORD * block + 3], blocks[RECORD * block + 2])
            dot += value * load8(x, j)
            store8(sums, j, load8(sums, j) + value * x_i)
            if both != 0:
                other_dot += value * load8(other_x, j)
                store8(other_sums, j, load8(other_sums, j) + value * other_x_i)
            block += 1
        store8(dots, BLOCK * r, dot)
        if both != 0:
            store8(other_dots, BLOCK * r, other_dot)
    return block


@native(fast=True, inline=True)
def begin_products(program: i32s, kept: f64s, stride: i64, work: f64s) -> None:
    """Scale what is in ``part``, and begin with the products of the diagonal."""
    size = program[SIZE]
    own = program[INSIDE]
    inside = size - own
    diagonal = kept[padded(size) :]
    x = work[SCALED * stride :]
    sums = work[SUMS * stride :]
    for k in range(size, padded(size)):
        work[k] = 0.0
    for k in range(0, size, BLOCK):
        store8(x, k, load8(work, k) * load8(kept, k))
        store8(sums, k, splat8(0.0))
    for k in range(own):
        sums[inside + k] = diagonal[k] * x[inside + k]


@native(fast=True, inline=True)
def end_products(stage: i64s, code: i32s, kept: f64s, stride: i64, work: f64s, z: f64s) -> None:
    """Subtract the products of a stage from ``z``."""
    program = code[stage[CODE] :]
    outer = code[stage[OUTER] :]
    size = program[SIZE]
    border = program[BORDER]
    base = stage[BASE]
    own = program[INSIDE]
    inside = size - own
    sums = work[SUMS * stride :]
    totals = work[TOTALS * stride :]
    dots = work[DOTS * stride :]
    count = program[ROWS]
    rows = program[program[ROWS_AT] :]
    for r in range(0, count, BLOCK):
        store8(totals, r, sums8(dots, BLOCK * r))
    for r in range(count):
        sums[rows[2 * r]] += totals[r]
    for k in range(0, size, BLOCK):
        store8(sums, k, load8(sums, k) * load8(kept, k))
    for k in range(border):
        z[code[k]] -= sums[k]
    beyond = z[base:]
    for k in range(border, inside):
        beyond[outer[k - border]] -= sums[k]
    whole = own // BLOCK * BLOCK
    for k in range(0, whole, BLOCK):
        store8(z, base + k, load8(z, base + k) - load8(sums, inside + k))
    for k in range(whole, own):
        z[base + k] -= sums[inside + k]


@native(fast=True)
def subtract(
    stages: i64, table: i64s, code: i32s, stride: i64, matrix: f64s, work: f64s, size: i64, x: f64s,
    y: f64s, z: f64s,
) -> None:  # fmt: skip
    """``z = y - K x``."""
    for k in range(size):
        z[k] = y[k]
    for s in range(stages):
        stage = table[s * FIELDS :]
        program = code[stage[CODE] :]
        kept = matrix[stage[MATRIX] :]
        gather_rows(stage, code, x, work)
        begin_products(program, kept, stride, work)
        subtract_rows(0, 0, program[ROWS], program, kept, 0, stride, work)
        end_products(stage, code, kept, stride, work, z)
