"""Compiled tapes: numbers in a workspace vector in, blocks of outputs out.

Layout, for a tape with ``n_out`` outputs whose varying inputs are in ``n_runs`` runs (:mod:`stc.codegen.runs`),
instances in blocks of ``LANES`` (the last block filled up with any valid instances):

    workspace  float64 (n_workspace,)              everything that varies; kernels fetch from it themselves
    uniform    float64 (n_uniform or more,)
    index      int32   (n_blocks, n_runs, LANES)      where in the workspace runs of inputs begin
    out        float64 (n_blocks, n_out, LANES)
    kept       float64 (n_blocks, kept_width, LANES)  outputs of another kernel, for tapes that take some

The same tapes run in NumPy when LLVM is missing or not wanted.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from stc.codegen import cache as object_cache
from stc.codegen import engine, reference
from stc.codegen.engine import LANES
from stc.codegen.interpreter import CHUNK, Code, assemble
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import Tape
from stc.core import library as core
from stc.core.calls import Bound
from stc.memory import without_collection

__all__ = ["LANES", "Kernel", "KernelSet", "compile_tapes"]

Backend = Literal["auto", "llvm", "numpy"]
FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int32]

_NOTHING: FloatArray = np.zeros((0, 0, LANES))


class Kernel:
    """One compiled tape."""

    def __init__(self, tape: Tape, runs: Runs) -> None:
        self.tape = tape
        self.runs = runs
        self._packed: Callable[..., Any] | None = None
        self._object: engine.LoadedObject | None = None
        self._code: Code | None = None
        self._work = np.zeros(1, np.int64)  # of all kernels together, once they are interpreted
        self._takes_over = np.zeros(1, np.int64)  # the address of the machine code's entry

    def install(self, loaded: engine.LoadedObject, symbol: str) -> None:
        """Adopt machine code; prepared calls that go through instructions take to it as well."""
        address = loaded.address(symbol + ".packed")
        self._packed = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)
        self._object = loaded
        self._takes_over[0] = address

    @property
    def is_compiled(self) -> bool:
        """Whether there is machine code."""
        return self._packed is not None

    def interpret(self, work: NDArray[np.int64]) -> None:
        """Go through instructions until there is machine code; ``work`` counts them, times blocks."""
        self._code, self._work = assemble(self.tape, self.runs, engine.has_fma()), work

    def __call__(self, *arrays: NDArray[Any]) -> None:
        """Evaluate all blocks: what :meth:`bind` prepares, called once."""
        self.bind(*arrays)()

    def bind(
        self,
        workspace: FloatArray,
        uniform: FloatArray,
        index: IndexArray,
        out: FloatArray,
        kept: FloatArray | None = None,
    ) -> Bound:
        """Check and convert once; the result evaluates when called, at 0.1 microseconds of overhead.

        Raises:
            ValueError: an array of wrong type, shape or layout, or a run that reaches out of the workspace.
        """
        arrays = self._checked(workspace, uniform, index, out, kept)
        cells = [*(array.ctypes.data for array in arrays), index.shape[0]]
        if self._packed is not None:
            return Bound.of_native(self._packed, cells, (arrays, self._object))
        if self._code is not None:
            own, kept_alive = self._code.cells(self.tape, self.runs, self._takes_over, self._work)
            return Bound.of_native(core.library().tape_run, [*cells, *own], (arrays, kept_alive, self))
        return Bound.of_python(self._run_numpy, arrays)

    def _checked(
        self,
        workspace: FloatArray,
        uniform: FloatArray,
        index: IndexArray,
        out: FloatArray,
        kept: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray, IndexArray, FloatArray, FloatArray]:
        """All of them, if they are as they should be."""
        tape, runs, width = self.tape, self.runs.count, self.runs.kept_width
        if kept is None:
            kept = _NOTHING
        for name, array, dtype in (
            ("workspace", workspace, np.float64),
            ("uniform", uniform, np.float64),
            ("index", index, np.int32),
            ("out", out, np.float64),
            ("kept", kept, np.float64),
        ):
            if not isinstance(array, np.ndarray) or array.dtype != dtype or not array.flags.c_contiguous:
                raise ValueError(f"{name} must be a C-contiguous array of {np.dtype(dtype)}")
        if workspace.ndim != 1 or uniform.ndim != 1 or uniform.size < tape.n_uniform:
            raise ValueError(
                f"workspace and uniform must be vectors, uniform of {tape.n_uniform} or more values"
            )
        blocks = index.shape[0] if index.ndim == 3 else -1
        if index.shape != (blocks, runs, LANES):
            raise ValueError(f"index has shape {index.shape}, not (blocks, {runs}, {LANES})")
        if out.shape != (blocks, len(tape.outputs), LANES):
            raise ValueError(f"out has shape {out.shape}, not ({blocks}, {len(tape.outputs)}, {LANES})")
        if width and kept.shape != (blocks, width, LANES):
            raise ValueError(f"kept has shape {kept.shape}, not ({blocks}, {width}, {LANES})")
        if not out.flags.writeable:
            raise ValueError("out is read-only")
        if index.size and (index.min() < 0 or index.max() + RUN > workspace.size):
            raise ValueError(
                f"index points outside the workspace of {workspace.size} values, of which {RUN} are read at once"
            )
        return workspace, uniform, index, out, kept

    def _run_numpy(
        self,
        workspace: FloatArray,
        uniform: FloatArray,
        index: IndexArray,
        out: FloatArray,
        kept: FloatArray,
    ) -> None:
        tape = self.tape
        blocks = index.shape[0]
        varying = np.zeros((tape.n_varying, blocks * LANES))
        for v, place in enumerate(self.runs.places):
            if place >= 0:
                varying[v] = workspace[index[:, place // RUN].reshape(-1) + place % RUN]
        for slot, row in self.runs.kept_rows(tape).items():
            varying[slot - tape.n_uniform] = kept[:, row].reshape(-1)
        values = reference.run(tape, uniform, varying)
        out[...] = values.reshape(len(tape.outputs), blocks, LANES).transpose(1, 0, 2)


class KernelSet:
    """The kernels of one list of tapes: ``kernels[k](workspace, uniform, index, out)``.

    Attributes:
        backend: ``"llvm"`` or ``"numpy"``.
        seconds: wall time spent on compiling, or on loading from the cache.
        cached: the machine code came from the cache.
        interpreted: some of it is not compiled yet; calls go through instructions instead (see
            :mod:`stc.codegen.interpreter`), to the same results.  Kernels that would take too much of the stack
            are never compiled.
    """

    def __init__(
        self, tapes: Sequence[Tape], runs: Sequence[Runs], backend: Literal["llvm", "numpy"]
    ) -> None:
        self.tapes = list(tapes)
        self.runs = list(runs)
        self.backend = backend
        self.seconds = 0.0
        self.cached = False
        self.interpreted = False
        self._work = np.zeros(1, np.int64)
        self._kernels = [Kernel(*each) for each in zip(self.tapes, self.runs, strict=True)]

    def __len__(self) -> int:
        return len(self._kernels)

    def __getitem__(self, k: int) -> Kernel:
        return self._kernels[k]

    def __iter__(self) -> Iterator[Kernel]:
        return iter(self._kernels)

    def compile(self, cache: bool = True) -> None:
        """Compile what is not yet, and have it take over, in calls that are prepared as well."""
        if self.interpreted:
            started = time.perf_counter()
            _load_or_compile(self, cache, wanted=True)
            self.interpreted = False
            self.seconds += time.perf_counter() - started

    def compile_when_due(self, cache: bool = True) -> None:
        """Do so if calls have taken so much longer than they would have that it had been worth it."""
        if self.interpreted and LONGER * int(self._work[0]) > compiling_takes(self.tapes):
            self.compile(cache)

    @without_collection()
    def interpret(self) -> None:
        """Have instructions for what is not compiled."""
        self.interpreted = True
        for kernel in self._kernels:
            if not kernel.is_compiled:
                kernel.interpret(self._work)

    def bind(
        self,
        k: int,
        workspace: FloatArray,
        uniform: FloatArray,
        index: IndexArray,
        out: FloatArray,
        kept: FloatArray | None = None,
    ) -> Bound:
        """A zero-argument callable that runs kernel ``k`` on these arrays; see :meth:`Kernel.bind`."""
        return self._kernels[k].bind(workspace, uniform, index, out, kept)

    def llvm_ir(self) -> str:
        """One LLVM module with all of these kernels, as text."""
        from stc.codegen.llvm import module_ir

        return (module_ir if self.backend == "numpy" else _own_ir)(self.tapes, self.runs)


def _own_ir(tapes: Sequence[Tape], runs: Sequence[Runs]) -> str:
    """The LLVM module for this machine."""
    from stc.codegen.llvm import module_ir  # which a process that finds all its code does without

    return module_ir(
        tapes, runs, width=engine.vector_width(), registers=engine.vector_registers(), fused=engine.has_fma()
    )


def compile_tapes(
    tapes: Sequence[Tape],
    runs: Sequence[Runs] | None = None,
    backend: Backend = "auto",
    cache: bool = True,
    instances: Sequence[int] | None = None,
) -> KernelSet:
    """Compile tapes, or find the machine code in the object cache.

    Args:
        tapes: the programs; kernel ``k`` runs ``tapes[k]``.
        runs: where the varying inputs of each are; by default each input is a run of its own.
        backend: ``auto`` takes LLVM where it is available and ``STC_BACKEND`` does not forbid it.
        cache: look for, and keep, the machine code on disk.
        instances: for how many each tape is run, given where it may be interpreted to begin with.

    Raises:
        ImportError: LLVM is asked for by name and cannot be imported.
    """
    started = time.perf_counter()
    if backend == "auto":
        backend = "llvm" if engine.llvm_wanted() else "numpy"
    if runs is None:
        runs = [Runs.alone(tape.n_varying) for tape in tapes]
    kernels = KernelSet(tapes, runs, backend)
    if backend == "llvm" and tapes:
        if not _load_or_compile(kernels, cache, wanted=instances is None or _is_worth_it(tapes, instances)):
            kernels.interpret()
    kernels.seconds = time.perf_counter() - started
    return kernels


#: Tapes of more operations than this together are compiled without optimisation: in a quarter of the time, to code
#: that takes less than twice as long (it works from memory, as such long kernels mostly do anyway).  That pays
#: unless the kernels see some half a million frames (those of all iterations counted).
_LONG = 60_000


def effort(tapes: Sequence[Tape]) -> int:
    """The level of code generation that tapes are worth.  It is decided by them alone, like the machine code."""
    return 0 if sum(len(tape.ops) for tape in tapes) > _LONG else 1


#: Tapes of more operations than this together are compiled as two modules, which two threads can do side by side,
#: if the smaller one has at least this part of the work.
_DIVIDED = 2_000
_SMALLER = 0.15


def parts(tapes: Sequence[Tape]) -> list[list[int]]:
    """Positions of the tapes that are compiled together, decided by the tapes alone; the longer part first."""
    work = [len(tape.ops) + 2 * (len(tape.outputs) + tape.n_varying) for tape in tapes]
    everything = list(range(len(tapes)))
    if sum(len(tape.ops) for tape in tapes) <= _DIVIDED:
        return [everything]
    halves: list[list[int]] = [[], []]
    loads = [0, 0]
    for k in sorted(everything, key=lambda k: -work[k]):
        lighter = int(loads[1] < loads[0])
        halves[lighter].append(k)
        loads[lighter] += work[k]
    if min(loads) < _SMALLER * sum(loads):
        return [everything]
    return [sorted(halves[k]) for k in sorted((0, 1), key=lambda k: -loads[k])]


#: Nanoseconds that an instruction takes longer for a block than a compiled operation, and those for each time that it
#: is looked at.
LONGER, LOOK = 0.5, 4.0
#: Nanoseconds that it takes to compile, to begin with and for each operation.
BEGIN, EACH = 3e7, 8e4
#: Evaluations that a solve is expected to take.
EXPECTED = 60


def compiling_takes(tapes: Sequence[Tape]) -> float:
    """How many nanoseconds it takes to compile tapes, about."""
    return BEGIN + EACH * sum(len(tape.ops) for tape in tapes)


def _is_worth_it(tapes: Sequence[Tape], instances: Sequence[int]) -> bool:
    """Whether one solve would lose as much time by going through instructions as it takes to compile."""
    longer = 0.0
    for tape, count in zip(tapes, instances, strict=True):
        blocks = -(-count // LANES)
        longer += len(tape.ops) * (LONGER * blocks + LOOK * -(-blocks // CHUNK))
    return EXPECTED * longer > compiling_takes(tapes)


#: Bytes that a kernel may take of the stack, of which threads usually have 8 MB, and how many operations there are to
#: each vector that it takes.  Long tapes are compiled without optimisation, which gives every value that is needed in
#: another basic block a place of its own: 1.1 million operations on vectors of 64 bytes take 11.6 MB.
STACK = 5_000_000
_TO_A_PLACE = 6


def _fits_the_stack(tape: Tape) -> bool:
    """Whether machine code of a tape would keep its values within :data:`STACK`."""
    return 8 * engine.vector_width() * len(tape.ops) // _TO_A_PLACE <= STACK


class _Absent(Exception):
    """There is no machine code, and none is wanted yet."""


@without_collection()
def _load_or_compile(kernels: KernelSet, cache: bool, *, wanted: bool) -> bool:
    """Machine code for all kernels; False where some was not at hand, and is not ``wanted`` or not possible."""
    level = effort(kernels.tapes)
    divided = parts(kernels.tapes)
    groups = [([kernels.tapes[k] for k in part], [kernels.runs[k] for k in part]) for part in divided]
    made: dict[int, bytes] = {}

    def make(number: int) -> bytes:
        if not wanted or not all(map(_fits_the_stack, groups[number][0])):
            raise _Absent
        if number not in made:  # nor will the later ones be found
            from stc.codegen.compiling import compile_modules

            later = [k for k in range(number + 1, len(groups)) if all(map(_fits_the_stack, groups[k][0]))]
            missing = [number, *later]
            codes = compile_modules([partial(_own_ir, *groups[k]) for k in missing], level)
            made.update(zip(missing, codes, strict=True))
        return made[number]

    kernels.cached = complete = True
    for number, positions in enumerate(divided):
        if all(kernels[position].is_compiled for position in positions):
            continue
        tapes, runs = groups[number]
        names = [f"kernel{k}" for k in range(len(positions))]
        key = object_cache.key_of(
            "kernels",
            engine.fingerprint(),
            f"width {engine.vector_width()} level {level}",
            *(tape.digest() for tape in tapes),
            *(of_tape.digest() for of_tape in runs),
        )
        entries = [name + ".packed" for name in names]
        try:
            loaded, cached = engine.cached_object(key, entries, partial(make, number), use_cache=cache)
        except _Absent:
            kernels.cached = complete = False
            continue
        kernels.cached &= cached
        for name, position in zip(names, positions, strict=True):
            kernels[position].install(loaded, name)
    return complete
