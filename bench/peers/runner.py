"""Starts the measurements: fresh processes, one thread each, contenders in turn, several rounds."""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bench.peers import problems
from bench.peers.contenders import CONTENDERS, Contender, contender
from bench.peers.task import Case

ROOT = Path(__file__).resolve().parents[2]

#: What is solved; the last ones are compared per iteration, since the chains have many optima.
CASES = (
    Case("P1", 1000),
    Case("P1", 10_000),
    Case("P2", 50),
    Case("P2", 1000),
    Case("P2", 10_000),
    Case("P3", 50, 5),
    Case("P3", 1000, 5),
    Case("P3s", 50, 5),
    Case("P3s", 200, 5),
    Case("P4", 50, 2),
    Case("P4", 50, 10, max_iterations=1000),
    Case("P4", 50, 20, max_iterations=1000),
    Case("P5", 120),
    Case("P6", 120),
    Case("P7", 60, time_limit=900.0),
    Case("P8", 60, time_limit=900.0),
)

#: A process is ended after so many times its case's limit, and so many seconds to start and set up: tools look at their
#: own limit between iterations, and one iteration can take minutes.
LENIENCE, SETTING_UP = 1.2, 30.0

#: From process start to solution saved.
COLD_CASES = (Case("P2", 50), Case("P2", 1000), Case("P2", 10_000))

#: Who takes part in that; the numbers of the others from a notebook are no starts.
COLD_CONTENDERS = (
    "IPOPT, mapped",
    "IPOPT, expanded",
    "IPOPT, compiled",
    "fatrop, mapped",
    "fatrop, expanded",
)


@dataclass
class Measured:
    """What several processes of one contender on one case took.

    Attributes:
        cpu: seconds of processor time of each solve (of each whole process, if cold).
        wall: seconds on the clock.
        failure: why there is nothing, or no more.
    """

    contender: str
    case: Case
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    iterations: int = 0
    objective: float = float("nan")
    solved: bool = False
    status: str = ""
    note: str = ""
    failure: str = ""

    @property
    def least(self) -> float:
        """Smallest processor time."""
        return min(self.cpu, default=float("inf"))

    @property
    def median(self) -> float:
        """Of the processor times."""
        return statistics.median(self.cpu) if self.cpu else float("inf")

    @property
    def spread(self) -> float:
        """Distance between the quartiles, as a share of the median."""
        if len(self.cpu) < 4:
            return (max(self.cpu) - min(self.cpu)) / self.median if self.cpu else float("nan")
        low, _, high = statistics.quantiles(self.cpu, n=4)
        return (high - low) / self.median

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, saved: dict[str, Any]) -> Measured:
        """From :meth:`to_dict`."""
        return cls(**{**saved, "case": Case(**saved["case"])})


def merged(before: list[Measured], now: list[Measured]) -> list[Measured]:
    """Earlier measurements with those of later ones in their places, new ones at the end."""

    def key(one: Measured) -> tuple[str, str, int, int]:
        return one.contender, one.case.problem, one.case.n, one.case.rods

    newer = {key(one): one for one in now}
    cases = {name[1:]: one.case for name, one in newer.items()}
    kept = [newer.pop(key(one), one) for one in before]
    for one in kept:
        one.case = cases.get(key(one)[1:], one.case)  # limits may differ
    return kept + list(newer.values())


def environment(**more: str) -> dict[str, str]:
    """One thread everywhere, bytecode cached as Python does by default, and the repository importable."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "STC_THREADS")
    known = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**known, **dict.fromkeys(names, "1"), "PYTHONPATH": os.pathsep.join(paths), **more}


@dataclass(frozen=True, slots=True)
class Ended:
    """A process that has ended: its output and what it used, children included."""

    code: int
    output: str
    error: str
    cpu: float
    wall: float


def run(command: list[str], env: dict[str, str], limit: float) -> Ended:
    """Runs a command to its end, or kills it after ``limit`` seconds (exit code -9)."""
    with (
        tempfile.TemporaryDirectory() as folder,  # CasADi's compiler writes where it is
        tempfile.TemporaryFile("w+") as out,
        tempfile.TemporaryFile("w+") as err,
    ):
        begin = time.perf_counter()
        process = subprocess.Popen(command, env=env, stdout=out, stderr=err, cwd=folder)
        timer = threading.Timer(limit, process.kill)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begin
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        return Ended(process.returncode, out.read(), err.read(), usage.ru_utime + usage.ru_stime, wall)


def interpreter(one: Contender) -> str:
    """The Python that a contender runs in.

    That of this process, or, for a package that is not for it, the one that the environment variable
    BENCH_PYTHON_PACKAGE names, such as BENCH_PYTHON_SLEIPNIR; it has NumPy and that package, but not this project.
    """
    return os.environ.get(f"BENCH_PYTHON_{one.needs.upper()}", "") or sys.executable


def _has_package(one: Contender) -> bool:
    python = interpreter(one)
    if python == sys.executable:
        return not one.needs or find_spec(one.needs) is not None
    return run([python, "-c", f"import numpy, {one.needs}"], environment(), 60.0).code == 0


def available() -> tuple[list[Contender], list[str]]:
    """Who can take part here, and a line about each who cannot."""
    present, absent = [], []
    for one in CONTENDERS:
        if not _has_package(one):
            absent.append(f"{one.tool} is left out: its package is not installed here.")
        else:
            present.append(one)
    return present, list(dict.fromkeys(absent))


def _worker(name: str, case: Case, mode: str, *rest: str) -> list[str]:
    python = interpreter(contender(name))
    return [python, "-m", "bench.peers.worker", name, json.dumps(asdict(case)), mode, *rest]


def solve_only(
    cases: list[Case], present: list[Contender], rounds: int, say: Callable[[str], None]
) -> list[Measured]:
    """Repeated solves from the same guess, everything set up before; interleaved over ``rounds``."""
    found: dict[tuple[str, Case], Measured] = {}
    for number in range(rounds):
        for case in cases:
            for one in present:
                if case.n > one.sizes.get(case.problem, 0):
                    continue
                known = found.setdefault((one.name, case), Measured(one.name, case))
                if known.failure:
                    continue
                ended = run(_worker(one.name, case, "solve"), environment(), _most(case))
                _record(known, ended)
                say(f"round {number + 1}: {case.label}, n = {case.n}, {one.name}: {_told(known)}")
    return list(found.values())


def _record(known: Measured, ended: Ended) -> None:
    if ended.code:
        known.failure = _failure(known.case, ended)
        return
    told = json.loads(ended.output.splitlines()[-1])
    if not told["solved"] and max(told["cpu"]) >= known.case.time_limit:
        known.failure = _unanswered(known.case)
    again = slice(1, None) if len(told["cpu"]) > 1 else slice(None)  # the first solve warms caches up
    known.cpu += told["cpu"][again]
    known.wall += told["wall"][again]
    for name in ("iterations", "objective", "solved", "status", "note"):
        setattr(known, name, told[name])


def _most(case: Case) -> float:
    """Seconds after which a process is ended."""
    return LENIENCE * case.time_limit + SETTING_UP


def _failure(case: Case, ended: Ended) -> str:
    """Why a process has no result."""
    if ended.code == -9:
        return _unanswered(case)
    lines = ended.error.strip().splitlines()
    return (lines[-1] if lines else "failed")[:200]


def _unanswered(case: Case) -> str:
    return f"no answer in {case.time_limit:g} s"


def _told(known: Measured) -> str:
    if known.failure:
        return known.failure
    return f"{1e3 * known.least:.3g} ms, {known.iterations} iterations, {known.objective:.9g} {known.status}"


def cold(
    cases: list[Case], present: list[Contender], rounds: int, say: Callable[[str], None]
) -> list[Measured]:
    """Whole processes, from their start to the solution saved."""
    names = {one.name for one in present}
    found: dict[tuple[str, Case], Measured] = {}
    with tempfile.TemporaryDirectory() as folder:
        starts = _starts(Path(folder))
        for number in range(
            -1, rounds
        ):  # the first round leaves bytecode and files in memory, and is not counted
            for case in cases:
                for name, start in starts:
                    _one_cold(found, name, case, lambda s=start, c=case: s(c), number, say)
                for name in COLD_CONTENDERS:
                    if name in names:
                        file = str(Path(folder) / "peer.npz")
                        command = _worker(name, case, "cold", file)
                        _one_cold(found, name, case, lambda c=command: (c, environment()), number, say)
    return list(found.values())


def _one_cold(
    found: dict[tuple[str, Case], Measured],
    name: str,
    case: Case,
    start: Callable[[], tuple[list[str], dict[str, str]]],
    number: int,
    say: Callable[[str], None],
) -> None:
    known = found.setdefault((name, case), Measured(name, case))
    if known.failure:
        return
    ended = run(*start(), _most(case))
    if ended.code:
        known.failure = _failure(case, ended)
    elif number >= 0:
        known.cpu.append(ended.cpu)
        known.wall.append(ended.wall)
        say(f"cold {number + 1}: {case.label}, n = {case.n}, {name}: {ended.cpu:.3f} s of processor time")


def _starts(folder: Path) -> list[tuple[str, Callable[[Case], tuple[list[str], dict[str, str]]]]]:
    """Our own ways to start: on a machine that has never run it, on a spec never seen, and again."""
    caches = {name: folder / name for name in ("first", "solver", "new", "again")}
    spec = folder / "spec.stc"
    other = folder / "other.stc"
    other.write_text(problems.spec_of("P2", 0).replace("u^2", "u^2 + q1^2"), encoding="utf-8")
    file = str(folder / "ours.npz")

    def command(path: Path, case: Case) -> list[str]:
        return [sys.executable, "-m", "stc", "solve", str(path), "--set", f"n={case.n}", "-o", file]

    def prepared(kind: str) -> Callable[[Case], tuple[list[str], dict[str, str]]]:
        def start(case: Case) -> tuple[list[str], dict[str, str]]:
            spec.write_text(problems.spec_of(case.problem, case.rods), encoding="utf-8")
            if kind != "again":
                shutil.rmtree(caches[kind], ignore_errors=True)
            if kind == "new":
                if not caches["solver"].exists():  # the solver's own code, from a problem of the same kind
                    run(command(other, case), environment(STC_CACHE_DIR=str(caches["solver"])), 300.0)
                shutil.copytree(caches["solver"], caches["new"])
            return command(spec, case), environment(STC_CACHE_DIR=str(caches[kind]))

        return start

    def python(case: Case) -> tuple[list[str], dict[str, str]]:
        return _worker("stc", case, "cold", file), environment(STC_CACHE_DIR=str(caches["again"]))

    return [
        ("stc solve, first time on the machine", prepared("first")),
        ("stc solve, a new spec", prepared("new")),
        ("stc solve, again", prepared("again")),
        ("stc from Python, again", python),
    ]
