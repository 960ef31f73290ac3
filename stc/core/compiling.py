"""Compiles the core's shared library: at installation, and never afterwards.

This file imports nothing of the package, since the build backend loads it before there is one.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

__all__ = ["LIBRARY", "compile_library", "digest_of_sources", "own_compiler"]

FOLDER = Path(__file__).parent
LIBRARY = (
    "libkkt.dll" if sys.platform == "win32" else "libkkt.dylib" if sys.platform == "darwin" else "libkkt.so"
)

#: What is compiled for each instruction set, chosen when the library is loaded, and whether products and sums may be
#: contracted to multiply-adds there, if it has them.
SEVERAL = {"numeric.c": "fast", "tapes.c": "off"}
#: What a processor has to have for each.
INSTRUCTIONS = {
    "baseline": [],
    "avx2": ["avx2", "fma"],
    "avx512": ["avx2", "fma", "avx512f", "avx512dq", "avx512vl"],
}
FLAGS = ["-std=c11", "-O3", "-fPIC", "-fvisibility=hidden", "-fno-math-errno", "-Wno-unknown-pragmas"]
TRIAL = """#include <math.h>
typedef double lanes __attribute__((vector_size(16)));
int main(int n, char **a) { lanes x = {n, n}; (void)a; return sqrt((x + x)[0]) == sqrt(2.0) ? 0 : 1; }
"""


def _is_x86() -> bool:
    return platform.machine().lower() in ("x86_64", "amd64")


def digest_of_sources() -> str:
    """What the library was made from, and is compared with in a checkout."""
    digest = hashlib.blake2b(digest_size=16)
    for path in sorted([*FOLDER.glob("*.c"), *FOLDER.glob("*.h"), Path(__file__)]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def own_compiler() -> list[str] | None:
    """The machine's compiler, as a command: one that makes a program which runs."""
    given = os.environ.get("CC")
    for command in ([shlex.split(given)] if given else []) + [["cc"], ["gcc"], ["clang"]]:
        if shutil.which(command[0]) is None:
            continue
        with tempfile.TemporaryDirectory() as folder:
            source, program = Path(folder, "trial.c"), Path(folder, "trial.exe")
            source.write_text(TRIAL)
            made = subprocess.run(
                [*command, "-std=c11", "-o", str(program), str(source), "-lm"],
                capture_output=True,
                check=False,
            )
            if made.returncode == 0 and subprocess.run([str(program)], check=False).returncode == 0:
                return command
    return None


def _packaged_compiler() -> list[str]:
    """The one of the package ``ziglang``, for the plainest processor of this kind."""
    if sys.platform == "linux":
        target = ["-target", f"{'x86_64' if _is_x86() else 'aarch64'}-linux-gnu.2.17"]
    else:
        target = []
    return [sys.executable, "-m", "ziglang", "cc", *target]


def _flags_of(kind: str, packaged: bool) -> list[str]:
    """Of an instruction set: never those of the machine at hand, since the library may go to another one."""
    features = INSTRUCTIONS[kind]
    if not packaged:  # some are configured for a later processor than the plainest
        plainest = ["-march=x86-64"] if _is_x86() else []
        return [*plainest, *(f"-m{feature}" for feature in features)]
    wide = ["evex512"] if "avx512f" in features else []
    return [f"-mcpu={'+'.join(['baseline', *features, *wide])}"]


def compile_library(target: Path, scratch: Path, flags: list[str] | None = None) -> None:
    """Compile the sources of this folder.

    Parameters
    ----------
    target : the folder that the library goes to.
    scratch : a folder for what is needed on the way; it is made.
    flags : further ones: sanitizers, for tests.

    Raises
    ------
    RuntimeError : there is no compiler, or it refuses a source.
    """
    own = own_compiler()
    compiler = own or _packaged_compiler()
    scratch.mkdir(parents=True, exist_ok=True)
    environment = {
        **os.environ,
        "ZIG_GLOBAL_CACHE_DIR": str(scratch / "zig"),
        "ZIG_LOCAL_CACHE_DIR": str(scratch / "zig"),
    }
    more = [*(flags or []), *(["-DKKT_X86"] if _is_x86() else []), f'-DKKT_SOURCES="{digest_of_sources()}"']

    def run(command: list[str]) -> None:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        if done.returncode:
            raise RuntimeError(f"{shlex.join(command)} failed:\n{done.stderr}")

    jobs = []
    for source in sorted(FOLDER.glob("*.c")):
        for kind in INSTRUCTIONS if source.name in SEVERAL and _is_x86() else ["baseline"]:
            built = scratch / f"{source.stem}_{kind}.o"
            contraction = "off" if kind == "baseline" else SEVERAL[source.name]
            options = [
                *FLAGS,
                f"-ffp-contract={contraction}",
                *_flags_of(kind, own is None),
                f"-DKIND={kind}",
                *more,
            ]
            jobs.append((built, [*compiler, *options, "-c", str(source), "-o", str(built)]))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, (command for _, command in jobs)))
    made = scratch / LIBRARY
    run(
        [
            *compiler,
            "-shared",
            *(flags or []),
            "-o",
            str(made),
            *(str(built) for built, _ in jobs),
            "-lm",
            "-pthread",
        ]
    )
    target.mkdir(parents=True, exist_ok=True)
    fresh = target / f"{LIBRARY}.new"
    shutil.copyfile(made, fresh)
    fresh.replace(target / LIBRARY)  # whoever has the old one loaded keeps it


if __name__ == "__main__":
    compile_library(FOLDER, FOLDER.parents[1] / "build" / "core")
