"""What a table costs beside a polynomial: a million look-ups with first and second derivatives, in one kernel each.

    python bench/tables.py [--rounds 25]

The polynomial is of the table's degree, cubic in one argument or bicubic in two, and is evaluated with the same
derivatives by a kernel of the same kind.  Arguments rise from look-up to look-up, as along a motion, or are drawn at
random, so that the table's numbers come from all over the memory.  Times are the least of the rounds, of the thread's
own processor time.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from stc.arrays import aligned_zeros
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import Runs
from stc.codegen.tape import build_tape
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import Expr, looked_up, num, sym
from stc.symbolic.tables import TableRef, interpolated

COUNT = 1_000_000


def expressions(kind: str, rows: int, even: bool = False) -> tuple[list[Expr], list[TableRef], list[str]]:
    """A function with its first and second derivatives, its tables, and the names of its arguments."""
    x, y = sym("x"), sym("y")
    rng = np.random.default_rng(0)
    at = np.cumsum(rng.uniform(0.1, 1.9, rows))
    at = np.linspace(0.0, 1.0, rows) if even else (at - at[0]) / (at[-1] - at[0])
    if kind == "cubic":
        e, tables, names = num(0.3) + x * (num(0.7) + x * (num(-1.1) + x * num(0.2))), [], ["x"]
    elif kind == "curve":
        ref = TableRef("T", interpolated([at], np.sin(9.0 * at), "cubic", "extend"), (0,))
        e, tables, names = looked_up(ref, x), [ref], ["x"]
    elif kind == "bicubic":
        coefficients = rng.normal(size=(4, 4))
        rows_of_y = [
            num(c[0]) + y * (num(c[1]) + y * (num(c[2]) + y * num(c[3]))) for c in coefficients.tolist()
        ]
        e = rows_of_y[0] + x * (rows_of_y[1] + x * (rows_of_y[2] + x * rows_of_y[3]))
        tables, names = [], ["x", "y"]
    else:
        side = at
        values = np.sin(5.0 * side[:, None]) * np.cos(3.0 * side)
        ref = TableRef("H", interpolated([side, side], values, "cubic", "extend"), (0, 0))
        e, tables, names = looked_up(ref, x, y), [ref], ["x", "y"]
    first = [derivative(e, name) for name in names]
    second = [derivative(f, name) for k, f in enumerate(first) for name in names[k:]]
    return [e, *first, *second], tables, names


def seconds(kind: str, rows: int, order: str, rounds: int, even: bool = False) -> float:
    """The least time that a million evaluations take, with arguments in a row or at random."""
    outputs, tables, names = expressions(kind, rows, even)
    stored = [table.table.storage() for table in tables]
    begins = len(tables) + np.cumsum([0, *(len(numbers) for numbers in stored)])[:-1]
    uniform = np.concatenate([begins, *stored, [0.0]])
    tape = build_tape(outputs, tables, names)
    blocks = COUNT // LANES
    rng = np.random.default_rng(1)
    varying = rng.uniform(0.0, 1.0, (len(names), COUNT))
    if order == "rising":
        varying.sort(axis=1)
    workspace = np.concatenate([varying.ravel(), np.zeros(8)])
    index = np.arange(varying.size, dtype=np.int32).reshape(len(names), blocks, LANES).transpose(1, 0, 2)
    out = aligned_zeros((blocks, len(outputs), LANES))
    kernels = compile_tapes([tape], [Runs.alone(len(names))], cache=False)
    call = kernels[0].bind(workspace, uniform, np.ascontiguousarray(index), out)
    least = np.inf
    for _ in range(rounds):
        begin = time.thread_time()  # others may be at work meanwhile
        call()
        least = min(least, time.thread_time() - begin)
    return least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25)
    rounds = parser.parse_args().rounds
    print("| a million look-ups | arguments | ms | times the polynomial | at most |")
    print("| --- | --- | ---: | ---: | ---: |")
    for plain, table in (("cubic", "curve"), ("bicubic", "surface")):
        for order in ("rising", "random"):
            base = seconds(plain, 2, order, rounds)
            print(f"| {plain} polynomial | {order} | {1e3 * base:.2f} | 1 | |")
            for even in (True, False):
                for rows in (20, 1000, 10_000) if table == "curve" else (20, 60):
                    taken = seconds(table, rows, order, rounds, even)
                    size = f"{rows} rows" if table == "curve" else f"{rows} by {rows}"
                    at_most = "3" if order == "rising" else ""
                    what = f"{table} of {size}, {'even' if even else 'uneven'}"
                    print(f"| {what} | {order} | {1e3 * taken:.2f} | {taken / base:.2f} | {at_most} |")


if __name__ == "__main__":
    main()
