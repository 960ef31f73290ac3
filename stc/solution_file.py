"""Solution files: how a :class:`stc.solution.Solution` is laid out on disk.

``.npz``
    A NumPy archive without pickled objects.  The entry ``facts`` is JSON (format version, names, numbers, the
    spec's text and its hash, and lists naming the entries below); all else are arrays of float64:

    ====================================  ========  ========================================================
    ``time``                              (n+1,)    times of the frames
    ``trajectory/x'/before``              (n+1,)    values at the frames as the step to the left sees them
    ``trajectory/x'/after``               (n+1,)    ... to the right; left out where it equals ``before``
    ``trajectory/x'/mid``                 (n,)      midpoint values, hermite-simpson only
    ``replay/0/value/before`` (...)       (n+1,)    replay lines as in the spec: value, rate, acceleration
    ``multipliers/0/nodes`` (...)         (k,)      multipliers by statement: nodes, sides, values
    ``solver/x`` (...)                    (N,)      raw unknowns, row_multipliers, bound_multipliers
    ====================================  ========  ========================================================

``.csv``
    The same content as text.  Lines starting with ``#`` hold the facts and the solver's vectors as JSON;
    below them is one table with a row per node in order of time, whose number is ``rows`` in the facts (left out
    by files from before it was counted); each ends with its line.  Its columns are ``node`` (``frame``,
    ``before``, ``after`` or ``mid``; a frame where anything jumps has a row for either side), ``time``, and
    every channel under its name (``x'``, ``joint x``, ``joint x rate``).  Numbers keep all their digits.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np

from stc import npz
from stc.arguments import path as file_path
from stc.atomic import replacing
from stc.errors import UsageError
from stc.solution import MultiplierBlock, ReplayChannel, Solution, SolutionError
from stc.trajectory import Channel, FloatArray

#: Version of the layout above.  A reader refuses files with a higher one.
FORMAT = 1

_PLAIN_FACTS = (
    "name",
    "source",
    "directory",
    "constants",
    "overrides",
    "method",
    "parameters",
    "status",
    "message",
    "objective",
    "violation",
    "optimality",
    "iterations",
    "factorizations",
    "optimizer",
    "seconds",
    "model",
    "force_frames",
    "sha256",
    "stc_version",
)
_VECTORS = ("x", "row_multipliers", "bound_multipliers")
_PARTS = ("value", "rate", "acceleration")


def write(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write a solution; see :meth:`stc.solution.Solution.save`."""
    target = Path(file_path(path, "the file of a solution"))
    writers: dict[str, Callable[[Solution, IO[bytes]], None]] = {".npz": _write_npz, ".csv": _write_csv}
    writer = writers.get(target.suffix.lower())
    if writer is None:
        raise UsageError(f"cannot tell the format of {target.name!r}: a solution file ends in .npz or .csv")
    with replacing(target) as temporary, temporary.open("wb") as stream:
        writer(solution, stream)


def load(path: str | os.PathLike[str]) -> Solution:
    """Read a solution; see :func:`stc.solution.read`."""
    import zipfile

    if not isinstance(path, str | os.PathLike):
        raise UsageError(f"a solution is read from a path, not from {path!r}")
    source = Path(path)
    readers: dict[str, Callable[[Path], Solution]] = {".npz": _read_npz, ".csv": _read_csv}
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
    except PermissionError:
        raise UsageError(f"{source} may not be read") from None
    except (
        zipfile.BadZipFile,
        OSError,
        EOFError,
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
    ) as error:
        raise SolutionError(
            f"{source} is damaged: it was cut off or altered, or is no solution file"
        ) from error


def contents(path: str | os.PathLike[str]) -> str:
    """What a file with the suffix of a solution holds: ``solution``, ``table`` (as exported) or "" for anything else.

    Nothing is raised: a file that cannot be read holds anything else.
    """
    import zipfile

    source = Path(path)
    try:
        if source.suffix.lower() == ".csv":
            with source.open(encoding="utf-8-sig") as stream:
                first = stream.readline()
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
    """Say what a data file that was named in place of a spec is for.

    Raises:
        UsageError: always.
    """
    found = contents(path)
    if found == "solution":
        raise UsageError(
            f"{path} is a saved solution, not a spec",
            f"`stc validate {path}` judges it; `stc solve SPEC --warm-start {path}` solves on from it",
        )
    raise UsageError(
        f"{path} is {'a table of numbers' if found else 'a data file'}, not a spec",
        f"`stc solve SPEC --guess-from {path}` starts a solve from the numbers of a table",
    )


# --- what both formats share -------------------------------------------------------------------------------


def _facts(solution: Solution) -> dict[str, Any]:
    """Everything but arrays, as JSON takes it."""
    facts: dict[str, Any] = {"format": FORMAT, "kind": "stc solution", "n": solution.n}
    for key in _PLAIN_FACTS:
        value = getattr(solution, key)
        facts[key] = dict(value) if isinstance(value, Mapping) else value
    facts["trajectories"] = [[name, order] for name, order in solution.trajectories]
    facts["replay"] = [
        {"kind": r.kind, "path": list(r.path), "parts": [p for p in _PARTS if getattr(r, p) is not None]}
        for r in solution.replay
    ]
    facts["multipliers"] = [{"kind": m.kind, "label": m.label} for m in solution.multipliers]
    return facts


def _check_facts(facts: Any) -> dict[str, Any]:
    if not isinstance(facts, dict) or facts.get("kind") != "stc solution":
        raise SolutionError("this is not a solution file")
    if not isinstance(facts.get("format"), int):
        raise SolutionError("the file does not tell its format version")
    if facts["format"] > FORMAT:
        raise SolutionError(
            f"the file has format {facts['format']}, written by stc {facts.get('stc_version', '?')}; "
            f"this version reads up to format {FORMAT}: install a newer stc"
        )
    return facts


def _channels(solution: Solution) -> Iterator[tuple[str, Channel]]:
    """Every channel with its place in the archive."""
    for (name, order), channel in solution.trajectories.items():
        yield f"trajectory/{name}{chr(39) * order}", channel
    for index, line in enumerate(solution.replay):
        for part in _PARTS:
            channel = getattr(line, part)
            if channel is not None:
                yield f"replay/{index}/{part}", channel


def _assemble(
    facts: dict[str, Any],
    time: FloatArray,
    channel: Callable[[str], Channel],
    vector: Callable[[str], FloatArray],
) -> Solution:
    """The solution from its facts and from functions that find channels and vectors by their place."""
    replay = []
    for index, line in enumerate(facts["replay"]):
        parts = {part: channel(f"replay/{index}/{part}") for part in line["parts"]}
        replay.append(ReplayChannel(line["kind"], tuple(line["path"]), **parts))
    multipliers = [
        MultiplierBlock(
            block["kind"],
            block["label"],
            vector(f"multipliers/{index}/nodes"),
            vector(f"multipliers/{index}/sides").astype(np.int8),
            vector(f"multipliers/{index}/values"),
        )
        for index, block in enumerate(facts["multipliers"])
    ]
    facts.setdefault("optimizer", "sqp")  # what files from before there was a choice do not say
    plain = {key: facts[key] for key in _PLAIN_FACTS}
    first, last = plain.pop("force_frames")
    solution = Solution(
        **plain,
        force_frames=(int(first), int(last)),
        time=time,
        trajectories={
            (name, order): channel(f"trajectory/{name}{chr(39) * order}")
            for name, order in facts["trajectories"]
        },
        replay=replay,
        multipliers=multipliers,
        x=vector("solver/x"),
        row_multipliers=vector("solver/row_multipliers"),
        bound_multipliers=vector("solver/bound_multipliers"),
    )
    if solution.sha256 != facts["sha256"]:
        raise SolutionError("the spec's text does not match its hash: the file was altered")
    if solution.n != facts["n"]:
        raise SolutionError(f"the file was altered: it tells of {facts['n']} steps and has {solution.n}")
    if solution.status == "optimal" and not np.isfinite(solution.x).all():
        raise SolutionError("the file was altered: an optimal solution has no numbers that are not finite")
    return solution


def _vectors(solution: Solution) -> Iterator[tuple[str, FloatArray]]:
    """Every vector that is not a channel, with its place in the archive."""
    for key in _VECTORS:
        yield f"solver/{key}", getattr(solution, key)
    for index, block in enumerate(solution.multipliers):
        yield f"multipliers/{index}/nodes", block.nodes
        yield f"multipliers/{index}/sides", block.sides.astype(np.float64)
        yield f"multipliers/{index}/values", block.values


# --- npz ---------------------------------------------------------------------------------------------------


def _write_npz(solution: Solution, stream: IO[bytes]) -> None:
    text = json.dumps(_facts(solution)).encode()
    arrays: dict[str, Any] = {"facts": np.frombuffer(text, dtype=np.uint8), "time": solution.time}
    for place, channel in _channels(solution):
        arrays[f"{place}/before"] = channel.before
        if channel.jumps:
            arrays[f"{place}/after"] = channel.after
        if channel.mid is not None:
            arrays[f"{place}/mid"] = channel.mid
    arrays.update(_vectors(solution))
    npz.save(stream, arrays)


def _read_npz(path: Path) -> Solution:
    import zipfile

    if path.is_file() and not zipfile.is_zipfile(path):  # NumPy would advise to load it unsafely
        raise zipfile.BadZipFile("it is no zip archive")
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        if "facts" not in archive.files:
            raise SolutionError("this is not a solution file")
        facts = _check_facts(json.loads(archive["facts"].tobytes().decode()))
        names = set(archive.files)

        def array(name: str) -> FloatArray:
            if name not in names:
                raise SolutionError(f"the file is damaged: {name} is missing")
            return np.asarray(archive[name], dtype=np.float64)

        def channel(place: str) -> Channel:
            before = array(f"{place}/before")
            after = array(f"{place}/after") if f"{place}/after" in names else before
            mid = array(f"{place}/mid") if f"{place}/mid" in names else None
            return Channel(before, after, mid)

        return _assemble(facts, array("time"), channel, array)


# --- csv ---------------------------------------------------------------------------------------------------


def _write_csv(solution: Solution, stream: IO[bytes]) -> None:
    import csv

    channels = list(_channels(solution))
    split = np.zeros(solution.n + 1, dtype=bool)
    for _, channel in channels:
        split |= ~((channel.before == channel.after) | (np.isnan(channel.before) & np.isnan(channel.after)))
    rows = io.StringIO()
    table = csv.writer(rows, lineterminator="\n")
    table.writerow(["node", "time", *(_column(solution, place) for place, _ in channels)])
    mids = [c.mid for _, c in channels if c.mid is not None]
    for k, time in enumerate(solution.time):
        sides = ("before", "after") if split[k] else ("frame",)
        for side in sides:
            values = [(c.after if side == "after" else c.before)[k] for _, c in channels]
            table.writerow([side, repr(float(time)), *(repr(float(v)) for v in values)])
        if mids and k < solution.n:
            middle = 0.5 * (time + solution.time[k + 1])
            table.writerow(["mid", repr(float(middle)), *(repr(float(m[k])) for m in mids)])
    content = rows.getvalue()
    facts = {**_facts(solution), "rows": content.count("\n") - 1}
    head = [f"# facts {json.dumps(facts)}\n"]
    head += [f"# {place} {json.dumps(vector.tolist())}\n" for place, vector in _vectors(solution)]
    stream.write(("".join(head) + content).encode())


def _column(solution: Solution, place: str) -> str:
    """The heading of a channel: ``x'``, or for replay lines ``joint x``, ``joint x rate``."""
    first, rest = place.split("/", 1)
    if first == "trajectory":
        return rest
    index, part = rest.split("/")
    line = solution.replay[int(index)]
    return f"{line.kind} {line.name}" + ("" if part == "value" else f" {part}")


def _read_csv(path: Path) -> Solution:
    import csv

    facts: Any = None
    vectors: dict[str, FloatArray] = {}
    text = path.read_text()
    lines = text.splitlines()
    start = 0
    while start < len(lines) and lines[start].startswith("#"):
        place, _, content = lines[start][1:].strip().partition(" ")
        if place == "facts":
            facts = json.loads(content)
        else:
            vectors[place] = np.array(json.loads(content), dtype=np.float64)
        start += 1
    facts = _check_facts(facts)
    rows = list(csv.reader(lines[start:]))
    if not rows or rows[0][:2] != ["node", "time"]:
        raise SolutionError("the file is damaged: its table has no heading")
    # A number that lost its last digits is a number still: only the end of its line tells that it is whole.
    if "rows" in facts and (len(rows) - 1 != facts["rows"] or not text.endswith("\n")):
        raise SolutionError(
            "the file is damaged: rows are missing from its table, or the last one was cut off"
        )
    kinds = np.array([row[0] for row in rows[1:]])
    numbers = np.array([[float(v) for v in row[1:]] for row in rows[1:]])
    before, after = np.isin(kinds, ("frame", "before")), np.isin(kinds, ("frame", "after"))
    frames = int(facts["n"]) + 1
    if numbers.ndim != 2 or np.sum(before) != frames or np.sum(after) != frames:
        raise SolutionError("the file is damaged: rows are missing from its table")
    places = [f"trajectory/{name}{chr(39) * order}" for name, order in facts["trajectories"]]
    places += [f"replay/{k}/{part}" for k, line in enumerate(facts["replay"]) for part in line["parts"]]
    columns = {place: numbers[:, k + 1] for k, place in enumerate(places)}
    has_mid = facts["method"] == "hermite-simpson"

    def channel(place: str) -> Channel:
        column = columns[place]
        return Channel(column[before], column[after], column[kinds == "mid"] if has_mid else None)

    def vector(place: str) -> FloatArray:
        if place not in vectors:
            raise SolutionError(f"the file is damaged: {place} is missing")
        return vectors[place]

    return _assemble(facts, numbers[before, 0], channel, vector)
