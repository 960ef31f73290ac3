"""Solution files: the layout of a :class:`stc.solution.Solution` on disk.  See docs/solution_files.md.

``.npz``
    A NumPy archive without pickled objects and without compression.  The member ``facts`` is JSON in UTF-8: the
    inputs (the spec's text, the constants, the method, the hashes of the model's files) and the stated results
    (status, objective, and so on).  Every unknown is stored once:

    ==============================  =====  =============================================================================
    ``unknowns/x'``                 (n+1,) an unknown at the frames, as the step to the left sees it
    ``unknowns/x'/mid``             (n,)   ... at the midpoints, hermite-simpson only
    ``unknowns/x'/after``           (j,)   ... as the step to the right sees it, at the frames that ``facts`` lists
    ``parameters``                  (p,)   unknowns with one value, in the order of ``facts``
    ``multipliers/0`` (...)         (k,)   of one statement, link or bound of ``facts``, in order of time
    ``files/0`` (...)               bytes  what is carried of the model
    ==============================  =====  =============================================================================

    Times, derivatives that are differences, and what a replay needs follow from these and the text:
    :mod:`stc.solution_restated` evaluates them.

``.csv``
    The same as text.  Lines starting with ``#`` hold the facts, and all other values as JSON; below them is
    one table with a row per node in order of time, whose number is ``rows`` in the facts; each ends with its line.  Its
    columns are ``node`` (``frame``, ``before``, ``after`` or ``mid``; a frame where anything jumps has a row for either
    side) and the unknowns by their names.  Numbers keep all their digits.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NoReturn

import numpy as np

from stc import npz
from stc.arguments import path as file_path
from stc.atomic import replacing
from stc.errors import SolutionError, UsageError
from stc.recorded_files import DATA_ROLE, RecordedFile, record
from stc.solution_content import FORMAT, Stored, check_facts

if TYPE_CHECKING:
    from stc.solution import Solution

#: What a file tells of a solution in so many words and numbers, under the names of the attributes.
PLAIN_FACTS = (
    "name",
    "source",
    "directory",
    "constants",
    "overrides",
    "method",
    "status",
    "message",
    "objective",
    "violation",
    "optimality",
    "iterations",
    "factorizations",
    "optimizer",
    "seconds",
    "sha256",
    "stc_version",
)


def write(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write a solution; see :meth:`stc.solution.Solution.save`."""
    target = Path(file_path(path, "the file of a solution"))
    writer: Callable[[Stored, IO[bytes]], None] = _write_npz
    if target.suffix.lower() == ".csv":
        from stc.solution_csv import write_csv

        writer = write_csv
    elif target.suffix.lower() != ".npz":
        raise UsageError(f"cannot tell the format of {target.name!r}: a solution file ends in .npz or .csv")
    if solution.origin is None:
        # By name: nothing here is imported from the layers above.
        import_module("stc.solution_restated").require_stated(solution)
    stored = stored_of(solution)
    with replacing(target) as temporary, temporary.open("wb") as stream:
        writer(stored, stream)


def load(path: str | os.PathLike[str]) -> Stored:
    """The content of a solution file.

    Raises:
        UsageError: no such file, or a suffix other than ``.npz`` and ``.csv``.
        SolutionError: the file is damaged, is something else, or comes from a newer version.
    """
    import zipfile
    import zlib

    from stc.solution_csv import read_csv

    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"a solution is read from a path, not from {path!r}")
    source = Path(path)
    readers: dict[str, Callable[[Path], Stored]] = {".npz": _read_npz, ".csv": read_csv}
    reader = readers.get(source.suffix.lower())
    if reader is None:
        raise UsageError(f"cannot tell the format of {source.name!r}: a solution file ends in .npz or .csv")
    if not source.is_file():
        raise UsageError(f"there is no solution file {source}")
    try:
        return reader(source)
    except SolutionError as error:
        if contents(source) == "table":
            raise SolutionError(
                f"{source} is a table, as `stc export` writes it, and no saved solution\n"
                f"  `stc solve SPEC --guess-from {source}` starts a solve from it"
            ) from None
        raise SolutionError(f"{source}: {error}") from None
    except npz.ContentsError as error:
        raise SolutionError(f"{source} is not a solution file as stc writes it: {error}") from None
    except PermissionError:
        raise UsageError(f"{source} may not be read") from None
    except (
        zipfile.BadZipFile,
        zlib.error,
        OSError,
        EOFError,
        NotImplementedError,
        RuntimeError,
        *MISSHAPEN,
    ) as error:
        raise damaged(source) from error


#: What it takes for the contents of a file to be other than they should be, as Python notices it.
MISSHAPEN = (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, RecursionError)


def damaged(source: str | os.PathLike[str]) -> SolutionError:
    """The error for a file that cannot be read."""
    return SolutionError(f"{source} is damaged: it was cut off or altered, or is not a solution file")


def contents(path: str | os.PathLike[str]) -> str:
    """The kind of a file with the suffix of a solution: ``solution``, ``table`` (as exported) or "" for anything else.

    No exception is raised; an unreadable file is "".
    """
    import zipfile

    source = Path(path)
    try:
        if source.suffix.lower() == ".csv":
            with source.open(encoding="utf-8-sig") as stream:
                first = stream.readline(8)
                if first != "# facts ":
                    first += stream.readline(8)
            return "solution" if first.startswith("# facts") else "table" if first.startswith("time,") else ""
        with zipfile.ZipFile(source) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
    except (OSError, ValueError, zipfile.BadZipFile):
        return ""
    if "facts" in names:
        return "solution"
    is_table = "time" in names and "ctrl" not in names  # with ``ctrl`` it is a control sequence
    return "table" if is_table else ""


def refuse_as_spec(path: Path) -> NoReturn:
    """Raise an error for a data file that was named in place of a spec; the hint names its possible uses.

    Raises:
        UsageError: always.
    """
    import shlex

    found, word = contents(path), shlex.quote(str(path))
    if found == "solution":
        raise UsageError(
            f"{path} is a saved solution, not a spec",
            f"`stc validate {word}` judges it; `stc solve SPEC --warm-start {word}` solves on from it",
        )
    raise UsageError(
        f"{path} is {'a table of numbers' if found else 'a data file'}, not a spec",
        f"`stc solve SPEC --guess-from {word}` starts a solve from the numbers of a table",
    )


# --- a solution's facts and arrays ---------------------------------------------------------------------------


def stored_of(solution: Solution) -> Stored:
    """The stored content of a solution: its unknowns, its multipliers, its inputs, its stated results."""
    facts: dict[str, Any] = {"kind": "stc solution", "format": FORMAT, "trials": [""], "n": solution.n}
    for key in PLAIN_FACTS:
        value = getattr(solution, key)
        facts[key] = dict(value) if isinstance(value, Mapping) else value
    members: dict[str, np.ndarray] = {}
    unknowns = []
    for variable, order in solution.unknowns:
        channel = solution.trajectories[variable, order]
        name = variable + "'" * order
        place = f"unknowns/{name}"
        apart = channel.frames_apart()
        unknowns.append({"name": name, "after": apart.tolist()})
        members[place] = channel.before
        if channel.mid is not None:
            members[f"{place}/mid"] = channel.mid
        if len(apart):
            members[f"{place}/after"] = channel.after[apart]
    facts["unknowns"] = unknowns
    facts["parameters"] = list(solution.parameters)
    members["parameters"] = np.array(list(solution.parameters.values()), dtype=np.float64)
    facts["multipliers"] = [{"kind": block.kind, "label": block.label} for block in solution.multipliers]
    members.update({f"multipliers/{k}": block.values for k, block in enumerate(solution.multipliers)})
    facts["files"] = []
    for k, file in enumerate([*model_files(solution), *solution.data]):
        known = {"role": file.role, "path": file.path, "sha256": file.sha256, "bytes": file.size}
        facts["files"].append({**known, "carried": file.content is not None})
        if file.content is not None:
            members[f"files/{k}"] = np.frombuffer(file.content, dtype=np.uint8)
    return Stored(facts, members)


def model_files(solution: Solution) -> list[RecordedFile]:
    """The files of the model of a solution: those it was solved or read with; the present ones of a model that only the
    replay reads.
    """
    if solution.files:
        return list(solution.files)
    if solution.model is None:
        return []
    beside = Path(solution.directory) / solution.model if solution.directory else None
    if beside is None or not beside.is_file():
        # By name: nothing here is imported from the layers above.
        beside = import_module("stc.models").locate(solution.model)
    return [] if beside is None else record(beside)


#: Which roles may follow which: the model's own file, its parts, then data.
_AFTER = {
    "": ("model", DATA_ROLE),
    "model": ("part", DATA_ROLE),
    "part": ("part", DATA_ROLE),
    DATA_ROLE: (DATA_ROLE,),
}


def files_of(stored: Stored) -> list[RecordedFile]:
    """The files that a stored solution depends on.

    Raises:
        SolutionError: the content of a file does not match its hash.
    """
    from hashlib import sha256

    found: list[RecordedFile] = []
    for k, known in enumerate(stored.facts["files"]):
        content = stored.vector(f"files/{k}").astype(np.uint8).tobytes() if known["carried"] else None
        file = RecordedFile(
            str(known["role"]), str(known["path"]), str(known["sha256"]), int(known["bytes"]), content
        )
        before = found[-1].role if k else ""
        if file.role not in _AFTER[before]:
            what = "its data" if before == DATA_ROLE else "its model's"
            raise SolutionError(f"the file was altered: {file.path} is said to be {what} {file.role}")
        if file.role == DATA_ROLE and content is None:
            raise SolutionError(f"the file was altered: it does not contain its data {file.path}")
        if content is not None and sha256(content).hexdigest() != file.sha256:
            raise SolutionError(
                f"the file was altered: {file.path}, which it contains, does not match its hash"
            )
        found.append(file)
    return found


# --- npz -----------------------------------------------------------------------------------------------------


def _write_npz(stored: Stored, stream: IO[bytes]) -> None:
    facts = np.frombuffer(json.dumps(stored.facts).encode(), dtype=np.uint8)
    npz.save(stream, {"facts": facts, **stored.members})


def _read_npz(path: Path) -> Stored:
    members = npz.load(path)
    if "facts" not in members:
        raise SolutionError("this is not a solution file")
    facts = members.pop("facts")
    return Stored(check_facts(json.loads(facts.tobytes().rstrip(b"\0").decode())), members)
