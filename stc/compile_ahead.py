"""Compile the solver's own code when the package is built: ``python -m stc.compile_ahead FOLDER``.

:mod:`stc.codegen.shipped` loads the result.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path

import stc.solver
import stc.transcription
from stc.codegen import calls, copying, engine, interpreter, shipped, threads


def main() -> None:
    """Compile the solver's own code into the folder that the command line names."""
    (folder,) = sys.argv[1:]
    if not engine.llvm_wanted():
        print("without LLVM the solver's own code is compiled when it is first used", file=sys.stderr)
        return
    for package in (stc.solver, stc.transcription):  # what declares native functions
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
            importlib.import_module(module.name)
    others = [interpreter.module(fused=True), calls.CHAIN, copying.MODULE, threads.MODULE]
    print(f"{shipped.build(Path(folder), others)} objects of machine code in {folder}")


if __name__ == "__main__":
    main()
