"""Several modules of kernels compiled side by side.

LLVM compiles modules of different contexts independently of each other, and the interpreter lock is not held
meanwhile; only llvmlite lets one thread in at a time.  So the longest step, from the parsed module to object code, is
called past llvmlite's lock where that can be done; everything else, and everything in other versions, goes by it.
While one module is compiled, the text of the next one is written.  Where every processor is busy it is all done by one
thread.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Sequence
from typing import Any

from stc.codegen import engine, threads

__all__ = ["compile_modules"]


def compile_modules(texts: Sequence[Callable[[], str]], level: int) -> list[bytes]:
    """Object code of modules of straight-line kernels, the same whatever number of threads makes it.

    Args:
        texts: each writes the IR of one module.
        level: as for :func:`stc.codegen.engine.compile_ir`.

    Raises:
        RuntimeError: malformed IR.
    """
    emit = _unlocked_emission() if len(texts) > 1 and threads.spare() else None
    if emit is None:
        return [engine.compile_ir(text(), level=level, optimise=False) for text in texts]
    with engine.compiler_lock:
        tasks: list[_Task] = []
        for number, text in enumerate(texts):
            task = _Task(emit, *engine.parsed(text(), level=level, optimise=False))
            tasks.append(task)
            if number < len(texts) - 1:
                task.start()
            else:
                task.run()
        return [task.result() for task in tasks]


class _Task(threading.Thread):
    """The compilation of one module."""

    def __init__(self, emit: Callable[[Any, Any], bytes], target: Any, module: Any) -> None:
        super().__init__(name="stc-compile", daemon=True)
        self._work = [emit, target, module]
        self._code = b""
        self._error: Exception | None = None

    def run(self) -> None:
        emit, target, module = self._work
        try:
            self._code = emit(target, module)
        except Exception as error:
            self._error = error
        finally:  # not left to the garbage collector, which may end a module's context before the module
            self._work.clear()
            del target, module

    def result(self) -> bytes:
        """The object code, once there.

        Raises:
            RuntimeError: there is none.
        """
        if self.ident is not None:
            self.join()
        if self._error is not None:
            raise self._error
        return self._code


def _unlocked_emission() -> Callable[[Any, Any], bytes] | None:
    """From target machine and module to object code without llvmlite's lock; None where that is not known to work."""
    from llvmlite.binding import ffi

    try:
        entry = ffi.lib.LLVMPY_TargetMachineEmitToMemory._cfn
    except AttributeError:
        return None

    def emit(target: Any, module: Any) -> bytes:
        with ffi.OutputString() as message:
            memory = entry(target, module, 1, message)
            if not memory:
                raise RuntimeError(str(message))
        try:
            start = ffi.lib.LLVMPY_GetBufferStart(memory)
            return ctypes.string_at(start, ffi.lib.LLVMPY_GetBufferSize(memory))
        finally:
            ffi.lib.LLVMPY_DisposeMemoryBuffer(memory)

    return emit
