"""Carries out cases of the fuzzer, one after another, in this process, and tells what is wrong with each.

Numbers of cases come in lines on standard input; for each a line of JSON goes out where standard output was. Whatever
the command prints, by Python or not, goes to files.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import sys
import tempfile
import traceback
import warnings
import zipfile
from pathlib import Path

from fuzz.cases import CORPUS, Case, Corpus, case
from stc.cli.main import run
from stc.terminal_text import visible

#: Statuses that a command may end with.
STATUSES = (0, 1, 2)


def carry_out(given: Case, folder: Path) -> list[str]:
    """What is wrong with how the command line treats a case, in an empty folder."""
    for name, content in given.files.items():
        (folder / name).write_bytes(content)
    home = Path.cwd()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        kept = os.dup(1), os.dup(2)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        streams = sys.stdout, sys.stderr
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        os.chdir(folder)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("always", RuntimeWarning)
                status: object = run(given.words)
            sys.stdout.flush()
            sys.stderr.flush()
        except BaseException:
            status = traceback.format_exc()
        finally:
            os.chdir(home)
            sys.stdout, sys.stderr = streams
            for number, stream in enumerate(kept, start=1):
                os.dup2(stream, number)
                os.close(stream)
        out.seek(0)
        err.seek(0)
        printed, told = out.read().decode("utf-8", "replace"), err.read().decode("utf-8", "replace")
    return [*_wrong_words(given, status, printed, told), *_wrong_files(given, folder)]


def _wrong_words(given: Case, status: object, printed: str, told: str) -> list[str]:
    found = []
    if status not in STATUSES:
        found.append(f"exit status {status}")
    both = printed + told
    for sign in ("Traceback", "stc itself failed", "Warning", "encountered in "):
        if sign in both:
            line = next(line for line in both.splitlines() if sign in line)
            found.append(f"{sign}: {line[:300]}")
    if visible(both) != both:
        found.append("control characters reach the terminal")
    if "--json" in given.words:
        last = printed.rstrip("\n").rpartition("\n")[2]
        try:
            sound = isinstance(json.loads(last, parse_constant=lambda word: 1 / 0), dict)
        except (ValueError, ZeroDivisionError):
            sound = False
        if not sound and "--help" not in given.words and "-h" not in given.words:
            found.append(f"no JSON object: {last[:200]}")
    return found


def _wrong_files(given: Case, folder: Path) -> list[str]:
    found = []
    for name, content in given.files.items():
        file = folder / name
        if not file.is_file():
            found.append(f"{name} is lost")
        elif file.read_bytes() != content:
            if name != given.output:
                found.append(f"{name} was changed")
            elif not _is_whole(file):
                found.append(f"{name} is no whole file")
    found += [f"left behind: {path.name}" for path in folder.rglob(".*") if ".tmp" in path.name]
    if (folder.parent / "escape.npy").exists():
        found.append("a file outside of the folder")
    return found


def _is_whole(file: Path) -> bool:
    try:
        with zipfile.ZipFile(file) as archive:
            return archive.testzip() is None
    except (OSError, zipfile.BadZipFile):
        return False


def main() -> None:
    """Answer numbers of cases until there are no more."""
    seed, prepared, memory = int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    import resource

    answers = os.fdopen(os.dup(1), "w")
    given: Corpus = pickle.loads((prepared.parent / CORPUS).read_bytes())
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    answers.write('"ready"\n')
    answers.flush()
    for line in sys.stdin:
        folder = Path(tempfile.mkdtemp(dir=prepared))
        try:
            found = carry_out(case(seed, int(line), given), folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        answers.write(json.dumps(found) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
