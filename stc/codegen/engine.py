"""The machine-code engine: LLVM textual IR in, callable addresses out.

Code is made for an instruction set, not for the processor at hand, and refers to nothing outside itself.  So what LLVM
makes on Linux is kept as it is, and only copied into memory by a process that finds it: llvmlite, whose import takes
longer than a small solve, is imported only to compile.  Elsewhere LLVM's just-in-time linker loads its objects.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import mmap
import os
import sys
import threading
from collections.abc import Iterable
from functools import lru_cache
from hashlib import blake2b
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from stc.codegen import cache
from stc.core import library as core
from stc.errors import UsageError

#: Instances per block of kernels: the unit of the memory layout on every machine.
LANES: Final = 4

#: Back-end switches, measured on kernels of up to 50,000 operations.  LLVM is to keep the order in which we emit
#: instructions, which halves the time to compile and gives faster code than its scheduling of basic blocks of
#: thousands of operations; and it is not to join the blocks that kernels are cut into (preparation pass).
_OPTIONS: Final = (
    "-pre-RA-sched=source",
    "-enable-misched=false",
    "-enable-post-misched=false",
    "-disable-post-ra",
    "-disable-cgp",
)

#: LLVM's names for the instruction sets of the core's libraries.
_PROCESSORS: Final = {"avx512": "x86-64-v4", "avx2": "x86-64-v3", "baseline": ""}

#: Leads code that is ready to run; an object starts with something else.
_MAGIC: Final = b"stc-code-1\n"

#: Held while LLVM's options, which are those of the process, must not change.
_compiling = threading.Lock()
_linked_before = itertools.count()


@lru_cache(maxsize=1)
def own_digest() -> str:
    """Hash of this package's source: what another version of the code generator made is not this one's."""
    return digest_of(Path(__file__).parent.glob("*.py"))


def digest_of(paths: Iterable[Path]) -> str:
    """Hash of the contents of files."""
    content = blake2b(digest_size=32)
    for path in sorted(map(str, paths)):
        with open(path, "rb", buffering=0) as file:  # noqa: PTH123 (Path.read_bytes takes three times as long)
            content.update(file.read())
    return content.hexdigest()


@lru_cache(maxsize=1)
def function_numbers() -> dict[str, int]:
    """The core's instructions for tapes, and functions for machine code, by name (``stc/core/tapes.c``)."""
    names: bytes = core.library().tape_instructions()
    return {name: number for number, name in enumerate(names.decode().split())}


def llvm_wanted() -> bool:
    """Whether code should be compiled: llvmlite is installed and ``STC_BACKEND`` does not forbid it.

    Raises:
        ImportError: ``STC_BACKEND=llvm`` and llvmlite is not installed.
        ValueError: ``STC_BACKEND`` is something else.
    """
    name = os.environ.get("STC_BACKEND", "auto").strip().lower() or "auto"
    if name not in ("auto", "llvm", "python"):
        raise ValueError(f"STC_BACKEND is {name!r}; expected auto, llvm or python")
    if name == "llvm" and _compiler() is None:
        raise ImportError("STC_BACKEND=llvm, but llvmlite is not installed")
    return name != "python" and _compiler() is not None


@lru_cache(maxsize=1)
def _compiler() -> str | None:
    """A text that identifies the installed llvmlite and the LLVM in it; None if it is not installed."""
    found = find_spec("llvmlite")
    if found is None or not found.origin:
        return None
    with contextlib.suppress(OSError):
        return (Path(found.origin).parent / "_version.py").read_text(encoding="utf-8")
    return found.origin


def fingerprint() -> str:
    """Text that differs whenever machine code made here could be wrong elsewhere."""
    functions = " ".join(function_numbers())
    return "\n".join(
        (own_digest(), str(_compiler()), sys.platform, _architecture(), core.instructions(), functions)
    )


def vector_width() -> int:
    """How many doubles kernels compute at once: eight where registers hold them, else four.

    (Four are two instructions on machines with two per register, which is no loss.)
    """
    return 8 if core.instructions() == "avx512" else 4


def vector_registers() -> int:
    """How many vectors of :func:`vector_width` doubles fit the registers."""
    # AVX-512: 32 of eight doubles.  AVX2: 16 of four.  Arm: 32 of two, that is 16 of four.
    return 32 if vector_width() == 8 else 16


def is_x86() -> bool:
    """Whether this machine's processor is of the kind x86-64."""
    return _architecture().lower() in ("x86_64", "amd64")


def _architecture() -> str:
    """The system's name for the kind of processor; without the module ``platform``, which takes long to import."""
    return os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_ARCHITECTURE", "")


def _llvm() -> Any:
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
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm


def _target_machine(llvm: Any, level: int) -> Any:
    target = llvm.Target.from_default_triple()
    # Small code model and position-independent code: what refers to itself does so relative to the instruction pointer.
    return target.create_target_machine(
        cpu=_PROCESSORS[core.instructions()], opt=level, reloc="pic", codemodel="small", jit=True
    )


def compile_ir(ir: str, level: int) -> bytes:
    """Compile textual LLVM IR, of straight-line kernels, to machine code that :func:`load` takes.

    Args:
        ir: one module.
        level: effort of code generation, 0 to 3.

    Raises:
        RuntimeError: the IR is malformed.
    """
    llvm = _llvm()
    with _compiling:
        # Process-wide in LLVM, so set anew each time: what is compiled must not depend on what came before.
        for option in _OPTIONS:
            llvm.set_option("stc", option)
        machine = _target_machine(llvm, level)
        module = llvm.parse_assembly(ir, llvm.create_context())
        module.triple = llvm.get_process_triple()
        module.data_layout = str(machine.target_data)
    made = _emitted(machine, module)
    if not (sys.platform == "linux" and is_x86()):
        return made
    text = b""
    with llvm.ObjectFileRef.from_data(made) as contents:
        for section in contents.sections():  # each is there until the next one is asked for
            name = section.name() or b""
            if name == b".text":
                text = section.data()
            elif name.startswith((b".rela.text", b".rodata", b".data", b".bss")):
                return made
    return _MAGIC + text


def _emitted(machine: Any, module: Any) -> bytes:
    """Object code; past the lock of llvmlite where it can be had, so that two threads can be at it."""
    from llvmlite.binding import ffi

    entry = getattr(ffi.lib.LLVMPY_TargetMachineEmitToMemory, "_cfn", None)
    if entry is None:  # another version
        return bytes(machine.emit_object(module))
    with ffi.OutputString() as message:
        memory = entry(machine, module, 1, message)
        if not memory:
            raise RuntimeError(str(message))
    try:
        return ctypes.string_at(ffi.lib.LLVMPY_GetBufferStart(memory), ffi.lib.LLVMPY_GetBufferSize(memory))
    finally:
        ffi.lib.LLVMPY_DisposeMemoryBuffer(memory)


class Code:
    """Machine code in this process, unmapped when the last reference to it is dropped.

    Attributes:
        address: of the first function.
    """

    def __init__(self, address: int, keep: Any) -> None:
        self.address = address
        self._keep = keep


def load(code: bytes, symbol: str) -> Code:
    """Map what :func:`compile_ir` has made into the process.

    Args:
        code: of a module with one function.
        symbol: its name.

    Raises:
        RuntimeError: it is something else, or the system does not allow it.
    """
    if not code.startswith(_MAGIC):
        return _linked(code, symbol)
    text = memoryview(code)[len(_MAGIC) :]
    try:
        memory = mmap.mmap(-1, max(len(text), 1), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    except OSError as error:
        raise RuntimeError(f"no memory for machine code: {error}") from error
    memory[: len(text)] = text
    address = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    protect = ctypes.CDLL(None).mprotect
    if protect(ctypes.c_void_p(address), ctypes.c_size_t(len(memory)), mmap.PROT_READ | mmap.PROT_EXEC):
        raise RuntimeError("this system does not let memory be made executable")
    return Code(address, memory)


def _linked(code: bytes, symbol: str) -> Code:
    """An object, by LLVM's linker."""
    llvm = _llvm()
    with _compiling:
        library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process()
        library.export_symbol(symbol)
        tracker = library.link(_linker(), f"stc{next(_linked_before)}")
    return Code(int(tracker[symbol]), tracker)


@lru_cache(maxsize=1)
def _linker() -> Any:
    llvm = _llvm()
    return llvm.create_lljit_compiler(_target_machine(llvm, 1), use_jit_link=True)


def kept(key: str, symbol: str) -> Code | None:
    """Load the entry of the cache under a key; None if there is none that can be loaded."""
    code = cache.load(key)
    if code is not None:
        with contextlib.suppress(RuntimeError):  # whole by its checksum, and yet not linkable: to be replaced
            return load(code, symbol)
    return None
