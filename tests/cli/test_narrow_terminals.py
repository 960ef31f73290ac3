"""Tables on terminals of every width: nothing that matters is cut off."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

import stc
from stc.certification import certify
from stc.validate.certificate import Certificate
from stc.validate.metrics import Metric


@pytest.fixture(scope="module")
def certificate() -> Certificate:
    return certify(stc.load("particle_jet").solve())


def shown(certificate: Certificate, width: int) -> list[str]:
    stream = io.StringIO()
    Console(file=stream, width=width, color_system=None, legacy_windows=False).print(certificate)
    return stream.getvalue().splitlines()


@pytest.mark.parametrize("width", [30, 40, 60, 80, 100, 120, 10_000])
def test_a_certificate_is_whole_whatever_the_width(certificate: Certificate, width: int) -> None:
    lines = shown(certificate, width)
    assert max(map(len, lines)) <= width
    assert "…" not in "".join(lines)
    text = "".join("".join(lines).split())
    verdicts = [word for line in lines for word in re.findall(r"\b(?:pass|fail|info)\b", line)]
    assert verdicts == [metric.verdict for metric in _in_order(certificate)]
    for name in {metric.name for metric in certificate.metrics}:
        assert "".join(name.split()) in text
    if width < 80:  # in a list, what a measurement is about is in one piece
        for metric in certificate.metrics:
            assert "".join(metric.subject.split()) in text
        assert "limit1e-04m" in text


def _in_order(certificate: Certificate) -> list[Metric]:
    from stc.validate.certificate.table import sections

    return [metric for section in sections(certificate.metrics) for metric in section.metrics]


def test_a_wide_certificate_is_a_table_with_a_line_for_each(certificate: Certificate) -> None:
    lines = shown(certificate, 10_000)
    (line,) = [line for line in lines if "inequality between frames" in line and "passed" not in line]
    cells = re.split(r"   +", line.strip())
    # As far before the middle and after it is as much; rounding tells which is the largest.
    cells[1], moment = cells[1].split(" at t = ")
    assert float(moment.removesuffix(" s")) in (
        pytest.approx(0.1889, abs=1e-3),
        pytest.approx(1.97, abs=1e-3),
    )
    assert cells == [
        "inequality between frames",
        *("particle_jet.stc:41:5: fx^2 + fy^2 <= fmax^2", "0.00238", "0.02", "pass"),
    ]
    assert any(
        line.split() == ["metric", "of", "value", "limit", "verdict"] for line in shown(certificate, 100)
    )


def on_screen(columns: int, words: Sequence[str], folder: Path) -> str:
    """What a command shows on a terminal of so many columns, without what colours and positions it."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    environment = {**os.environ, "TERM": "xterm", "NO_COLOR": "1"}
    environment.pop("COLUMNS", None)
    running = subprocess.Popen(
        [sys.executable, "-m", "stc", *words],
        cwd=folder,
        env=environment,
        stdin=theirs,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
    )
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 4096):
            seen += chunk
    except OSError:  # Linux says so where the other end is closed
        pass
    os.close(ours)
    assert running.wait(timeout=60) == 0
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen.decode()).replace("\r\n", "\n")


@pytest.mark.daily_every(2)
@pytest.mark.needs("terminal")
@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_tables_of_commands_lose_nothing(columns: int, tmp_path: Path) -> None:
    (tmp_path / "point.stc").write_text(
        "constants: n = 0, c = 1;\nvariables: x, y;\nconstraints: x + 2*y = 5*c;\nobjective: x^2 + y^2;\n"
    )
    compared = on_screen(columns, ["compare", "point.stc", "--optimizers", "sqp,nlopt:slsqp"], tmp_path)
    profiled = on_screen(columns, ["solve", "point.stc", "--profile"], tmp_path)
    checked = on_screen(columns, ["check", "point.stc"], tmp_path)
    walked = on_screen(columns, ["solve", "point.stc", "--continue", "c=1:2:1"], tmp_path)
    for text in (compared, profiled, checked, walked):
        assert "…" not in text
        lines = [line for line in text.splitlines() if not line.startswith("in all")]  # a plain sentence
        assert max(map(len, lines)) <= columns
    assert compared.count("optimal") >= 2
    for name in ("nlopt:slsqp", "violation", "optimality", "iterations", "evaluations", "seconds"):
        assert name in compared
    assert "times floor" in " ".join(profiled.split())
    assert "lower half" in " ".join(checked.split())
    assert walked.count("optimal") >= 3
