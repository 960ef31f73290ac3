"""How fast compiled kernels evaluate a dynamics function, against a Python tree walk and CasADi's C code.

    python bench/evaluator.py [--rods 6] [--frames 200] [--rounds 15] [--json FILE]

Residual and Jacobian of a chain of rods (:mod:`rod_chain`), on every frame of a motion that fits the cache:

- this project's kernel, through the call that its solver makes;
- the same simplified Jacobian walked in Python, each distinct node once per frame (memoised);
- CasADi's generated C (common subexpressions eliminated), ``gcc -O3 -march=native``, looped over frames in C.

The three run alternately; times are medians of processor time over the rounds, ratios those of medians.  All
results are compared with each other first.  CasADi is needed for its part only (``pip install casadi``), and a C
compiler.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import operator
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray
from rod_chain import Stencil, casadi_function, stencil

from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN, find_runs
from stc.codegen.tape import Tape, build_tape
from stc.symbolic.expr import Expr

Array = NDArray[np.float64]

_MEANING: dict[str, Callable[..., float]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "pow": operator.pow,
    "sin": math.sin,
    "cos": math.cos,
}


def walk(node: Expr, known: dict[Expr, float]) -> float:
    """Value of a node; ``known`` holds the symbols' values and receives those of all nodes below."""
    value = known.get(node)
    if value is None:
        if node.op == "num":
            value = float(node.payload)
        else:
            value = _MEANING[node.op](*[walk(argument, known) for argument in node.args])
        known[node] = value
    return value


class Motion:
    """Random frames and constants."""

    def __init__(self, n: int, frames: int) -> None:
        rng = np.random.default_rng(3)
        self.n, self.frames = n, frames
        self.q = rng.uniform(-2.0, 2.0, (frames + 2, n))
        self.u = rng.uniform(-1.0, 1.0, (frames + 2, n))
        self.y = rng.uniform(-1.0, 1.0, (frames + 2, n))
        self.constants = np.concatenate([rng.uniform(0.5, 1.5, 3 * n), [9.81, 0.05]])
        held = self.q.ravel(), self.u.ravel(), self.y.ravel()
        self.workspace = np.concatenate([*held, np.zeros(RUN - 1)])  # runs may reach beyond

    def places(self) -> NDArray[np.int64]:
        """Positions in the workspace of a frame's inputs: q-, q, q+, u, y.  (5n, frames)"""
        own = np.arange(self.q.size).reshape(self.q.shape).T
        size = self.q.size
        middle = own[:, 1:-1]
        return np.concatenate([own[:, :-2], middle, own[:, 2:], middle + size, middle + 2 * size])


class Compiled:
    """Tapes run by our kernels on a motion."""

    def __init__(self, tape: Tape, motion: Motion) -> None:
        blocks = motion.frames // LANES
        places = motion.places()[: tape.n_varying]
        runs, starts = find_runs(tape, places)
        index = starts.reshape(-1, blocks, LANES).transpose(1, 0, 2)
        self.tape = tape
        self.out = aligned_zeros((blocks, len(tape.outputs), LANES))
        kernels = compile_tapes([tape], [runs], cache=False)
        self.compile_seconds = kernels.seconds
        compile_tapes([tape], [runs])
        self.load_seconds = min(compile_tapes([tape], [runs]).seconds for _ in range(5))
        self.call = kernels[0].bind(
            motion.workspace, motion.constants, np.ascontiguousarray(index, dtype=np.int32), self.out
        )

    def results(self) -> Array:
        """(frames, outputs)"""
        return self.out.transpose(0, 2, 1).reshape(-1, len(self.tape.outputs))


class CompiledC:
    """CasADi's C code, called frame by frame from C."""

    def __init__(self, motion: Motion, casadi: Any, folder: Path) -> None:
        function = casadi_function(motion.n, casadi)
        rows, columns = function.sparsity_out(1).get_triplet()
        self.entries = list(zip(rows, columns))
        count = motion.n + len(self.entries)
        source = folder / "stencil.c"
        generator = casadi.CodeGenerator("stencil", {"with_header": False})
        generator.add(function)
        source.write_text(
            generator.dump()
            + f"""
void run(long frames, const double* q, const double* u, const double* constants, double* out) {{
  double x[{4 * motion.n}], w[{function.sz_w() + 1}];
  casadi_int iw[{function.sz_iw() + 1}];
  for (long k = 0; k < frames; ++k) {{
    const double* arg[{function.sz_arg() + 2}] = {{x, constants}};
    double* res[{function.sz_res() + 2}] = {{out + k * {count}, out + k * {count} + {motion.n}}};
    for (int i = 0; i < {3 * motion.n}; ++i) x[i] = q[k * {motion.n} + i];
    for (int i = 0; i < {motion.n}; ++i) x[{3 * motion.n} + i] = u[(k + 1) * {motion.n} + i];
    stencil(arg, res, iw, w, 0);
  }}
}}
"""
        )
        library = folder / "stencil.so"
        started = time.perf_counter()
        compiler = shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            raise SystemExit("no C compiler found")
        options = ["-O3", "-march=native", "-fPIC", "-shared"]
        subprocess.run([compiler, *options, str(source), "-o", str(library), "-lm"], check=True)
        self.compile_seconds = time.perf_counter() - started
        self.operations = function.n_instructions()
        run = ctypes.CDLL(str(library)).run
        self.out = np.zeros((motion.frames, count))
        pointers = [
            ctypes.c_void_p(array.ctypes.data) for array in (motion.q, motion.u, motion.constants, self.out)
        ]
        self.call = lambda: run(ctypes.c_long(motion.frames), *pointers)


def python_walk(system: Stencil, motion: Motion, frames: int) -> Array:
    """Residual and Jacobian of the first frames. (frames, outputs)"""
    from stc.symbolic import expr

    keys = [*system.unknowns, *system.constants]
    symbols = [expr.sym(key) for key in keys]
    outputs = [*system.residual, *system.jacobian.values()]
    places = motion.places()[: len(system.unknowns)]
    rows = []
    for k in range(frames):
        values = [*motion.workspace[places[:, k]].tolist(), *motion.constants.tolist()]
        known = dict(zip(symbols, values))
        rows.append([walk(node, known) for node in outputs])
    return np.array(rows)


def median_of(samples: list[float], frames: int) -> float:
    """Nanoseconds per frame."""
    return statistics.median(samples) / frames * 1e9


def timed(call: Callable[[], Any], repeats: int) -> float:
    """Seconds of this thread's processor time per call: other programs' share of the machine does not count."""
    started = time.thread_time()
    for _ in range(repeats):
        call()
    return (time.thread_time() - started) / repeats


def repeats_for(call: Callable[[], Any]) -> int:
    """How often to call for a sample of 5 milliseconds: equally long for every contender."""
    call()
    return max(1, round(5e-3 / min(timed(call, 1) for _ in range(3))))


def agree(name: str, ours: Array, theirs: Array) -> None:
    """Stop unless two tables of results are the same up to rounding."""
    scale = np.maximum(np.abs(theirs).max(axis=0), 1e-3)
    worst = float((np.abs(ours - theirs) / scale).max())
    if not worst < 1e-9:
        raise SystemExit(f"{name} disagrees by {worst:.1e}")


def clock_cycle() -> float:
    """Nanoseconds per clock cycle: dependent integer operations take one each on every machine."""
    # alternating, since a compiler would add up a row of additions
    chain = "\n".join(f"  %s{k + 1} = {('add', 'xor')[k % 2]} i64 %s{k}, %step" for k in range(64))
    ir = f"""define i64 @run(i64 %n, i64 %step) {{
entry:
  br label %again
again:
  %k = phi i64 [ 0, %entry ], [ %k1, %again ]
  %s0 = phi i64 [ 0, %entry ], [ %s64, %again ]
{chain}
  %k1 = add i64 %k, 1
  %more = icmp slt i64 %k1, %n
  br i1 %more, label %again, label %done
done:
  ret i64 %s64
}}
"""
    loaded = engine.load(engine.compile_ir(ir, level=1), "run")
    run = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(loaded.address)
    return min(timed(lambda: run(2000, 3), 3) for _ in range(30)) / (2000 * 64) * 1e9


#: How many times faster residual and Jacobian are to be.
REQUIRED = {"Python tree walk": 100.0, "CasADi C, gcc -O3 -march=native": 3.0}


def show(figures: dict[str, Any], names: list[str], options: argparse.Namespace) -> None:
    """The figures as a table."""
    header = ("", "ns/frame", "operations", "cycles/op", "compile ms", "load ms", "times ours", "at least")
    rows = [header]
    for name in names:
        own = figures[name]
        keys = ("ns_per_frame", "operations", "cycles_per_operation", "compile_ms", "load_ms", "ratio")
        formats = (".1f", "d", ".3f", ".0f", ".2f", ".1f")
        cells = [format(own[key], form) if key in own else "" for key, form in zip(keys, formats)]
        rows.append((name, *cells, f"{REQUIRED[name]:g}" if name in REQUIRED else ""))
    note = (
        f"{options.rods} rods, {options.frames} frames, {figures['cpu']}, median of {options.rounds} rounds. "
        f"The clock runs at {1.0 / figures['cycle_ns']:.2f} GHz (dependent integer operations)."
    )
    if "CasADi operations" in figures:
        seconds = figures["CasADi compile_ms"] / 1e3
        note += f" CasADi: {figures['CasADi operations']} operations, compiled by gcc in {seconds:.1f} s."
    if options.markdown:
        rows.insert(1, ("---", *["---:"] * (len(header) - 1)))
        print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    else:
        widths = [max(len(row[k]) for row in rows) for k in range(len(header))]
        for row in rows:
            print(
                row[0].ljust(widths[0]),
                *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:])),
                sep="  ",
            )
    print(f"\n{note}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rods", type=int, default=6)
    parser.add_argument("--frames", type=int, default=200, help="a multiple of 4")
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", type=Path, help="also write the figures here")
    parser.add_argument("--markdown", action="store_true", help="print a Markdown table instead")
    options = parser.parse_args()
    if options.frames % LANES or options.frames < LANES or options.rods < 1 or options.rounds < 1:
        parser.error("frames must be a positive multiple of 4, rods and rounds positive")

    started = time.perf_counter()
    system = stencil(options.rods)
    derive_seconds = time.perf_counter() - started
    motion = Motion(options.rods, options.frames)
    jacobian = [*system.residual, *system.jacobian.values()]
    levels = {
        "residual": build_tape(system.residual, system.constants, system.unknowns),
        "residual + Jacobian": build_tape(jacobian, system.constants, system.unknowns),
        "residual + Jacobian + Hessian": build_tape(
            [*jacobian, *system.hessian.values()], system.constants, [*system.unknowns, *system.multipliers]
        ),
    }
    ours = {name: Compiled(tape, motion) for name, tape in levels.items()}
    kernel = ours["residual + Jacobian"]
    kernel.call()
    walked = min(4, options.frames)
    agree("the tree walk", kernel.results()[:walked], python_walk(system, motion, walked))

    contenders: dict[str, tuple[Callable[[], Any], int]] = {
        name: (compiled.call, options.frames) for name, compiled in ours.items()
    }
    contenders["Python tree walk"] = (lambda: python_walk(system, motion, walked), walked)
    theirs: CompiledC | None = None
    with tempfile.TemporaryDirectory() as folder:
        try:
            import casadi
        except ImportError:
            print("casadi is not installed: its part is left out", file=sys.stderr)
        else:
            theirs = CompiledC(motion, casadi, Path(folder))
            theirs.call()
            order = [theirs.entries.index(entry) for entry in system.jacobian]
            columns = [*range(options.rods), *(options.rods + k for k in order)]
            agree("CasADi", kernel.results(), theirs.out[:, columns])
            contenders["CasADi C, gcc -O3 -march=native"] = (theirs.call, options.frames)
        samples: dict[str, list[float]] = {name: [] for name in contenders}
        repeats = {name: repeats_for(call) for name, (call, _) in contenders.items()}
        for _ in range(options.rounds):
            for name, (call, _) in contenders.items():
                samples[name].append(timed(call, repeats[name]))

    figures: dict[str, Any] = {
        "rods": options.rods,
        "frames": options.frames,
        "cpu": llvm.get_host_cpu_name(),
        "vector_width": engine.vector_width(),
        "derive_ms": derive_seconds * 1e3,
        "cycle_ns": clock_cycle(),
    }
    times = {name: median_of(samples[name], frames) for name, (_, frames) in contenders.items()}
    operations = {name: len(c.tape.ops) - c.tape.n_uniform_ops for name, c in ours.items()}
    for name, compiled in ours.items():
        figures[name] = {
            "ns_per_frame": times[name],
            "operations": operations[name],
            "cycles_per_operation": times[name] / operations[name] / figures["cycle_ns"],
            "compile_ms": compiled.compile_seconds * 1e3,
            "load_ms": compiled.load_seconds * 1e3,
        }
    ours_time = times["residual + Jacobian"]
    for name in list(times)[len(ours) :]:
        figures[name] = {"ns_per_frame": times[name], "ratio": times[name] / ours_time}
    if theirs is not None:
        figures["CasADi compile_ms"] = theirs.compile_seconds * 1e3
        figures["CasADi operations"] = theirs.operations
    show(figures, list(times), options)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
