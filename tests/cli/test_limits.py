"""Limits and signals hold in every command, with every optimizer, in every phase.

Each case is a process of its own.  What is asked of it is the rule, half a second or a tenth of the limit, with an
allowance for a machine that has other things to do.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import stc

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's"),
    pytest.mark.slow,
]

#: Seconds that a busy machine may add to what the rule allows.
ALLOWANCE = 2.5

#: A particle whose every frame has a limit of its own; with many frames each phase of a solve takes long.
MOTION = """\
constants: n = 400000, T = 1, h = T/n, m = 1, g = 9.8;
variables: x, y, fx, fy;
constraints:
  [0, n]: m*x'' = fx; m*y'' = fy - m*g; fx^2 + fy^2 <= 900;
  [0]: x; y; x'; y';
  [n]: x = 1.5; y = 0.8; x'; y';
objective: [0, n]: integral(fx^2 + fy^2);
method: hermite-simpson;
replay:
  model = "particle.xml";
  joint x = x; joint z = y;
  actuator fx = fx; actuator fz = fy;
  set body.particle.mass = m;
  set option.gravity.z = -g;
"""

#: Without inequalities, for those that take equations only; never solved to the end within a second or two.
EQUATIONS = MOTION.replace(" fx^2 + fy^2 <= 900;", "").replace(
    "integral(fx^2 + fy^2)", "integral(fx^4 + fy^4)"
)

#: Puts a wait that nothing interrupts, as machine code is, into a phase: its start is told on standard error.  The time
#: limit, if one is given, counts from there, for a busy machine may take longer than any limit to get that far.
STUCK = """
import ctypes, importlib, sys, time
import stc.cli.main
module, owner, name, limit = sys.argv[1:5]
place = importlib.import_module(module)
place = getattr(place, owner) if owner else place
before = getattr(place, name)

def stuck(*given, **more):
    print("begins", file=sys.stderr, flush=True)
    if limit:
        stc.cli.main.guard.limit(float(limit), time.perf_counter())
    for _ in range(300):
        ctypes.CDLL(None).usleep(100_000)
    return before(*given, **more)

setattr(place, name, stuck)
sys.argv[1:] = sys.argv[5:]
stc.cli.main.main()
"""

#: Phases of a solve by a function that each goes through.
PHASES = {
    "parsing": ("stc.pipeline", "", "parse"),
    "stating": ("stc.solving.kept_transcriptions", "", "elaborate"),
    "deriving": ("stc.transcription.derive", "Group", "differentiate"),
    "compiling": ("stc.transcription.transcription", "", "compile_tapes"),
    "binding": ("stc.transcription.transcription", "", "evaluate_bounds"),
    "scaling": ("stc.solver.sqp", "", "ScaledProblem"),
    "analysing": ("stc.solver.sqp", "", "structured_kkt"),
    "evaluating": ("stc.transcription.bind", "BoundProgram", "derivatives"),
    "judging": ("stc.certification", "", "certify"),
}


def late(limit: float) -> float:
    """Seconds within which a command with this limit has to have ended."""
    return limit + max(0.5, 0.1 * limit) + ALLOWANCE


def stc_process(
    folder: Path, *words: str, stuck: tuple[str, str, str] | None = None, limit: str = ""
) -> subprocess.Popen[str]:
    (folder / "motion.stc").write_text(MOTION)
    (folder / "equations.stc").write_text(EQUATIONS)
    program = ["-m", "stc"] if stuck is None else ["-c", STUCK, *stuck, limit]
    # Looking for OpenGL, MuJoCo's import starts a process whose own words come late where this one ends meanwhile.
    environment = {**os.environ, "MUJOCO_GL": "off"}
    if stuck is not None and stuck in (PHASES["deriving"], PHASES["compiling"]):  # which is done but once
        environment["STC_CACHE_DIR"] = str(folder / "cache")
    return subprocess.Popen(
        [sys.executable, *program, *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(running: subprocess.Popen[str], limit: float) -> tuple[int, dict[str, object], str]:
    """Exit status, record and standard error of a command that ends in time."""
    try:
        out, err = running.communicate(timeout=late(limit))
    except subprocess.TimeoutExpired:
        running.kill()
        running.communicate()
        pytest.fail(f"still running {late(limit):.1f} s after its start, with a limit of {limit:g} s")
    assert "Traceback" not in err
    return running.returncode, json.loads(out.splitlines()[-1]), err


def until_stuck(running: subprocess.Popen[str]) -> None:
    """Wait until a command is in the phase that takes long."""
    assert running.stderr is not None
    while running.stderr.readline() != "begins\n":
        assert running.poll() is None


class TestTimeLimits:
    @pytest.mark.daily_every(4)
    @pytest.mark.parametrize(
        ("spec", "n", "optimizer"),
        [
            ("motion", 100_000, "sqp"),
            ("motion", 300, "nlopt:slsqp"),
            ("motion", 300, "nlopt:cobyla"),
            ("equations", 300, "nlopt:slsqp"),
            ("equations", 2000, "witkin-kass"),
            *(
                pytest.param("motion", n, optimizer, marks=pytest.mark.nightly)
                for n in (60, 1000)
                for optimizer in ("nlopt:auglag", "nlopt:mma", "nlopt:ccsaq", "nlopt:isres", "nlopt:cobyla")
            ),
            pytest.param("motion", 400_000, "sqp", marks=pytest.mark.nightly),
            pytest.param("equations", 20_000, "witkin-kass:printed", marks=pytest.mark.nightly),
        ],
    )
    def test_every_optimizer_ends(self, spec: str, n: int, optimizer: str, tmp_path: Path) -> None:
        words = ["solve", f"{spec}.stc", "--set", f"n={n}", "--optimizer", optimizer, "--time-limit", "1"]
        code, record, _ = ended(stc_process(tmp_path, *words, "--json", "-o", "a.npz"), 1.0)
        if record["status"] == "error":  # some take no equations, or bounded variables alone, and say so
            assert (code, optimizer in ("nlopt:mma", "nlopt:ccsaq", "nlopt:isres")) == (2, True)
            return
        assert (code, record["status"]) == (1, "time_limit")
        if record.get("file") is not None:  # a busy machine may not get as far as a guess
            assert stc.read(tmp_path / "a.npz").status == "time_limit"

    @pytest.mark.daily_every(2)
    @pytest.mark.parametrize(
        "words",
        [
            ["solve", "motion.stc", "--refine", "1e-14"],
            ["solve", "motion.stc", "--continue", "g=0:9.8:2000"],
            ["run", "motion.stc", "--until-verified", "1e-14", "--direct"],
            ["validate", "motion.stc", "--order"],
            ["compare", "motion.stc", "--optimizers", "nlopt:slsqp"],
            pytest.param(["solve", "motion.stc", "--starts", "5000"], marks=pytest.mark.nightly),
            pytest.param(["solve", "motion.stc", "--explain"], marks=pytest.mark.nightly),
            pytest.param(["solve", "motion.stc", "--profile"], marks=pytest.mark.nightly),
            pytest.param(["run", "motion.stc"], marks=pytest.mark.nightly),
            pytest.param(["validate", "motion.stc"], marks=pytest.mark.nightly),
            pytest.param(["validate", "motion.stc", "--robustness"], marks=pytest.mark.nightly),
        ],
        ids=lambda words: " ".join(words),
    )
    def test_every_command_ends(self, words: list[str], tmp_path: Path) -> None:
        frames = {"compare": 600}.get(words[0], 20_000)
        running = stc_process(tmp_path, *words, "--set", f"n={frames}", "--time-limit", "1", "--json")
        code, record, _ = ended(running, 1.0)
        assert code == 1
        if words[0] == "compare":
            runs: Any = record.get("optimizers", [])
            assert "time_limit" in {record["status"], *(run["status"] for run in runs)}

    @pytest.mark.daily_every(2)
    @pytest.mark.parametrize("phase", [phase for phase in PHASES if phase != "judging"])
    def test_every_phase_ends(self, phase: str, tmp_path: Path) -> None:
        words = ["solve", "motion.stc", "--set", "n=40", "--json", "-o", "a.npz"]
        running = stc_process(tmp_path, *words, stuck=PHASES[phase], limit="1")
        until_stuck(running)
        code, record, _ = ended(running, 1.0)
        assert (code, record["status"]) == (1, "time_limit")
        known = phase not in ("parsing", "stating", "deriving", "binding")  # else there is no guess yet
        assert (tmp_path / "a.npz").exists() == known
        if known:
            assert stc.read(tmp_path / "a.npz").status == "time_limit"

    def test_what_was_solved_is_kept_where_the_replay_takes_too_long(self, tmp_path: Path) -> None:
        words = ["run", "motion.stc", "--set", "n=40", "--json", "-o", "a.npz"]
        running = stc_process(tmp_path, *words, stuck=PHASES["judging"], limit="1")
        until_stuck(running)
        code, record, err = ended(running, 1.0)
        assert (code, record["status"], record["validation"]) == (1, "time_limit", None)
        assert "not validated" in err
        assert stc.read(tmp_path / "a.npz").status == "optimal"

    def test_in_python_the_limit_counts_from_the_call(self) -> None:
        model = stc.load(MOTION)
        begin = time.perf_counter()
        try:  # a solution where there is an iterate by then, else a message
            told = model.solve(time_limit=0.2).status
        except stc.StcError as error:
            told = str(error)
        assert "time_limit" in told or "time limit" in told
        assert time.perf_counter() - begin < 60.0  # it takes minutes


class TestSignals:
    @pytest.mark.daily_every(2)
    @pytest.mark.parametrize(
        ("phase", "name"),
        [
            *((phase, "SIGTERM") for phase in PHASES),
            *(
                pytest.param(phase, "SIGINT", marks=pytest.mark.nightly)
                for phase in PHASES
                if phase != "analysing"
            ),
            ("analysing", "SIGINT"),
        ],
    )
    def test_a_second_signal_ends_every_phase_at_once(self, phase: str, name: str, tmp_path: Path) -> None:
        number = getattr(signal, name)
        words = ["run", "motion.stc", "--set", "n=40", "--json", "-o", "a.npz"]
        running = stc_process(tmp_path, *words, stuck=PHASES[phase])
        until_stuck(running)
        running.send_signal(number)
        time.sleep(0.1)
        if running.poll() is None:
            running.send_signal(number)
        begin = time.perf_counter()
        running.communicate(timeout=30)
        assert time.perf_counter() - begin < 0.2 + ALLOWANCE  # the phase takes half a minute
        assert running.returncode in ((1,) if name == "SIGINT" else (128 + number, -number))
        assert not list(tmp_path.glob(".*"))  # no half a file

    @pytest.mark.daily_every(2)
    @pytest.mark.parametrize("optimizer", ["nlopt:slsqp", "nlopt:cobyla"])
    def test_the_first_signal_stops_nlopt_between_evaluations_too(
        self, optimizer: str, tmp_path: Path
    ) -> None:
        words = ["solve", "motion.stc", "--set", "n=600", "--optimizer", optimizer, "--json", "-o", "a.npz"]
        running = stc_process(tmp_path, *words)
        assert running.stderr is not None
        running.stderr.readline()  # the note that it will take long
        time.sleep(1.0)
        running.send_signal(signal.SIGTERM)
        code, record, _ = ended(running, 4.0)
        assert (code, record["status"]) == (143, "interrupted")
        assert stc.read(tmp_path / "a.npz").status == "interrupted"

    def test_the_first_signal_is_obeyed_where_the_solver_does_not_look(self, tmp_path: Path) -> None:
        words = ["solve", "motion.stc", "--set", "n=40", "--json", "-o", "a.npz"]
        running = stc_process(tmp_path, *words, stuck=PHASES["analysing"])
        until_stuck(running)
        running.send_signal(signal.SIGINT)
        code, record, _ = ended(running, 4.0)
        assert (code, record["status"], record["file"]) == (1, "interrupted", "a.npz")
        assert stc.read(tmp_path / "a.npz").status == "interrupted"


@pytest.mark.daily_every(2)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited so on Linux")
@pytest.mark.parametrize("kilobytes", [400_000, 800_000])
def test_too_little_memory_is_told_of(kilobytes: int, tmp_path: Path) -> None:
    (tmp_path / "motion.stc").write_text(MOTION)
    done = subprocess.run(
        ["sh", "-c", f'ulimit -v {kilobytes}; exec "$0" -m stc solve motion.stc --json', sys.executable],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, json.loads(done.stdout)["status"]) == (1, "failed")
    assert done.stderr == "stc: there is not enough memory for this: use fewer frames, samples or workers\n"
