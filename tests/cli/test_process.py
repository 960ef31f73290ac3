"""What only a process of its own shows: imports, interruption, closed pipes, ``python -m stc``."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

import stc
from stc.cli.main import run
from stc.core import library

# A solve that never ends by itself, whatever the solver does with it: every iteration is slow on purpose.
SLOW = """
import sys, time
from stc.cli.main import run
from stc.pipeline import Model

solve = Model.solve

def slow(self, *, callback, **options):
    def wait(iterate):
        print(iterate.iteration, file=sys.stderr, flush=True)
        time.sleep(0.3)  # whoever has read that finds the solve busy, not about to end
        return callback(iterate)
    return solve(self, callback=wait, **options)

Model.solve = slow
sys.exit(run(sys.argv[1:]))
"""

SPEC = """\
constants: n = 0;
variables: x, y;
guess: x = -1.2; y = 1;
objective: 100*(y - x^2)^2 + (1 - x)^2;
"""


#: What a solve does without: whole libraries, and parts of Python's own that take time to import.
HEAVY = [
    "mujoco",
    "scipy",
    "nlopt",
    "trimesh",
    "rich",
    "typer",
    "llvmlite",
    "tempfile",
    "csv",
]


def process(*words: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=60, **options)  # type: ignore[call-overload]


def test_python_m_stc_is_the_command() -> None:
    done = process("-m", "stc", "--version")
    assert (done.returncode, done.stdout) == (0, f"stc {stc.__version__}\n")


def test_the_command_works_from_any_folder(tmp_path: Path) -> None:
    done = process("-m", "stc", "list", cwd=tmp_path)
    assert done.returncode == 0
    assert "particle_waypoints" in done.stdout


def test_import_is_light() -> None:
    done = process("-c", "import stc, sys; print(*sorted(m for m in sys.modules if m.startswith('stc')))")
    assert done.stdout.split() == ["stc", "stc.version"]


#: Prints how many threads there are when the command line of a process has ended, and how many were wanted.
THREADS = """
import atexit, os, sys
import stc.cli.main
atexit.register(lambda: print(len(os.listdir("/proc/self/task")), os.environ["OPENBLAS_NUM_THREADS"]))
stc.cli.main.main()
"""


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are counted where Linux lists them")
def test_a_command_starts_no_threads_for_products_of_matrices() -> None:
    """Unless somebody asks for them: to start one takes as long as a short solve."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in names}
    environment["STC_THREADS"] = "1"
    done = process("-c", THREADS, "check", "particle_jet", env=environment)
    assert done.stdout.splitlines()[-1] == "2 1"  # with the one that hears signals
    done = process("-c", THREADS, "check", "particle_jet", env={**environment, "OPENBLAS_NUM_THREADS": "2"})
    assert done.stdout.splitlines()[-1].endswith(" 2")


def test_solving_imports_nothing_heavy(tmp_path: Path) -> None:
    (tmp_path / "point.stc").write_text("constants: n = 0; variables: x; objective: (x - 1)^2;")
    code = (
        "import sys; from stc.cli.main import run; assert run(['solve', 'point.stc', '--json']) == 0;"
        f"print(*(m for m in {HEAVY} if m in sys.modules))"
    )
    environment = {**os.environ, "STC_CACHE_DIR": str(tmp_path / "cache")}
    first, again = (process("-c", code, cwd=tmp_path, env=environment) for _ in range(2))
    for done in (first, again):
        assert done.returncode == 0, done.stderr
    assert set(first.stdout.splitlines()[1].split()) <= {"llvmlite", "tempfile", "zipfile"}
    # What is compiled is found again without the compiler.
    linked = sys.platform != "linux" or library.instructions() == "baseline"
    assert linked or again.stdout.splitlines()[1:] == [""]


def test_a_reader_that_leaves_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "stc", "list"], stdout=write, stderr=subprocess.PIPE, text=True, timeout=60
    )
    os.close(write)
    assert done.stderr == ""


def test_a_closed_standard_output_loses_words_only(tmp_path: Path) -> None:
    (tmp_path / "banana.stc").write_text(SPEC)
    for words in ("solve banana.stc", "solve banana.stc --json", "check banana.stc"):
        done = subprocess.run(
            ["sh", "-c", f'exec "$0" -m stc {words} >&-', sys.executable],
            cwd=tmp_path,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
        assert (done.returncode, done.stderr) == (0, "")
    assert stc.read(tmp_path / "banana.npz").status == "optimal"


def test_a_spec_comes_through_a_pipe(tmp_path: Path) -> None:
    """``stc solve <(make_spec)``, as shells hand it over."""
    os.mkfifo(tmp_path / "banana.stc")
    with subprocess.Popen(
        [sys.executable, "-m", "stc", "check", "banana.stc"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as running:
        descriptor = -1
        while descriptor < 0 and running.poll() is None:
            with suppress(OSError):  # until somebody reads
                descriptor = os.open(tmp_path / "banana.stc", os.O_WRONLY | os.O_NONBLOCK)
            time.sleep(0.01)
        if descriptor >= 0:
            os.write(descriptor, SPEC.encode())
            os.close(descriptor)
        out, _ = running.communicate(timeout=60)
    assert (running.returncode, out.splitlines()[0]) == (0, "banana, central, n = 0: no mistakes")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_standard_output_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "banana.stc").write_text(SPEC)
    for words in (("list",), ("list", "--json"), ("solve", "banana.stc", "--json")):
        with Path("/dev/full").open("w") as full:
            done = subprocess.run(
                [sys.executable, "-m", "stc", *words],
                cwd=tmp_path,
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
                timeout=60,
            )
        assert (done.returncode, done.stderr) == (2, "stc: No space left on device\n")
    assert stc.read(tmp_path / "banana.npz").status == "optimal"


class TestInterruption:
    def start(self, folder: Path, *words: str, stderr: int = subprocess.PIPE) -> subprocess.Popen[str]:
        (folder / "banana.stc").write_text(SPEC)
        return subprocess.Popen(
            [sys.executable, "-c", SLOW, "solve", "banana.stc", *words],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
        )

    def test_ctrl_c_saves_the_best_iterate(self, tmp_path: Path) -> None:
        running = self.start(tmp_path, "--json")
        assert running.stderr is not None
        running.stderr.readline()  # the first iteration is over
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
        record = json.loads(out.splitlines()[-1])
        assert (running.returncode, record["status"]) == (1, "interrupted")
        assert "Traceback" not in err
        assert stc.read(tmp_path / "banana.npz").status == "interrupted"

    def test_ctrl_c_ends_a_study(self, tmp_path: Path) -> None:
        words = [sys.executable, "-c", SLOW, "validate", "arm_reach", "--order", "--json"]
        running = subprocess.Popen(
            words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert running.stderr is not None
        running.stderr.readline()
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
        assert (running.returncode, json.loads(out)["status"]) == (1, "interrupted")
        assert err.endswith("stc: interrupted\n")

    def test_ctrl_c_outside_a_solve_is_told_of_by_every_command(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def interrupted(**_: object) -> int:
            raise KeyboardInterrupt

        # The parser of options catches it on its way.
        monkeypatch.setattr("stc.cli.jobs.list_specs", interrupted)
        assert run(["list", "--json"]) == 1
        out, err = capsys.readouterr()
        assert (json.loads(out)["status"], err) == ("interrupted", "stc: interrupted\n")

    @pytest.mark.needs("terminal")
    def test_the_live_line_shows_on_a_terminal_only(self, tmp_path: Path) -> None:
        ours, theirs = pty.openpty()
        running = self.start(tmp_path, stderr=theirs)
        os.close(theirs)
        seen = b""
        while b"violation" not in seen:
            seen += os.read(ours, 4096)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=60)
        os.close(ours)
        assert b"objective" in seen
        assert b"step" in seen

        quiet = self.start(tmp_path, "--max-iterations", "3")
        _, err = quiet.communicate(timeout=60)
        assert "violation" not in err


def test_plain_cells_show_what_rich_shows() -> None:
    from rich.markup import render

    from stc.cli import console

    for text in ("x[0]", "[bold]a[/]", "a\\[b]", "[0, n]: x", "[n]: q = 1", "/tmp/[x]/y.npz", "q\\\\[a]z"):
        escaped = console.escape(text)
        assert render(escaped, emoji=False).plain == console._unmarked(escaped) == text
    marked = "[bold red]failed[/bold red] in [green]3[/]"
    assert render(marked).plain == console._unmarked(marked)


def test_only_the_called_command_is_set_up() -> None:
    from stc.cli.app import app, app_for

    assert [command.name for command in app_for(["list"]).registered_commands] == ["list"]
    assert app_for(["--help"]) is app_for([]) is app_for(["slove"]) is app
    assert len(app.registered_commands) > 5
