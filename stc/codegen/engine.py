"""The machine-code engine: LLVM textual IR in, callable addresses out.

Nothing in here knows what the code computes.  Compiled objects are laid out as images (:mod:`stc.codegen.image`)
where that is possible, and else loaded by one process-wide just-in-time linker.  llvmlite is imported only to compile
or to link: a process that finds all its code on disk does without.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import threading
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from stc.codegen import cache, machine
from stc.codegen.image import MAGIC, MappedImage, image_of, map_image, supported
from stc.codegen.sources import digest_of
from stc.codegen.vector import WIDTH
from stc.core import library as core
from stc.errors import UsageError
from stc.records import dataclass

#: Instances per block of kernels: the unit of the memory layout on every machine.
LANES = 4

#: Back-end switches, measured on kernels of up to 50,000 operations.  LLVM is to keep the order in which we emit
#: instructions, which halves the time to compile and gives faster code than its scheduling of basic blocks of
#: thousands of operations; and it is not to join the blocks that kernels are cut into (preparation pass).
_KERNEL_OPTIONS = (
    "-pre-RA-sched=source",
    "-enable-misched=false",
    "-enable-post-misched=false",
    "-disable-post-ra",
    "-disable-cgp",
)
#: The same switches for code with loops, which needs the preparation pass.
_LOOP_OPTIONS = (*_KERNEL_OPTIONS[:-1], "-disable-cgp=false")

#: LLVM's own is 225; at 50 the factorisation compiles in two thirds of the time and runs no slower.  What must be
#: inlined can say so.
_INLINING_THRESHOLD = 50

#: Pointers without types, the pass pipeline, and the attributes that generated code uses.
_OLDEST_LLVM = (16, 0, 0)
#: What brings that along.
_OLDEST_LLVMLITE = (0, 45)

#: Held while LLVM's options, which are those of the process, must not change.
compiler_lock = threading.RLock()
_counter = itertools.count()


@lru_cache(maxsize=1)
def own_digest() -> str:
    """Hash of this package's source: an object made by another version of the code generator is not this one's."""
    return cache.key_of(*[digest_of(str(path)) for path in sorted(Path(__file__).parent.glob("*.py"))])


@dataclass(frozen=True, slots=True)
class Host:
    """A machine to generate code for, as LLVM describes it."""

    triple: str
    cpu: str
    features: str


class LinkedObject:
    """Machine code loaded by LLVM's linker; unmapped when the last reference to it is dropped."""

    def __init__(self, tracker: Any) -> None:
        self._tracker = tracker

    def address(self, symbol: str) -> int:
        """Address of an exported symbol, valid as long as this object is referenced."""
        return int(self._tracker[symbol])


#: Machine code in this process.
LoadedObject = LinkedObject | MappedImage


def requested_backend() -> str:
    """What the environment asks for: ``auto``, ``llvm`` or ``python`` (``STC_BACKEND``)."""
    name = os.environ.get("STC_BACKEND", "auto").strip().lower() or "auto"
    if name == "numpy":
        return "python"
    if name not in ("auto", "llvm", "python"):
        raise ValueError(f"STC_BACKEND is {name!r}; expected auto, llvm or python")
    return name


@lru_cache(maxsize=1)
def _importable() -> bool:
    if machine.known(_OLDEST_LLVMLITE) is not None:
        return True
    try:
        import llvmlite.binding as llvm
    except (ImportError, OSError):
        return False
    return tuple(llvm.llvm_version_info) >= _OLDEST_LLVM


def llvm_wanted() -> bool:
    """Whether code should be compiled: llvmlite is importable and ``STC_BACKEND`` does not forbid it.

    Raises:
        ImportError: ``STC_BACKEND=llvm`` and llvmlite cannot be imported, or is too old.
    """
    backend = requested_backend()
    if backend == "python":
        return False
    if backend == "llvm" and not _importable():
        raise ImportError("STC_BACKEND=llvm, but llvmlite 0.45 or later cannot be imported")
    return _importable()


def _loaded_llvm() -> Any:
    """The compiler.

    Raises:
        UsageError: it is installed, which was all that was asked so far, but cannot be loaded.
    """
    try:
        import llvmlite.binding as llvm
    except (ImportError, OSError) as error:
        raise UsageError(
            f"llvmlite is installed but cannot be loaded ({error}); install it anew, or do without machine code: "
            "STC_BACKEND=python"
        ) from error
    return llvm


@lru_cache(maxsize=1)
def host() -> Host:
    """This machine, as the LLVM that compiles for it describes it."""
    llvm = _loaded_llvm()
    return Host(
        triple=llvm.get_process_triple(),
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
    )


@lru_cache(maxsize=1)
def this_machine() -> machine.Machine:
    """This machine, described without LLVM where that can be."""
    found = machine.known(_OLDEST_LLVMLITE)
    if found is not None:
        return found
    import llvmlite

    here, llvm = host(), _loaded_llvm()
    features = here.features.split(",")
    return machine.Machine(
        architecture=here.triple.split("-")[0],
        features=frozenset(name[1:] for name in features if name.startswith("+")),
        identity="\n".join(
            (here.triple, here.cpu, here.features, llvmlite.__version__, str(llvm.llvm_version_info))
        ),
    )


def fingerprint() -> str:
    """Text that differs whenever object code made here could be wrong, or slow, elsewhere."""
    return "\n".join((own_digest(), this_machine().identity, " ".join((*_KERNEL_OPTIONS, *_LOOP_OPTIONS))))


@lru_cache(maxsize=1)
def has_fma() -> bool:
    """Whether this machine has fused multiply-add instructions."""
    here = this_machine()
    return "fma" in here.features or here.architecture in ("aarch64", "arm64")


#: With these, LLVM computes with vectors of eight doubles.
_EIGHT = {"avx512f", "avx512dq", "avx512vl"}


@lru_cache(maxsize=1)
def vector_width() -> int:
    """How many doubles kernels compute at once: eight where registers hold them, else four.

    (Four are two instructions on machines with two per register, which is no loss.)
    """
    return 8 if this_machine().features >= _EIGHT else 4


def _width_on(there: Host) -> int:
    return 8 if {"+" + name for name in _EIGHT} <= set(there.features.split(",")) else 4


def vector_registers() -> int:
    """How many vectors of :func:`vector_width` doubles fit the registers."""
    # AVX-512: 32 of eight doubles.  AVX2: 16 of four.  Arm: 32 of two, that is 16 of four.
    return 32 if vector_width() == 8 else 16


@lru_cache(maxsize=2)
def _target(triple: str) -> Any:
    llvm = _loaded_llvm()

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(triple)


def _target_machine(level: int, here: Host) -> Any:
    # Small code model and position-independent code: constants are one instruction-pointer-relative load;
    # the linker maps each object as one block, so the 2 GB reach is never exceeded.
    return _target(here.triple).create_target_machine(
        cpu=here.cpu, features=here.features, opt=level, reloc="pic", codemodel="small", jit=True
    )


def compile_ir(ir: str, *, level: int, optimise: bool, target: Host | None = None) -> bytes:
    """Compile textual LLVM IR to object code.

    Args:
        ir: one module.
        level: effort of code generation, 0 to 3.
        optimise: for code with loops: run LLVM's ``O2`` pipeline (loop vectoriser included) first.  Else for
            straight-line kernels.
        target: what for; by default this machine.

    Raises:
        RuntimeError: the IR is malformed, or nothing is known of the machine.
    """
    with compiler_lock:
        emitter, module = parsed(ir, level=level, optimise=optimise, target=target)
        return bytes(emitter.emit_object(module))


def parsed(ir: str, *, level: int, optimise: bool, target: Host | None = None) -> tuple[Any, Any]:
    """Target machine and module of :func:`compile_ir`, ready to be turned into object code.

    Call it, and use what it returns, while holding :data:`compiler_lock`.
    """
    llvm = _loaded_llvm()

    with compiler_lock:
        here = target or host()
        emitter = _target_machine(level, here)
        # Process-wide in LLVM, so set anew each time: what is compiled must not depend on what came before.
        for option in _LOOP_OPTIONS if optimise else _KERNEL_OPTIONS:
            llvm.set_option("stc", option)
        width = vector_width() if target is None else _width_on(target)
        module = llvm.parse_assembly(ir.replace(WIDTH, str(width)), llvm.create_context())
        module.triple = here.triple
        module.data_layout = str(emitter.target_data)
        if optimise:
            # Unrolled and interleaved loops take twice as long to compile, and the solver runs no faster.
            tuning = llvm.create_pipeline_tuning_options(speed_level=2)
            tuning.loop_vectorization = True
            # Scalars that wait for one another, as pivots do, wait longer once they are shuffled in vectors.
            tuning.slp_vectorization = False
            tuning.loop_unrolling = False
            tuning.loop_interleaving = False
            tuning.inlining_threshold = _INLINING_THRESHOLD
            builder = llvm.create_pass_builder(emitter, tuning)
            builder.getModulePassManager().run(module, builder)
        return emitter, module


@lru_cache(maxsize=1)
def _linker() -> Any:
    llvm = _loaded_llvm()

    return llvm.create_lljit_compiler(_target_machine(1, host()), use_jit_link=True)


@lru_cache(maxsize=1)
def _stand_ins() -> dict[str, int]:
    """Addresses of what images get instead of functions of the C library (``stc/core/copy.c``)."""
    address = ctypes.cast(core.library().copy_block, ctypes.c_void_p).value
    assert address is not None
    return dict.fromkeys(("memcpy", "memmove"), address)


def load_object(code: bytes, symbols: Sequence[str]) -> LoadedObject:
    """Map object code, or the image of an object, into the process and resolve ``symbols``.

    Raises:
        RuntimeError: neither of them, or a symbol is missing from it.
    """
    if supported():
        image = code if code.startswith(MAGIC) else image_of(code)
        if image is not None:
            return map_image(image, symbols, _stand_ins())
    llvm = _loaded_llvm()

    with compiler_lock:
        library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
        for symbol in symbols:
            library.export_symbol(symbol)
        return LinkedObject(library.link(_linker(), f"stc{next(_counter)}"))


def cached_object(
    key: str,
    symbols: Sequence[str],
    make: Callable[[], bytes],
    *,
    use_cache: bool = True,
) -> tuple[LoadedObject, bool]:
    """Load object code from the cache, or make, keep and load it.

    Args:
        key: from :func:`stc.codegen.cache.key_of`; must depend on everything that ``make`` does.
        symbols: what to resolve.
        make: compiles.
        use_cache: False neither looks nor keeps.

    Returns:
        The loaded code, and whether it was found and not made.
    """
    if use_cache:
        code = cache.load(key)
        if code is not None:
            with contextlib.suppress(RuntimeError):  # whole by its checksum, and yet not linkable: replace it
                return load_object(code, symbols), True
    made = make()
    code = (image_of(made) if supported() else None) or made
    if use_cache:
        cache.store(key, code)
    return load_object(code, symbols), False
