"""Compiles the core's shared libraries: at installation, and never afterwards.

Wheels for other platforms than this machine's are compiled by the package ``ziglang``; see :data:`PLATFORMS`.

This file imports nothing of the package, since the build backend loads it before there is one.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

__all__ = [
    "PLATFORMS",
    "Platform",
    "compile_libraries",
    "digest_of_sources",
    "entries_text",
    "file_of",
    "instructions",
    "own_compiler",
    "wanted_platform",
]

FOLDER = Path(__file__).parent


class Platform(NamedTuple):
    """A kind of machine that the libraries run on.

    Attributes
    ----------
    target : its name for ``ziglang``; empty for that of the machine at hand.
    suffix : what shared libraries end in.
    x86 : whether its processors are of the kind x86-64.
    """

    target: str
    suffix: str
    x86: bool


#: What wheels can be made for, by the name in a wheel's file name.
PLATFORMS = {
    "manylinux2014_x86_64": Platform("x86_64-linux-gnu.2.17", "so", True),
    "manylinux2014_aarch64": Platform("aarch64-linux-gnu.2.17", "so", False),
    "macosx_11_0_arm64": Platform("aarch64-macos.11.0", "dylib", False),
    "win_amd64": Platform("x86_64-windows-gnu", "dll", True),
}
#: The environment variable that names one of them while a wheel is built; without it, the machine at hand is meant.
WANTED = "STC_WHEEL_PLATFORM"

#: Instruction sets, each with a library of its own: what a processor has to have.
INSTRUCTIONS = {
    "baseline": [],
    "avx2": ["avx2", "fma", "bmi", "bmi2", "popcnt"],
    "avx512": ["avx2", "fma", "bmi", "bmi2", "popcnt", "avx512f", "avx512dq", "avx512vl"],
}
FLAGS = [
    "-std=c11", "-O3", "-fPIC", "-fvisibility=hidden", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd",
    "-Wno-unknown-pragmas", "-Wno-psabi",
]  # fmt: skip
#: Products and sums are rounded as they are written, so that results are the same on all processors, but for inner
#: loops, where they are contracted to multiply-adds.
CONTRACTED = {
    "conditions",
    "elastic",
    "gather",
    "numeric",
    "points",
    "step",
}
TRIAL = """#include <math.h>
typedef double lanes __attribute__((vector_size(16)));
int main(int n, char **a) {
    lanes x = {n, n}, y = __builtin_shufflevector(x, x, 1, 2);
    (void)a;
    return sqrt((x + y)[0]) == sqrt(2.0) ? 0 : 1;
}
"""


def wanted_platform() -> str | None:
    """The platform of :data:`PLATFORMS` that a wheel is built for; None for this machine.

    Raises
    ------
    RuntimeError : the environment variable names another one.
    """
    name = os.environ.get(WANTED)
    if name and name not in PLATFORMS:
        raise RuntimeError(f"{WANTED} is {name!r}; known platforms: {', '.join(PLATFORMS)}")
    return name or None


def this_machine() -> Platform:
    """The machine at hand."""
    x86 = platform.machine().lower() in ("x86_64", "amd64")
    suffix = {"win32": "dll", "darwin": "dylib"}.get(sys.platform, "so")
    # The oldest C library that is still in use, so that what is built here runs on machines with an older one.
    linux = f"{'x86_64' if x86 else 'aarch64'}-linux-gnu.2.17" if sys.platform == "linux" else ""
    return Platform(linux, suffix, x86)


def instructions(machine: Platform | None = None) -> list[str]:
    """The names of the instruction sets that libraries are compiled for."""
    return list(INSTRUCTIONS) if (machine or this_machine()).x86 else ["baseline"]


def file_of(kind: str, machine: Platform | None = None) -> str:
    """The file name of the library for an instruction set."""
    return f"libcore_{kind}.{(machine or this_machine()).suffix}"


def sources() -> list[Path]:
    """All files that the libraries are made from."""
    return sorted([*FOLDER.rglob("*.c"), *FOLDER.rglob("*.h"), Path(__file__)])


def digest_of_sources() -> str:
    """What the libraries were made from, and are compared with in a checkout."""
    digest = hashlib.blake2b(digest_size=16)
    for path in sources():
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


#: Kinds of arguments, as signatures tell them to Python, and how each one is read from its cell.
_KINDS = {
    "int64_t": ("i", "i"), "double": ("d", "d"), "double *": ("D", "p"), "int32_t *": ("I", "p"),
    "int64_t *": ("L", "p"),
}  # fmt: skip
_RESULTS = {"void": "v", "int64_t": "i", "double": "d"}
_STRUCTS = re.compile(r"^typedef API_STRUCT \{(.*?)^\} (\w+);", re.MULTILINE | re.DOTALL)
_DECLARED = re.compile(r"^API (void|int64_t|double) (\w+)\(([^)]*)\);", re.MULTILINE)
_PARAMETER = re.compile(r"(?:const )?(\w+ \*?)(?:restrict )?(\w+)")


def entries_text() -> str:
    """C source of the entries for prepared calls, of each function that a header declares as API, and of signatures.

    Functions that are called otherwise (from ``kkt.h``) have parameters of other types, and get none.
    """
    parts = ["/* Written when the library is compiled: see compiling.py. */\n", '#include "native.h"\n']
    headers = {header: header.read_text(encoding="utf-8") for header in sorted(FOLDER.rglob("*.h"))}
    structs = {name: body for text in headers.values() for body, name in _STRUCTS.findall(text)}
    kinds = _KINDS | {f"{name} *": ("S", "p") for name in structs}
    for name, body in structs.items():
        parts.append(f'API const char {name}_fields[] = "{_fields_text(body, kinds)}";\n')
    for header, text in headers.items():
        found = _DECLARED.findall(text)
        made = []
        for result, name, listed in found:
            arguments, signature = [], []
            for k, one in enumerate(filter(None, (part.strip() for part in listed.split(",")))):
                match = _PARAMETER.fullmatch(" ".join(one.split()))
                kind = kinds.get(match[1].strip()) if match else None
                if match is None or kind is None:
                    break
                signature.append(f"{match[2]} {kind[0]}")
                arguments.append(f"cells[{k}].{kind[1]}")
            else:
                call = f"{name}({', '.join(arguments)});"
                made.append(
                    f"API {result} {name}_cells(const cell *cells) "
                    f"{{ {'' if result == 'void' else 'return '}{call} }}\n"
                    f'API const char {name}_signature[] = "{_RESULTS[result]},{",".join(signature)}";\n'
                )
        if made:
            parts += [f'#include "{header.relative_to(FOLDER).as_posix()}"\n', *made]
    return "".join(parts)


def _fields_text(body: str, kinds: dict[str, tuple[str, str]]) -> str:
    """The fields of a structure and their kinds, for ``stc.core.structures``."""
    fields = []
    for declaration in re.sub(r"/\*.*?\*/", "", body, flags=re.DOTALL).split(";")[:-1]:
        base, names = declaration.replace("const ", "").split(maxsplit=1)
        for name in names.split(","):
            pointer = " *" if "*" in name else ""
            fields.append(f"{name.strip(' *')} {kinds[base + pointer][0]}")
    return ",".join(fields)


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


def _packaged_compiler(machine: Platform) -> list[str]:
    """The one of the package ``ziglang``."""
    return [sys.executable, "-m", "ziglang", "cc", *(["-target", machine.target] if machine.target else [])]


def _flags_of(kind: str, machine: Platform, packaged: bool) -> list[str]:
    """Of an instruction set: never those of the machine at hand, since the library may go to another one."""
    features = INSTRUCTIONS[kind]
    wide = ["-mprefer-vector-width=512"] if "avx512f" in features else []
    if not packaged:  # some are configured for a later processor than the plainest
        plainest = ["-march=x86-64"] if machine.x86 else []
        return [*plainest, *(f"-m{feature}" for feature in features), *wide]
    named = [*features, *(["evex512"] if wide else [])]
    return [f"-mcpu={'+'.join(['baseline', *named])}", *wide]


def compile_libraries(
    target: Path, scratch: Path, flags: list[str] | None = None, kinds: list[str] | None = None
) -> None:
    """Compile the sources of this folder, for this machine or the platform that :data:`WANTED` names.

    Parameters
    ----------
    target : the folder that the libraries go to.
    scratch : a folder for what is needed on the way; it is made.
    flags : further ones: sanitizers, for tests.
    kinds : the instruction sets; by default all that machines of this kind may have.

    Raises
    ------
    RuntimeError : there is no compiler, or it refuses a source.
    """
    wanted = wanted_platform()
    machine = PLATFORMS[wanted] if wanted else this_machine()
    own = None if wanted else own_compiler()
    compiler = own or _packaged_compiler(machine)
    scratch.mkdir(parents=True, exist_ok=True)
    entries = scratch / "entries.c"
    entries.write_text(entries_text(), encoding="utf-8")
    environment = {
        **os.environ,
        "ZIG_GLOBAL_CACHE_DIR": str(scratch / "zig"),
        "ZIG_LOCAL_CACHE_DIR": str(scratch / "zig"),
    }
    # Loops that copy or clear stay loops: most are for a few dozen bytes, where calling the C library takes longer.
    in_place = (
        ["-fno-builtin-memcpy", "-fno-builtin-memset"]
        if own is None
        else ["-fno-tree-loop-distribute-patterns"]
    )
    more = [*(["-DCORE_X86"] if machine.x86 else []), f"-I{FOLDER}"]
    headers = b"".join(path.read_bytes() for path in sources() if path.suffix == ".h")

    def run(command: list[str]) -> None:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        if done.returncode:
            raise RuntimeError(f"{shlex.join(command)} failed:\n{done.stderr}")

    def make(source: Path, options: list[str], made: Path) -> None:
        """Compile a file, unless that was done before with the same headers and options."""
        digest = hashlib.blake2b(f"{compiler} {options}".encode() + headers + source.read_bytes()).hexdigest()
        note = made.with_suffix(".made")
        if not (made.exists() and note.exists() and note.read_text() == digest):
            run([*compiler, *options, "-c", str(source), "-o", str(made)])
            note.write_text(digest)

    built: dict[str, list[str]] = {}
    jobs = []
    # The largest first, so that no processor is left with one of them at the end.
    files = sorted([*FOLDER.rglob("*.c"), entries], key=lambda path: -path.stat().st_size)
    for source in files:
        for kind in kinds or instructions(machine):
            made = scratch / f"{source.stem}_{kind}.o"
            built.setdefault(kind, []).append(str(made))
            arithmetic = f"-ffp-contract={'fast' if source.stem in CONTRACTED else 'off'}"
            options = [
                *FLAGS,
                *in_place,
                arithmetic,
                *_flags_of(kind, machine, own is None),
                *more,
                *(flags or []),
            ]
            if source.stem == "processor":
                options.append(f'-DCORE_SOURCES="{digest_of_sources()}"')
            jobs.append((source, options, made))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(make, *zip(*jobs, strict=True)))
    target.mkdir(parents=True, exist_ok=True)
    for kind, objects in built.items():
        linked = scratch / file_of(kind, machine)
        run(
            [
                *compiler,
                "-shared",
                *(flags or []),
                "-o",
                str(linked),
                *objects,
                "-lm",
                *(["-pthread"] if machine.suffix != "dll" else []),
                *(["-s"] if own is None else []),  # without names for debuggers, a twentieth of the size
            ]
        )
        fresh = target / f"{linked.name}.new"
        shutil.copyfile(linked, fresh)
        fresh.replace(target / linked.name)  # whoever has the old one loaded keeps it


if __name__ == "__main__":
    compile_libraries(FOLDER, FOLDER.parents[1] / "build" / "core")
