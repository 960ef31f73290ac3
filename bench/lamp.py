"""How fast the lamp's residual, Jacobian and Hessian are evaluated, in clock cycles per arithmetic operation.

    python bench/lamp.py [--rounds 15] [--fineness 1]

All kernels of ``luxo_jump`` (60 intervals per unit of fineness), called as the solver calls them, on data that fits
the cache; derivatives that are constants are there before, as in a solve.  Beside them, for the largest kernel,
CasADi's C code of the same functions and of its own derivatives (common subexpressions eliminated, ``gcc -O3
-march=native``), looped over the same nodes in C.  The two run alternately; medians of processor time.  Prints a
Markdown table.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import stc
from stc.arrays import aligned_zeros
from stc.codegen import engine
from stc.core.calls import chain
from stc.transcription import Transcription
from stc.transcription.assemble import data_of
from stc.transcription.bind import BoundProgram


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


def operations(transcription: Transcription) -> int:
    """Arithmetic operations (a sine is one) of all values and derivatives kernels over the whole motion."""
    groups = transcription.program.groups
    tapes = [(g.size, tape) for g in groups for tape in (g.programs.values_tape, g.programs.derivatives_tape)]
    return sum(size * (len(tape.ops) - tape.n_uniform_ops) for size, tape in tapes)


def alone(transcription: Transcription, bound: BoundProgram, number: int) -> tuple[Callable[[], Any], int]:
    """A call of one group's values and derivatives kernels alone, and their operations per node."""
    program, kernels = transcription.program, transcription.kernels
    assert kernels is not None
    calls, count, kept = [], 0, None
    for k, index in (
        (number, program.index_values[number]),
        (number + len(program.groups), program.index_derivatives[number]),
    ):
        out = aligned_zeros((index.shape[0], len(kernels.tapes[k].outputs), index.shape[2]))
        calls.append(kernels[k].bind(bound.workspace, bound.uniform, index, out, kept))
        kept = out
        count += len(kernels.tapes[k].ops) - kernels.tapes[k].n_uniform_ops

    return chain(calls), count


def casadi_code(
    transcription: Transcription, bound: BoundProgram, number: int, folder: Path
) -> Callable[[], Any]:
    """CasADi's C code of a group's functions, Jacobian and Hessian of the Lagrangian, over the group's nodes."""
    import casadi as ca
    from casadi_bridge import function_of

    group = transcription.program.groups[number]
    tape = group.programs.values_tape
    u, v = ca.SX.sym("u", tape.n_uniform), ca.SX.sym("v", tape.n_varying)
    values = function_of(tape, "values")(u, v)[: len(tape.outputs) - group.programs.kept]
    count = len(group.unknown)
    weights = ca.SX.sym("y", values.shape[0])
    unknown = v[:count]
    data = v[count:]
    inputs = [u, unknown, data, weights]
    lagrangian = ca.dot(weights, values)
    hessian, _ = ca.hessian(lagrangian, unknown)
    outputs = [values, ca.jacobian(values, unknown), ca.tril(hessian)]
    # one vector of varying inputs, so that a node's numbers lie together
    together = ca.SX.sym("x", v.shape[0] + weights.shape[0])
    split = [together[:count], together[count : v.shape[0]], together[v.shape[0] :]]
    outputs = ca.substitute(outputs, [*inputs[1:]], split)
    function = ca.Function("node", [u, together], outputs, {"cse": True})
    generator = ca.CodeGenerator("node", {"with_header": False})
    generator.add(function)
    sizes = [function.nnz_out(k) for k in range(3)]
    total, width = sum(sizes), together.shape[0]
    places = [0, sizes[0], sizes[0] + sizes[1]]
    source = folder / "node.c"
    source.write_text(
        generator.dump()
        + f"""
void run(long nodes, const double* u, const double* x, double* out) {{
  double w[{function.sz_w() + 1}];
  casadi_int iw[{function.sz_iw() + 1}];
  for (long k = 0; k < nodes; ++k) {{
    const double* arg[{function.sz_arg() + 2}] = {{u, x + k * {width}}};
    double* res[{function.sz_res() + 3}] = {{{", ".join(f"out + k * {total} + {p}" for p in places)}}};
    node(arg, res, iw, w, 0);
  }}
}}
""",
        encoding="utf-8",
    )
    library = folder / "node.so"
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise RuntimeError("no C compiler found")
    options = ["-O3", "-march=native", "-fPIC", "-shared"]
    subprocess.run([compiler, *options, str(source), "-o", str(library), "-lm"], check=True)
    run = ctypes.CDLL(str(library)).run
    x = np.zeros((group.size, width))
    x[:, :count] = bound.x0[group.positions].T
    start = transcription.program.data_start[number]
    x[:, count : v.shape[0]] = data_of(bound.workspace, group, start).T
    x[:, v.shape[0] :] = 1.0
    out = np.zeros((group.size, total))
    uniform = np.ascontiguousarray(bound.uniform[: tape.n_uniform])
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (uniform, x, out)]
    keep = (uniform, x, out)

    def call() -> Any:
        run(ctypes.c_long(group.size), *pointers)
        return keep

    return call


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--fineness", type=int, default=1)
    options = parser.parse_args()
    _, transcription = stc.load("luxo_jump").transcription(k=options.fineness)
    bound = transcription.bind()
    groups = transcription.program.groups
    number = max(
        range(len(groups)),
        key=lambda k: groups[k].size * len(groups[k].programs.derivatives_tape.ops),
    )
    largest, per_node = alone(transcription, bound, number)
    one = np.ones(bound.m)
    everything = chain([bound.values_kernels, bound.derivatives_kernels])
    bound.derivatives(bound.x0, one, 1.0)
    contenders: dict[str, Callable[[], Any]] = {"all kernels": everything, "largest kernel": largest}
    with tempfile.TemporaryDirectory() as folder:
        try:
            contenders["CasADi C"] = casadi_code(transcription, bound, number, Path(folder))
        except (ImportError, RuntimeError) as error:
            print(f"CasADi's part is left out: {error}", file=sys.stderr)
        repeats = {name: repeats_for(call) for name, call in contenders.items()}
        samples: dict[str, list[float]] = {name: [] for name in contenders}
        cycles = []
        for _ in range(options.rounds):
            cycles.append(clock_cycle())
            for name, call in contenders.items():
                samples[name].append(timed(call, repeats[name]))
    cycle = min(cycles)
    medians = {name: statistics.median(values) for name, values in samples.items()}
    nodes = groups[number].size
    count = {"all kernels": operations(transcription), "largest kernel": nodes * per_node}
    print(
        "| luxo_jump, residual + Jacobian + Hessian | microseconds: median | least | operations "
        "| cycles per operation: median | least | at most |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for name in ("all kernels", "largest kernel"):
        times = medians[name], min(samples[name])
        rates = [time * 1e9 / cycle / count[name] for time in times]
        print(
            f"| {name} | {1e6 * times[0]:.1f} | {1e6 * times[1]:.1f} | {count[name]:,} "
            f"| {rates[0]:.3f} | {rates[1]:.3f} | 0.25 |"
        )
    if "CasADi C" in medians:
        times = medians["CasADi C"], min(samples["CasADi C"])
        print(
            f"| CasADi C of the largest, {nodes} nodes | {1e6 * times[0]:.1f} | {1e6 * times[1]:.1f} | | | | |"
        )
        ratio = medians["CasADi C"] / medians["largest kernel"]
        print(f"\nThe largest kernel is {ratio:.1f} times faster than CasADi's C (at least 3).")
    print(f"The clock runs at {1.0 / cycle:.2f} GHz (dependent integer operations).")


if __name__ == "__main__":
    main()
