"""The solver's own machine code, compiled when the package is built.

Compiling the functions marked ``@native`` takes longer than solving a small problem a hundred times, so a built package
carries them (:mod:`stc.compile_ahead` makes them) for the common levels of the x86-64 architecture.  An object is found
by a hash of everything that it depends on: the sources of its functions and of the code generator, and the level.  So
whatever was changed since is compiled as if nothing had been shipped, as is everything on machines of another kind.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from stc.codegen import cache
from stc.records import dataclass

if TYPE_CHECKING:
    from stc.codegen.engine import Host
    from stc.codegen.machine import Machine

FOLDER = Path(__file__).with_name("shipped_objects")
_TRIPLE = "x86_64-unknown-linux-gnu"


@dataclass(frozen=True, slots=True)
class Level:
    """A level of the x86-64 architecture (System V ABI, AMD64 supplement, section 3.1.1).

    Attributes:
        name: LLVM's name of a processor that has this and nothing more.
        tuning: features, as LLVM writes them, on top.
        needs: features that a machine must have, as LLVM calls them.
    """

    name: str
    tuning: str
    needs: frozenset[str]

    def runs_on(self, machine: Machine) -> bool:
        """Whether a machine can execute this level's code."""
        return machine.architecture == "x86_64" and self.needs <= machine.features

    def target(self) -> Host:
        """What to compile for."""
        from stc.codegen.engine import Host

        return Host(_TRIPLE, cpu=self.name, features=self.tuning)


def _features(names: str) -> frozenset[str]:
    return frozenset(names.split())


_V3 = _features("avx avx2 bmi bmi2 cx16 f16c fma lzcnt movbe popcnt sahf sse3 sse4.1 sse4.2 ssse3 xsave")
_V4 = _V3 | _features("avx512f avx512bw avx512cd avx512dq avx512vl")
#: What the processor has anyway, but tells how wide vectors are (``stc.codegen.engine.vector_width``).
_WIDE = "+avx512f,+avx512dq,+avx512vl"
#: Best first.
LEVELS = (Level("x86-64-v4", _WIDE, _V4), Level("x86-64-v3", "", _V3))


def find(unit: str, machine: Machine, own_digest: str) -> bytes | None:
    """The shipped image of the best level that this machine can execute.

    Args:
        unit: hash of everything that the code depends on but the machine and the code generator.
        machine: this machine.
        own_digest: of the code generator.
    """
    level = _best_level(machine)
    return None if level is None else cache.load_from(FOLDER, _key(level, unit, own_digest))


@lru_cache(maxsize=1)
def _best_level(machine: Machine) -> Level | None:
    return next((level for level in LEVELS if level.runs_on(machine)), None)


def _key(level: Level, unit: str, own_digest: str) -> str:
    return cache.key_of("shipped", level.name, level.tuning, own_digest, unit)


def build(folder: Path) -> int:
    """Compile all native functions known so far for all levels into a folder, which is emptied first.

    Returns:
        How many objects were written.
    """
    from stc.codegen import engine
    from stc.codegen.image import image_of
    from stc.codegen.native_units import units

    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*" + cache.SUFFIX):
        old.unlink()
    count = 0
    for unit in units():
        ir = unit.ir()
        for level in LEVELS:
            code = engine.compile_ir(ir, level=1, optimise=True, target=level.target())
            image = image_of(code)
            if image is not None:
                key = _key(level, unit.key, engine.own_digest())
                count += cache.store_in(folder, key, image)
    for path in folder.glob("*" + cache.SUFFIX):
        path.chmod(0o644)  # whoever can read the package
    return count
