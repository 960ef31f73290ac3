"""Substitutions with the factors of a chain (see stc.solver.kkt.chain_elimination), and products with its matrix.

For one vector or for two, which share the reading of the factors and of the matrix.
"""

from __future__ import annotations

from stc.codegen.native import f64s, fabs, i32s, i64, i64s, native
from stc.codegen.native_vector import expand8, load8, splat8, store8, sum8
from stc.solver.kkt.chain_elimination import (
    BASE,
    BLOCK,
    BLOCKS_AT,
    BORDER,
    CODE,
    COLUMNS,
    COLUMNS_AT,
    FACTORS,
    FIELDS,
    INSIDE,
    MATRIX,
    PANELS,
    PANELS_AT,
    PLACES_AT,
    RECORD,
    SIZE,
    WHERE,
    gather_rows,
    padded,
)
from stc.solver.kkt.segmented_passes import bring_scaled, return_scaled
from stc.solver.kkt.substitution import improves

__all__ = ["ONE", "UNITS", "solve"]

#: Blocks with a single 1 are cut out of a row of UNITS numbers that has it here.
ONE, UNITS = 11, 24


@native(fast=True, inline=True)
def _return(
    first: i64, size: i64, border: i64, border_base: i64, base: i64, where: i32s, part: f64s, x: f64s
) -> None:
    """The opposite, from the row ``first`` on."""
    for k in range(first, border):
        x[border_base + k] = part[k]
    own = x[base:]
    for k in range(max(first, border), size):
        own[where[k - border]] = part[k]


@native(fast=True, inline=True)
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
        one = load8(part, column) - load8(factors, at) * y0 - load8(factors, at + 8) * y1
        other = load8(factors, at + 16) * y2 + load8(factors, at + 24) * y3
        store8(part, column, one - other)


@native(fast=True, inline=True)
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


@native(fast=True, inline=True)
def _forward_one(panel: i32s, factors: f64s, part: f64s, held: f64s) -> None:
    """The same for one."""
    high = panel[3]
    y0 = part[high]
    held[high] = factors[0] * y0
    columns = panel[6:]
    for b in range(panel[4]):
        column = columns[2 * b]
        store8(part, column, load8(part, column) - load8(factors, 8 + 8 * b) * y0)


@native(fast=True, inline=True)
def _backward_four(panel: i32s, factors: f64s, units: f64s, part: f64s, held: f64s) -> None:
    """L^T x = D^-1 y for a panel of four."""
    high = panel[3]
    columns = panel[6:]
    x = load8(part, columns[0])
    s0 = load8(factors, 16) * x
    s1 = load8(factors, 24) * x
    s2 = load8(factors, 32) * x
    s3 = load8(factors, 40) * x
    for b in range(1, panel[4]):
        x = load8(part, columns[2 * b])
        at = 16 + 32 * b
        s0 += load8(factors, at) * x
        s1 += load8(factors, at + 8) * x
        s2 += load8(factors, at + 16) * x
        s3 += load8(factors, at + 24) * x
    x3 = held[high - 3] - sum8(s3)
    x2 = held[high - 2] - sum8(s2) - factors[11] * x3
    x1 = held[high - 1] - sum8(s1) - factors[10] * x3 - factors[9] * x2
    x0 = held[high] - sum8(s0) - factors[8] * x3 - factors[7] * x2 - factors[6] * x1
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


@native(fast=True, inline=True)
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


@native(fast=True, inline=True)
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
    both: i64, stage: i64s, program: i32s, border_base: i64, stride: i64, factors: f64s, work: f64s, x: f64s,
    other_x: f64s,
) -> None:  # fmt: skip
    """L and D of one stage, in place."""
    part = work
    held = work[stride:]
    other_part = work[2 * stride :]
    other_held = work[3 * stride :]
    where = program[program[WHERE] :]
    border = program[BORDER]
    size = program[SIZE]
    inside = size - program[INSIDE]
    base = stage[BASE]
    gather_rows(size, border, border_base, base, where, x, part)
    if both != 0:
        gather_rows(size, border, border_base, base, where, other_x, other_part)
    panels = program[program[PANELS_AT] :]
    places = program[program[PLACES_AT] :]
    for p in range(program[PANELS]):
        panel = panels[places[2 * p] :]
        own = factors[stage[FACTORS] + places[2 * p + 1] :]
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
    _return(0, inside, border, border_base, base, where, part, x)
    _return(inside, size, border, border_base, base, where, held, x)
    if both != 0:
        _return(0, inside, border, border_base, base, where, other_part, other_x)
        _return(inside, size, border, border_base, base, where, other_held, other_x)


@native(fast=True, inline=True)
def _gather_inside(
    inside: i64, size: i64, border: i64, base: i64, where: i32s, x: f64s, part: f64s, held: f64s
) -> None:
    """Bring a stage's own to ``held``; ``part`` is cleared there."""
    own = x[base:]
    for k in range(inside, size):
        held[k] = own[where[k - border]]
        part[k] = 0.0


@native(fast=True, inline=True)
def _backward(
    both: i64, stage: i64s, program: i32s, border_base: i64, stride: i64, units: f64s, factors: f64s, work: f64s,
    x: f64s, other_x: f64s,
) -> None:  # fmt: skip
    """L^T of one stage, in place."""
    part = work
    held = work[stride:]
    other_part = work[2 * stride :]
    other_held = work[3 * stride :]
    where = program[program[WHERE] :]
    border = program[BORDER]
    size = program[SIZE]
    inside = size - program[INSIDE]
    base = stage[BASE]
    gather_rows(inside, border, border_base, base, where, x, part)
    _gather_inside(inside, size, border, base, where, x, part, held)
    if both != 0:
        gather_rows(inside, border, border_base, base, where, other_x, other_part)
        _gather_inside(inside, size, border, base, where, other_x, other_part, other_held)
    panels = program[program[PANELS_AT] :]
    places = program[program[PLACES_AT] :]
    last = program[PANELS] - 1
    for k in range(last + 1):
        p = last - k
        panel = panels[places[2 * p] :]
        own = factors[stage[FACTORS] + places[2 * p + 1] :]
        if panel[0] == 4:
            _backward_four(panel, own, units, part, held)
            if both != 0:
                _backward_four(panel, own, units, other_part, other_held)
        elif panel[0] == 2:
            _backward_two(panel, own, units, part, held)
            if both != 0:
                _backward_two(panel, own, units, other_part, other_held)
        else:
            _backward_one(panel, own, units, part, held)
            if both != 0:
                _backward_one(panel, own, units, other_part, other_held)
    _return(inside, size, border, border_base, base, where, part, x)
    if both != 0:
        _return(inside, size, border, border_base, base, where, other_part, other_x)


@native(fast=True)
def _substitute_one(
    stages: i64, table: i64s, code: i32s, border_base: i64, stride: i64, units: f64s, factors: f64s, work: f64s, x: f64s
) -> None:  # fmt: skip
    """Solve with the factors, in place."""
    for s in range(stages):
        stage = table[s * FIELDS :]
        _forward(0, stage, code[stage[CODE] :], border_base, stride, factors, work, x, x)
    for s in range(stages):
        stage = table[(stages - 1 - s) * FIELDS :]
        _backward(0, stage, code[stage[CODE] :], border_base, stride, units, factors, work, x, x)


@native(fast=True)
def _substitute_both(
    stages: i64, table: i64s, code: i32s, border_base: i64, stride: i64, units: f64s, factors: f64s, work: f64s,
    x: f64s, other_x: f64s,
) -> None:  # fmt: skip
    """The same for two."""
    for s in range(stages):
        stage = table[s * FIELDS :]
        _forward(1, stage, code[stage[CODE] :], border_base, stride, factors, work, x, other_x)
    for s in range(stages):
        stage = table[(stages - 1 - s) * FIELDS :]
        _backward(1, stage, code[stage[CODE] :], border_base, stride, units, factors, work, x, other_x)


@native(fast=True, inline=True)
def _subtract_entries(program: i32s, kept: f64s, part: f64s, result: f64s, sums: f64s, by_row: f64s) -> None:
    """``result -= A part`` for the entries of a stage, scaled; ``part`` is scaled, too, afterwards.

    ``sums`` and ``by_row`` are room for one and eight times its rows.
    """
    size = program[SIZE]
    own = program[INSIDE]
    inside = size - own
    diagonal = kept[padded(size) :]
    entries = diagonal[padded(own) :]
    for k in range(0, size, BLOCK):
        store8(part, k, load8(part, k) * load8(kept, k))
        store8(sums, k, splat8(0.0))
    for k in range(own):
        sums[inside + k] = diagonal[k] * part[inside + k]
    for k in range(inside, size):
        store8(by_row, BLOCK * k, splat8(0.0))
    blocks = program[program[BLOCKS_AT] :]
    listed = program[program[COLUMNS_AT] :]
    for column in range(program[COLUMNS]):
        j = listed[2 * column]
        count = listed[2 * column + 1]
        x = load8(part, j)
        # Four sums at once: each addition waits for the one before.
        total = load8(sums, j)
        second = splat8(0.0)
        third = splat8(0.0)
        fourth = splat8(0.0)
        k = 0
        while k + 4 <= count:
            i = blocks[1]
            value = expand8(entries, blocks[3], blocks[2])
            total += value * part[i]
            store8(by_row, BLOCK * i, load8(by_row, BLOCK * i) + value * x)
            i = blocks[5]
            value = expand8(entries, blocks[7], blocks[6])
            second += value * part[i]
            store8(by_row, BLOCK * i, load8(by_row, BLOCK * i) + value * x)
            i = blocks[9]
            value = expand8(entries, blocks[11], blocks[10])
            third += value * part[i]
            store8(by_row, BLOCK * i, load8(by_row, BLOCK * i) + value * x)
            i = blocks[13]
            value = expand8(entries, blocks[15], blocks[14])
            fourth += value * part[i]
            store8(by_row, BLOCK * i, load8(by_row, BLOCK * i) + value * x)
            blocks = blocks[4 * RECORD :]
            k += 4
        while k < count:
            i = blocks[1]
            value = expand8(entries, blocks[3], blocks[2])
            total += value * part[i]
            store8(by_row, BLOCK * i, load8(by_row, BLOCK * i) + value * x)
            blocks = blocks[RECORD:]
            k += 1
        store8(sums, j, (total + second) + (third + fourth))
    for k in range(inside, size):
        sums[k] += sum8(load8(by_row, BLOCK * k))
    for k in range(0, size, BLOCK):
        store8(result, k, load8(result, k) - load8(sums, k) * load8(kept, k))


@native(fast=True)
def _subtract(
    stages: i64, table: i64s, code: i32s, border_base: i64, stride: i64, matrix: f64s, work: f64s, size: i64, x: f64s,
    y: f64s, z: f64s, norms: f64s,
) -> None:  # fmt: skip
    """``z = y - K x``; ``norms`` become those of x and z, nan when not all is finite."""
    for k in range(size):
        z[k] = y[k]
    part = work
    result = work[stride:]
    sums = work[2 * stride :]
    by_row = work[3 * stride :]
    for s in range(stages):
        stage = table[s * FIELDS :]
        program = code[stage[CODE] :]
        where = program[program[WHERE] :]
        rows = program[SIZE]
        border = program[BORDER]
        base = stage[BASE]
        gather_rows(rows, border, border_base, base, where, x, part)
        gather_rows(rows, border, border_base, base, where, z, result)
        for k in range(rows, rows + BLOCK):
            part[k] = 0.0
        _subtract_entries(program, matrix[stage[MATRIX] :], part, result, sums, by_row)
        _return(0, rows, border, border_base, base, where, result, z)
    check = 0.0
    length = 0.0
    remaining = 0.0
    for k in range(size):
        check += (x[k] + z[k]) * 0.0
        length = max(length, fabs(x[k]))
        remaining = max(remaining, fabs(z[k]))
    norms[0] = length + check
    norms[1] = remaining + check


@native
def solve(
    both: i64,
    refinements: i64,
    accuracy: f64s,
    stages: i64,
    table: i64s,
    code: i32s,
    border_base: i64,
    size: i64,
    stride: i64,
    index: i32s,
    matrix: f64s,
    factors: f64s,
    scale: f64s,
    units: f64s,
    work: f64s,
    norms: f64s,
    rhs: f64s,
    scaled_rhs: f64s,
    solution: f64s,
    change: f64s,
    kept: f64s,
    result: f64s,
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_kept: f64s,
    other_result: f64s,
    report: f64s,
    other_report: f64s,
) -> None:
    """Solve K x = rhs, refined as in ``substitution.solve``.

    Args:
        both: whether to do the same for ``other_rhs``, in common passes; ``report`` then tells of the less accurate.
        stages ... factors, scale: see ``chain_elimination.eliminate``; size: N.
        units: zeros, with 1 at ONE.
        rhs, result: (N,); report: see ``substitution.REPORT``; the other arrays are work space.
    """
    length = bring_scaled(size, index, scale, rhs, scaled_rhs)
    other_length = 0.0
    if both != 0:
        other_length = bring_scaled(size, index, scale, other_rhs, other_scaled_rhs)
    active = 1 if length > 0.0 else 0
    other_active = 1 if other_length > 0.0 else 0
    report[0] = 1.0 * active
    report[1] = 0.0
    report[2] = 0.0
    other_report[0] = 1.0 * other_active
    for k in range(size):
        solution[k] = scaled_rhs[k]
    if both != 0:
        for k in range(size):
            other_solution[k] = other_scaled_rhs[k]
        _substitute_both(
            stages, table, code, border_base, stride, units, factors, work, solution, other_solution
        )
    else:
        _substitute_one(stages, table, code, border_base, stride, units, factors, work, solution)
    steps = 0
    while active + other_active > 0:
        report[1] = 1.0 * steps
        if active != 0:
            _subtract(
                stages,
                table,
                code,
                border_base,
                stride,
                matrix,
                work,
                size,
                solution,
                scaled_rhs,
                change,
                norms,
            )
            if steps == 0:
                report[2] = norms[0] / length
            active = improves(
                size, steps, refinements, accuracy[0], norms[1], length, norms[0], report, kept, solution
            )
        if other_active != 0:
            _subtract(
                stages, table, code, border_base, stride, matrix, work, size, other_solution, other_scaled_rhs,
                other_change, norms,
            )  # fmt: skip
            other_active = improves(
                size, steps, refinements, accuracy[0], norms[1], other_length, norms[0], other_report, other_kept,
                other_solution,
            )  # fmt: skip
        steps += 1
        if active != 0 and other_active != 0:
            _substitute_both(
                stages, table, code, border_base, stride, units, factors, work, change, other_change
            )
        elif active != 0:
            _substitute_one(stages, table, code, border_base, stride, units, factors, work, change)
        elif other_active != 0:
            _substitute_one(stages, table, code, border_base, stride, units, factors, work, other_change)
        if active != 0:
            for k in range(size):
                kept[k] = change[k]
                solution[k] += change[k]
        if other_active != 0:
            for k in range(size):
                other_kept[k] = other_change[k]
                other_solution[k] += other_change[k]
    return_scaled(size, index, scale, solution, result)
    if both != 0:
        return_scaled(size, index, scale, other_solution, other_result)
        report[0] = max(report[0], other_report[0])
