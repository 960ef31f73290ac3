"""What each part of stc that stands in for a library's saves of the first solve of a process.

The guideline of the project is that such a part stays only where it saves at least 10 ms.  Every case runs whole
commands ``stc solve SPEC`` in turn, as they are and with one part replaced by the library's, and compares the
processor time of each pair: other work on the machine disturbs this less than it does times on the clock.

    python bench/cold_start.py [SPEC] [--rounds 21]
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

#: What is run before the command line's own code, by the name of the part that it replaces.
REPLACEMENTS = {
    "as it is": "",
    "as it is, again": "",
    "records: dataclasses of the standard library": "import dataclasses; sys.modules['stc.records'] = dataclasses",
    "cli/plain: every command line through typer": (
        "import types, stc.cli; stc.cli.plain = sys.modules['stc.cli.plain'] = types.ModuleType('stc.cli.plain');"
        "stc.cli.plain.read = lambda words: None"
    ),
    "codegen/engine: llvmlite imported and its target started, no more": (
        "import llvmlite.binding as llvm; llvm.initialize_native_target(); llvm.initialize_native_asmprinter();"
        "llvm.Target.from_default_triple().create_target_machine()"
    ),
}


def seconds(first: str, spec: str, folder: Path) -> float:
    """Processor time of one ``stc solve`` that runs the statements ``first`` before it."""
    program = f"import sys\n{first}\nfrom stc.cli.main import main\nmain()"
    # Sources are compiled to bytecode once, as an installation does it.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    with (folder / "output").open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-c", program, "solve", spec, "-o", str(folder / "a.npz")],
            env={**environment, "STC_CACHE_DIR": str(folder / "cache")},
            stdout=output,
            stderr=output,
        )
        _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit((folder / "output").read_text())
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("spec", nargs="?", default="cart_pole_swing_up")
    parser.add_argument("--rounds", type=int, default=21)
    options = parser.parse_args()
    times: dict[str, list[float]] = {name: [] for name in REPLACEMENTS}
    with tempfile.TemporaryDirectory() as folder:
        for first in REPLACEMENTS.values():
            seconds(first, options.spec, Path(folder))
        for _ in range(options.rounds):
            for name, first in REPLACEMENTS.items():
                times[name].append(1e3 * seconds(first, options.spec, Path(folder)))
    print(f"{options.spec}: milliseconds of processor time of a whole `stc solve`, {options.rounds} rounds")
    print(f"{'replaced':66} {'median':>8} {'saved':>8} {'quartiles':>16}")
    for name, values in times.items():
        saved = [value - base for value, base in zip(values, times["as it is"], strict=True)]
        low, middle, high = statistics.quantiles(saved, n=4)
        print(f"{name:66} {statistics.median(values):8.1f} {middle:8.1f} {low:8.1f}{high:8.1f}")


if __name__ == "__main__":
    main()
