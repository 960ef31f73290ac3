"""Modules of LLVM that are the same for every problem: compiled once on a machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from stc.codegen import cache, engine
from stc.records import dataclass

__all__ = ["FixedModule"]


@dataclass(frozen=True, slots=True)
class FixedModule:
    """A module that depends on nothing but this package's source and the machine.

    Attributes:
        name: what its object code is found as.
        symbols: what it offers.
        write: its text.
        optimise: see :func:`stc.codegen.engine.compile_ir`.
        instead: see :func:`stc.codegen.engine.load_object`.
    """

    name: str
    symbols: tuple[str, ...]
    write: Callable[[], str]
    optimise: bool = False
    instead: Mapping[str, int] | None = None

    def load(self) -> engine.LoadedObject:
        """Find the machine code on disk, or compile it."""
        loaded, _ = engine.cached_object(
            cache.key_of("fixed", self.name, engine.fingerprint()),
            self.symbols,
            lambda: engine.compile_ir(self.write(), level=1, optimise=self.optimise),
            instead=self.instead,
        )
        return loaded
