"""Forward and back substitution through the stages of a chain (see stc.solver.kkt.chain_elimination).

For one vector or for two, which share the reading of the factors.  Panels are of one, two or four pivots.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import load8, masked8, splat8, store8, sum8
from stc.solver.kkt.chain_elimination import (
    BASE,
    BLOCK,
    BORDER,
    CODE,
    FACTORS,
    FIELDS,
    INSIDE,
    MATRIX,
    OUTER,
    PANELS,
    PANELS_AT,
    PLACES_AT,
    ROWS,
    SIZE,
    gather_outer,
    gather_rows,
    put_own,
    share_of,
    take_own,
)
from stc.solver.kkt.chain_rows import HELD, VECTORS, begin_products, end_products, subtract_rows
from stc.solver.kkt.lane_memory import ask_ahead, ask_behind

__all__ = ["ONE", "UNITS", "backward_both", "backward_one_vector", "forward_both", "forward_one_vector"]

#: Blocks with a single 1 are cut out of a row of UNITS numbers that has it here.
ONE, UNITS = 11, 24


@native(fast=True, inline=True)
def _return_outer(stage: i64s, code: i32s, part: f64s, x: f64s) -> None:
    """The opposite of ``gather_outer``."""
    program = code[stage[CODE] :]
    outer = code[stage[OUTER] :]
    own = x[stage[BASE] :]
    border = program[BORDER]
    for k in range(border):
        x[code[k]] = part[k]
    for k in range(border, program[SIZE] - program[INSIDE]):
        own[outer[k - border]] = part[k]


@native(inline=True)
def _vectors_of(panel: i32s) -> i64:
    """How many vectors the factors of a panel are, the corner's first."""
    members = panel[0]
    return (2 if members == 4 else 1) + members * panel[4]


@native(fused=True, inline=True)
def _forward_four(panel: i32s, factors: f64s, part: f64s, held: f64s) -> None:
    """L y = x for a panel of four; D^-1 y goes to ``held``."""
    high = panel[3]
    y0 = part[high]
    y1 = part[high - 1] - factors[6] * y0
    y2 = part[high - 2] - factors[7] * y0 - factors[9] * y1
    y3 = part[high - 3] - factors[8] * y0 - factors[10] * y1 - factors[11] * y2
    held[high] = factors[0] * y0 + factors[4] * y1
    held[high - 1] = factors[1] * y1 + factors[4] * y0
    held[high - 2] = factors[2] * y2 + factors[5] * y3
    held[high - 3] = factors[3] * y3 + factors[5] * y2
    columns = panel[6:]
    for b in range(panel[4]):
        column = columns[2 * b]
        at = 16 + 32 * b
        value = load8(part, column) - load8(factors, at) * y0 - load8(factors, at + 8) * y1
        store8(part, column, value - load8(factors, at + 16) * y2 - load8(factors, at + 24) * y3)


@native(fused=True, inline=True)
def _forward_two(panel: i32s, factors: f64s, part: f64s, held: f64s) -> None:
    """The same for two."""
    high = panel[3]
    y0 = part[high]
    y1 = part[high - 1] - factors[3] * y0
    held[high] = factors[0] * y0 + factors[2] * y1
    held[high - 1] = factors[1] * y1 + factors[2] * y0
    columns = panel[6:]
    for b in range(panel[4]):
        column = columns[2 * b]
        at = 8 + 16 * b
        store8(
            part,
            column,
            load8(part, column) - load8(factors, at) * y0 - load8(factors, at + 8) * y1,
        )


@native(fused=True, inline=True)
def _forward_one(panel: i32s, factors: f64s, part: f64s, held: f64s) -> None:
    """The same for one."""
    high = panel[3]
    y0 = part[high]
    held[high] = factors[0] * y0
    columns = panel[6:]
    for b in range(panel[4]):
        column = columns[2 * b]
        store8(part, column, load8(part, column) - load8(factors, 8 + 8 * b) * y0)


@native(fused=True, inline=True)
def _backward_four(panel: i32s, factors: f64s, units: f64s, part: f64s, held: f64s) -> None:
    """L^T x = D^-1 y for a panel of four."""
    high = panel[3]
    columns = panel[6:]
    # What is held is among the sums from the start: whatever follows on the last block that is read takes time.
    x = load8(part, columns[0])
    s0 = masked8(held, high, 1) - load8(factors, 16) * x
    s1 = masked8(held, high - 1, 1) - load8(factors, 24) * x
    s2 = masked8(held, high - 2, 1) - load8(factors, 32) * x
    s3 = masked8(held, high - 3, 1) - load8(factors, 40) * x
    for b in range(1, panel[4]):
        x = load8(part, columns[2 * b])
        at = 16 + 32 * b
        s0 -= load8(factors, at) * x
        s1 -= load8(factors, at + 8) * x
        s2 -= load8(factors, at + 16) * x
        s3 -= load8(factors, at + 24) * x
    x3 = sum8(s3)
    x2 = sum8(s2) - factors[11] * x3
    x1 = sum8(s1) - factors[10] * x3 - factors[9] * x2
    x0 = sum8(s0) - factors[8] * x3 - factors[7] * x2 - factors[6] * x1
    # Whole blocks are written: they are read as such at once.
    begin = (high - 3) // BLOCK * BLOCK
    unit = ONE - high + begin
    one = load8(part, begin) + x3 * load8(units, unit + 3) + x2 * load8(units, unit + 2)
    store8(part, begin, one + x1 * load8(units, unit + 1) + x0 * load8(units, unit))
    if high >= begin + BLOCK:
        begin += BLOCK
        unit += BLOCK
        one = load8(part, begin) + x2 * load8(units, unit + 2)
        store8(part, begin, one + x1 * load8(units, unit + 1) + x0 * load8(units, unit))


@native(fused=True, inline=True)
def _backward_two(panel: i32s, factors: f64s, units: f64s, part: f64s, held: f64s) -> None:
    """The same for two."""
    high = panel[3]
    columns = panel[6:]
    x = load8(part, columns[0])
    s0 = load8(factors, 8) * x
    s1 = load8(factors, 16) * x
    for b in range(1, panel[4]):
        x = load8(part, columns[2 * b])
        at = 8 + 16 * b
        s0 += load8(factors, at) * x
        s1 += load8(factors, at + 8) * x
    x1 = held[high - 1] - sum8(s1)
    x0 = held[high] - sum8(s0) - factors[3] * x1
    begin = (high - 1) // BLOCK * BLOCK
    unit = ONE - high + begin
    store8(part, begin, load8(part, begin) + x1 * load8(units, unit + 1) + x0 * load8(units, unit))
    if high >= begin + BLOCK:
        part[high] = x0


@native(fused=True, inline=True)
def _backward_one(panel: i32s, factors: f64s, units: f64s, part: f64s, held: f64s) -> None:
    """The same for one."""
    high = panel[3]
    columns = panel[6:]
    s0 = load8(factors, 8) * load8(part, columns[0])
    for b in range(1, panel[4]):
        s0 += load8(factors, 8 + 8 * b) * load8(part, columns[2 * b])
    x0 = held[high] - sum8(s0)
    begin = high // BLOCK * BLOCK
    store8(part, begin, load8(part, begin) + x0 * load8(units, ONE - high + begin))


@native(fast=True, inline=True)
def _forward(
    both: i64, distance: i64, stage: i64s, code: i32s, stride: i64, factors: f64s, work: f64s, x: f64s, other_x: f64s
) -> None:  # fmt: skip
    """L and D of one stage, in place."""
    part = work
    held = work[HELD * stride :]
    other_part = work[VECTORS * stride :]
    other_held = other_part[HELD * stride :]
    program = code[stage[CODE] :]
    gather_rows(stage, code, x, part)
    if both != 0:
        gather_rows(stage, code, other_x, other_part)
    panels = program[program[PANELS_AT] :]
    places = program[program[PLACES_AT] :]
    for p in range(program[PANELS]):
        panel = panels[places[2 * p] :]
        at = stage[FACTORS] + places[2 * p + 1]
        own = factors[at:]
        ask_ahead(distance, _vectors_of(panel), 8, at, factors)
        if panel[0] == 4:
            _forward_four(panel, own, part, held)
            if both != 0:
                _forward_four(panel, own, other_part, other_held)
        elif panel[0] == 2:
            _forward_two(panel, own, part, held)
            if both != 0:
                _forward_two(panel, own, other_part, other_held)
        else:
            _forward_one(panel, own, part, held)
            if both != 0:
                _forward_one(panel, own, other_part, other_held)
    _return_outer(stage, code, part, x)
    put_own(stage, code, held, x)
    if both != 0:
        _return_outer(stage, code, other_part, other_x)
        put_own(stage, code, other_held, other_x)


@native(fast=True, inline=True)
def _hold_own(stage: i64s, code: i32s, x: f64s, part: f64s, held: f64s) -> None:
    """Bring what a vector has for B and F to ``part``, which is 0 for U, and U's to ``held``."""
    program = code[stage[CODE] :]
    inside = program[SIZE] - program[INSIDE]
    gather_outer(stage, code, x, part)
    take_own(stage, code, x, held)
    for k in range(0, program[INSIDE], BLOCK):
        store8(part, inside + k, splat8(0.0))


@native(fast=True, inline=True)
def _backward(
    both: i64, checked: i64, distance: i64, stages: i64, table: i64s, code: i32s, stride: i64,
    units: f64s, factors: f64s, matrix: f64s, work: f64s, x: f64s, other_x: f64s, z: f64s, other_z: f64s,
) -> None:  # fmt: skip
    """L^T of all stages, in place; where it is ``checked``, ``z -= K x`` as well.

    Pivots wait for one another; meanwhile products with the matrix of the last stage are added.
    """
    part = work
    held = work[HELD * stride :]
    other = work[VECTORS * stride :]
    other_held = other[HELD * stride :]
    for k in range(stages):
        s = stages - 1 - k
        stage = table[s * FIELDS :]
        program = code[stage[CODE] :]
        _hold_own(stage, code, x, part, held)
        if both != 0:
            _hold_own(stage, code, other_x, other, other_held)
        done = table[min(s + 1, stages - 1) * FIELDS :]
        behind = code[done[CODE] :]
        kept = matrix[done[MATRIX] :]
        rows = behind[ROWS] if checked != 0 and k > 0 else 0
        panels = program[program[PANELS_AT] :]
        places = program[program[PLACES_AT] :]
        count = program[PANELS]
        share = share_of(rows, max(count, 1))
        row = 0
        block = 0
        for q in range(count):
            p = count - 1 - q
            panel = panels[places[2 * p] :]
            at = stage[FACTORS] + places[2 * p + 1]
            own = factors[at:]
            ask_behind(distance, _vectors_of(panel), at, factors)
            if panel[0] == 4:
                _backward_four(panel, own, units, part, held)
                if both != 0:
                    _backward_four(panel, own, units, other, other_held)
            elif panel[0] == 2:
                _backward_two(panel, own, units, part, held)
                if both != 0:
                    _backward_two(panel, own, units, other, other_held)
            else:
                _backward_one(panel, own, units, part, held)
                if both != 0:
                    _backward_one(panel, own, units, other, other_held)
            if row < rows:
                last = min(row + share, rows)
                block = subtract_rows(both, row, last, behind, kept, block, stride, work)
                row = last
        put_own(stage, code, part, x)
        if both != 0:
            put_own(stage, code, other, other_x)
        if checked != 0:
            if k > 0:
                subtract_rows(both, row, rows, behind, kept, block, stride, work)
                end_products(done, code, kept, stride, work, z)
                if both != 0:
                    end_products(done, code, kept, stride, other, other_z)
            begin_products(program, matrix[stage[MATRIX] :], stride, work)
            if both != 0:
                begin_products(program, matrix[stage[MATRIX] :], stride, other)
    if checked != 0:
        first = code[table[CODE] :]
        kept = matrix[table[MATRIX] :]
        subtract_rows(both, 0, first[ROWS], first, kept, 0, stride, work)
        end_products(table[0:], code, kept, stride, work, z)
        if both != 0:
            end_products(table[0:], code, kept, stride, other, other_z)


@native(fast=True, short=True)
def forward_one_vector(
    distance: i64, stages: i64, table: i64s, code: i32s, stride: i64, factors: f64s, work: f64s, x: f64s
) -> None:  # fmt: skip
    """L and D of stages that follow one another, in place."""
    for s in range(stages):
        _forward(0, distance, table[s * FIELDS :], code, stride, factors, work, x, x)


@native(fast=True, short=True)
def forward_both(
    distance: i64, stages: i64, table: i64s, code: i32s, stride: i64, factors: f64s, work: f64s, x: f64s, other_x: f64s
) -> None:  # fmt: skip
    """The same for two vectors."""
    for s in range(stages):
        _forward(1, distance, table[s * FIELDS :], code, stride, factors, work, x, other_x)


@native(fast=True, short=True)
def backward_one_vector(
    checked: i64, distance: i64, stages: i64, table: i64s, code: i32s, stride: i64, units: f64s, factors: f64s,
    matrix: f64s, work: f64s, x: f64s, z: f64s,
) -> None:  # fmt: skip
    """L^T of stages that follow one another, in place; where it is ``checked``, ``z -= K x`` as well."""
    _backward(0, checked, distance, stages, table, code, stride, units, factors, matrix, work, x, x, z, z)


@native(fast=True, short=True)
def backward_both(
    checked: i64, distance: i64, stages: i64, table: i64s, code: i32s, stride: i64, units: f64s, factors: f64s,
    matrix: f64s, work: f64s, x: f64s, other_x: f64s, z: f64s, other_z: f64s,
) -> None:  # fmt: skip
    """The same for two vectors."""
    _backward(
        1,
        checked,
        distance,
        stages,
        table,
        code,
        stride,
        units,
        factors,
        matrix,
        work,
        x,
        other_x,
        z,
        other_z,
    )
