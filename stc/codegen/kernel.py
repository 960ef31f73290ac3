"""Tapes as kernels: numbers in a workspace vector in, blocks of outputs out.

Layout, for a tape with ``n_out`` outputs whose varying inputs are in ``n_runs`` runs (:mod:`stc.codegen.runs`),
instances in blocks of ``LANES`` (the last block filled up with any valid instances):

    workspace  float64 (n_workspace,)              everything that varies; kernels fetch from it themselves
    uniform    float64 (n_uniform or more,)
    index      int32   (n_blocks, n_runs, LANES)      where in the workspace runs of inputs begin
    out        float64 (n_blocks, n_out, LANES)
    kept       float64 (n_blocks, kept_width, LANES)  outputs of another kernel, for tapes that take some

A kernel is machine code, or goes through its instructions (:mod:`stc.codegen.interpreter`) to the same results: until
compiling has been worth it, or for good where LLVM is missing or not wanted.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from stc.codegen import cache as object_cache
from stc.codegen import engine, threads
from stc.codegen.engine import LANES
from stc.codegen.interpreter import CHUNK, Instructions, assemble
from stc.codegen.runs import RUN, Runs
from stc.codegen.tape import Tape
from stc.core import library as core
from stc.core.calls import Bound
from stc.memory import without_collection

__all__ = ["LANES", "Kernel", "KernelSet", "compile_tapes"]

Backend = Literal["auto", "llvm", "interpreter"]
FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int32]

_NOTHING: FloatArray = np.zeros((0, 0, LANES))


class Kernel:
    """One tape.

    Attributes:
        work: counts instructions times blocks, where it goes through instructions. (1,)
    """

    def __init__(self, tape: Tape, runs: Runs) -> None:
        self.tape = tape
        self.runs = runs
        self.work = np.zeros(1, np.int64)
        self._literals = np.array([*tape.constants, 1.0, -0.0])
        self._entry: Callable[..., Any] | None = None
        self._code: engine.Code | None = None
        self._takes_over = np.zeros(1, np.int64)  # the address of the machine code
        self._instructions: Instructions | None = None

    @property
    def is_compiled(self) -> bool:
        """Whether there is machine code, or none is needed."""
        return self._code is not None or not self.tape.outputs

    def find(self, key: str) -> None:
        """Adopt machine code that is kept, if there is some."""
        code = engine.kept(key, "kernel")
        if code is not None:
            self._adopt(code)

    def compile(self, key: str | None, level: int) -> None:
        """Make machine code; prepared calls that go through instructions take to it as well.

        Args:
            key: where to keep it, None for nowhere.
            level: effort of code generation.
        """
        made = engine.compile_ir(_own_ir(self.tape, self.runs), level)
        if key is not None:
            object_cache.store(key, made)
        self._adopt(engine.load(made, "kernel"))

    def _adopt(self, code: engine.Code) -> None:
        self._code = code
        self._entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(code.address)
        self._takes_over[0] = code.address

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
        strides = LANES * self.runs.count, LANES * len(self.tape.outputs), LANES * self.runs.kept_width
        # See ``tape_call`` in ``stc/core/calls.h``.
        cells = [array.ctypes.data for array in (*arrays, self._literals)]
        cells += [core.library().tape_functions(), index.shape[0], *strides]
        if self._entry is not None:
            return Bound.of_native(self._entry, cells, (arrays, self))
        if self._instructions is None:
            self._instructions = assemble(self.tape, self.runs)
        own, kept_alive = self._instructions.cells(self._takes_over, self.work)
        return Bound.of_native(core.library().tape_run, [*cells, *own], (arrays, kept_alive, self))

    def _checked(
        self,
        workspace: FloatArray,
        uniform: FloatArray,
        index: IndexArray,
        out: FloatArray,
        kept: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray, IndexArray, FloatArray, FloatArray]:
        """The given arrays after a check of their types and shapes; ``kept`` is an empty array if there is none."""
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


class KernelSet:
    """The kernels of one list of tapes: ``kernels[k](workspace, uniform, index, out)``.

    Attributes:
        backend: ``"llvm"`` or ``"interpreter"``.
        seconds: wall time spent on compiling, or on loading from the cache.
        cached: all machine code came from the cache.
        interpreted: some is not compiled, but could be.
    """

    def __init__(
        self,
        tapes: Sequence[Tape],
        runs: Sequence[Runs],
        backend: Literal["llvm", "interpreter"],
        cache: bool,
    ) -> None:
        self.tapes = list(tapes)
        self.runs = list(runs)
        self.backend = backend
        self.seconds = 0.0
        self.cached = False
        self.interpreted = False
        self._cache = cache
        self._kernels = [Kernel(*each) for each in zip(self.tapes, self.runs, strict=True)]

    def __len__(self) -> int:
        return len(self._kernels)

    def __getitem__(self, k: int) -> Kernel:
        return self._kernels[k]

    def __iter__(self) -> Iterator[Kernel]:
        return iter(self._kernels)

    def compile(self) -> None:
        """Compile what is not yet, and have it take over, in calls that are prepared as well."""
        if self.interpreted:
            self.provide(wanted=True)

    def compile_when_due(self) -> None:
        """Do so if calls have taken so much longer than they would have that it had been worth it."""
        if self.interpreted and LONGER * sum(int(kernel.work[0]) for kernel in self) > compiling_takes(
            self.tapes
        ):
            self.compile()

    @without_collection()
    def provide(self, *, wanted: bool) -> None:
        """Machine code for all kernels, as far as it is kept or ``wanted``."""
        started = time.perf_counter()
        level = effort(self.tapes)
        described = "kernel", engine.fingerprint(), f"width {engine.vector_width()} level {level}"
        missing: list[tuple[Kernel, str | None]] = []
        for kernel in self:
            if kernel.is_compiled:
                continue
            key = None
            if self._cache:
                key = object_cache.key_of(*described, kernel.tape.digest(), kernel.runs.digest())
                kernel.find(key)
            if not kernel.is_compiled:
                missing.append((kernel, key))
        if missing and wanted:
            self._compile_all([each for each in missing if _fits_the_stack(each[0].tape)], level)
        self.cached = not missing
        self.interpreted = bool(missing) and not wanted
        self.seconds += time.perf_counter() - started

    def _compile_all(self, missing: list[tuple[Kernel, str | None]], level: int) -> None:
        """The longest first, by two threads where that is allowed."""
        missing.sort(key=lambda each: -len(each[0].tape.ops))
        if threads.allowed() == 1 or len(missing) < 2:
            for kernel, key in missing:
                kernel.compile(key, level)
            return
        from concurrent.futures import ThreadPoolExecutor  # takes longer to import than to find what is kept

        with ThreadPoolExecutor(threads.allowed()) as pool:
            for _ in pool.map(lambda each: each[0].compile(each[1], level), missing):
                pass

    def llvm_ir(self) -> str:
        """The LLVM modules of these kernels, as text."""
        return "\n".join(
            [f"; kernel {k}\n{_own_ir(kernel.tape, kernel.runs)}" for k, kernel in enumerate(self)]
        )


def _own_ir(tape: Tape, runs: Runs) -> str:
    """The LLVM module for this machine."""
    from stc.codegen.llvm import kernel_ir  # which a process that finds all its code does without

    return kernel_ir(tape, runs, width=engine.vector_width(), registers=engine.vector_registers())


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
    if backend == "auto":
        backend = "llvm" if engine.llvm_wanted() else "interpreter"
    if runs is None:
        runs = [Runs.alone(tape.n_varying) for tape in tapes]
    kernels = KernelSet(tapes, runs, backend, cache)
    if backend == "llvm":
        kernels.provide(wanted=instances is None or _is_worth_it(tapes, instances))
    return kernels


#: Tapes of more operations than this together are compiled without optimisation: in a quarter of the time, to code
#: that takes less than twice as long (it works from memory, as such long kernels mostly do anyway).  That pays
#: unless the kernels see some half a million frames (those of all iterations counted).
_LONG = 60_000


def effort(tapes: Sequence[Tape]) -> int:
    """The level of code generation that tapes are worth.  It is decided by them alone, like the machine code."""
    return 0 if sum(len(tape.ops) for tape in tapes) > _LONG else 1


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
