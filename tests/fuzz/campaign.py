"""Runs many cases of the fuzzer in processes that are kept alive, and writes down those that go wrong.

    cd tests && python -m fuzz.campaign --cases 5000 --seed 7 --findings folder

A case that takes too long, or ends its process, is wrong as well: the process is replaced.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fuzz.cases import CORPUS, Corpus, case, corpus

#: Seconds and bytes of address space that a case may take.
TIME, MEMORY = 60.0, 6 << 30

#: Seconds for a process to be ready.
START = 300.0

#: A process is replaced after so many cases: what piles up in it is not what is looked for.
CASES_EACH = 400


@dataclass(frozen=True)
class Finding:
    """A case that went wrong: its number, and how."""

    number: int
    wrong: tuple[str, ...]


class _Worker:
    def __init__(self, seed: int, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "fuzz.worker", str(seed), str(folder), str(MEMORY)]
        here = Path(__file__).parents[1]
        self.errors = (folder / "errors").open("w+b")
        environment = {**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            command,
            cwd=here,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            env=environment,
            text=True,
        )
        self.done = 0
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        if self._answer(START) is None:
            self.end()
            raise RuntimeError(f"the fuzzer's process does not start; see {folder / 'errors'}")

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put("")

    def _answer(self, seconds: float) -> str | None:
        try:
            return self._lines.get(timeout=seconds) or None
        except queue.Empty:
            return None

    def carry_out(self, number: int) -> list[str] | None:
        """What is wrong with a case; None where the process did not live to tell."""
        assert self.process.stdin is not None
        self.done += 1
        try:
            self.process.stdin.write(f"{number}\n")
            self.process.stdin.flush()
        except OSError:
            return None
        answer = self._answer(TIME)
        return None if answer is None else json.loads(answer)

    def end(self) -> str:
        """End the process; how it had ended by itself, if it had."""
        try:
            status = self.process.wait(timeout=1.0)
            how = f"the process ended with status {status}"
        except subprocess.TimeoutExpired:
            how = f"more than {TIME:g} s"
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout, self.errors):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        return how


def campaign(
    seed: int, numbers: Iterable[int], folder: Path, findings: Path, processes: int = 2
) -> list[Finding]:
    """Carry out cases by their numbers; those that went wrong, in order.

    Args:
        seed: of the cases.
        numbers: which of them.
        folder: for what the processes write.
        findings: where every case that goes wrong is written, as soon as it has.
        processes: how many at a time.
    """
    folder.mkdir(parents=True, exist_ok=True)
    given = corpus(folder)
    (folder / CORPUS).write_bytes(pickle.dumps(given))
    waiting: queue.Queue[int] = queue.Queue()
    for number in numbers:
        waiting.put(number)
    found: list[Finding] = []
    failures: list[BaseException] = []

    def work(place: Path) -> None:
        worker: _Worker | None = None
        try:
            while not failures:
                try:
                    number = waiting.get_nowait()
                except queue.Empty:
                    break
                if worker is None:
                    worker = _Worker(seed, place)
                wrong = worker.carry_out(number)
                if wrong is None:
                    wrong = [worker.end()]
                    worker = None
                elif worker.done >= CASES_EACH:
                    worker.end()
                    worker = None
                if wrong:
                    found.append(Finding(number, tuple(wrong)))
                    write_down(found[-1], seed, findings, given)
                    print(f"seed {seed} case {number}: {'; '.join(wrong)}", flush=True)
        except BaseException as error:
            failures.append(error)
        finally:
            if worker is not None:
                worker.end()

    threads = [threading.Thread(target=work, args=(folder / str(k),)) for k in range(processes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]
    return sorted(found, key=lambda finding: finding.number)


def write_down(finding: Finding, seed: int, folder: Path, given: Corpus) -> None:
    """Put the files of a finding into a folder of its own, with the command and what went wrong."""
    one = case(seed, finding.number, given)
    place = folder / f"{seed}-{finding.number}"
    place.mkdir(parents=True, exist_ok=True)
    for name, content in one.files.items():
        (place / name).write_bytes(content)
    facts = {"kind": one.kind, "words": one.words, "wrong": finding.wrong}
    (place / "case.json").write_text(json.dumps(facts, indent=2), encoding="utf-8")


def main() -> int:
    """The command line; 1 where anything went wrong."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cases", type=int, default=5000)
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--seed", type=int, default=int(time.time()))
    options.add_argument("--processes", type=int, default=2)
    options.add_argument("--findings", type=Path, default=Path("out") / "fuzz")
    given = options.parse_args()
    print(f"seed {given.seed}: {given.cases} cases from {given.first}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        numbers = range(given.first, given.first + given.cases)
        findings = campaign(given.seed, numbers, Path(folder), given.findings.absolute(), given.processes)
        print(f"{given.cases} cases in {time.monotonic() - begun:.0f} s, {len(findings)} went wrong")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
