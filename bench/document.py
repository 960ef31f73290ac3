"""The parts of pages that measurements write, between a pair of comments each: docs/benchmarks.md and others."""

from __future__ import annotations

import os
import platform
import re
from datetime import date
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "benchmarks.md"


def put(part: str, text: str, page: Path = PAGE) -> None:
    """Replaces the text between ``<!-- PART -->`` and ``<!-- end of PART -->``.

    Raises:
        ValueError: the page has no such part.
    """
    before = page.read_text(encoding="utf-8")
    begin, end = f"<!-- {part} -->", f"<!-- end of {part} -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    after, count = pattern.subn(lambda _: f"{begin}\n\n{text.strip()}\n\n{end}", before)
    if count != 1:
        raise ValueError(f"{page} has no part {part!r}")
    page.write_text(after, encoding="utf-8")


def machine() -> str:
    """One line: processor, cores, system, Python, date, and how busy the machine was."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        found = re.search(r"model name\s*:\s*(.*)", info.read_text(encoding="utf-8"))
        name = found.group(1) if found else name
    try:
        import llvmlite.binding as llvm

        name = f"{name} ({llvm.get_host_cpu_name()})"
    except ImportError:
        pass
    busy = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, "
        f"{date.today().isoformat()}{busy}"
    )
