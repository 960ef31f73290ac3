"""From a solution file to a solution: the problem is built again from the text, constants and unknowns in the file.

A file stores the unknowns once.  Times, derivatives, the inputs of the replay and the positions of multipliers are
computed here from the spec's own text, so that the file cannot contradict them.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from stc import models
from stc.errors import SolutionError, Source, StcError, UsageError
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.problem import Problem
from stc.recorded_files import DATA_ROLE, RecordedFile, present, unpacked
from stc.records import dataclass
from stc.solution import Solution
from stc.solution_content import Stored
from stc.solution_file import MISSHAPEN, PLAIN_FACTS, damaged, files_of, load, model_files
from stc.solving.collect import motion_at
from stc.trajectory import FloatArray
from stc.transcription.multipliers import bound_nodes, multiplier_blocks, rows_by_statement
from stc.transcription.stated import Stated, state

__all__ = ["problem_of", "read", "require_stated", "source_of", "stated_again"]

_Key = tuple[str, tuple[tuple[str, float], ...], str, tuple[str, ...]]


@dataclass
class _Restated:
    """A problem read again from its text, with its statements, which are computed when they are first used."""

    key: _Key
    problem: Problem
    stated: Stated | None = None


#: The last problem that was read again, for whoever judges what was just read.
_last: list[_Restated] = []


def source_of(solution: Solution, beside: Path | None = None) -> Source:
    """The text of a solution's spec, as if it were read from its folder.

    Args:
        solution: any.
        beside: folder of the solution's file, if the spec's folder is not known or does not contain the same model.
    """
    folder = Path(solution.directory) if solution.directory else beside
    if folder is not None and beside is not None and solution.model is not None:
        moved = not (folder / solution.model).is_file() and (beside / solution.model).is_file()
        folder = beside if moved else folder
    return _source(solution.name, solution.source, folder, solution.files, solution.data, solution.model)


def _source(
    name: str,
    text: str,
    folder: Path | None,
    files: Sequence[RecordedFile],
    data: Sequence[RecordedFile],
    model: str | None = None,
) -> Source:
    path = "" if folder is None else str(folder / f"{name}.stc")
    file = _model_of(files, folder, model)
    carried = {file.path: file.content or b"" for file in data}
    return Source(f"{name}.stc", text, path, None if file is None else str(file), carried)


def _model_of(files: Sequence[RecordedFile], folder: Path | None, model: str | None) -> Path | None:
    """The file of the model that a motion was solved for: the file at the place in the text if it is unchanged, else
    the stored one; None if there is neither.

    The meaning of a motion does not depend on later changes of the model's file.  :mod:`stc.validate.setup` checks by
    its hash whether a verdict is about that file.
    """
    if not files:
        return None
    name = model or files[0].path
    bundled = models.locate(name)
    places = [*([] if folder is None else [folder / name]), *([] if bundled is None else [bundled])]
    known = present(files, places)
    if known is not None:
        return known
    carried = unpacked(files)
    if carried is None:
        return None
    from stc.validate.ordinary import refusal

    if why := refusal(carried):
        raise SolutionError(f"the model in the file is refused: {why}")
    return carried


def problem_of(solution: Solution) -> Problem:
    """The problem of a solution, built from the text in it.

    Raises:
        SpecError: the text is not a spec.
        UsageError: a constant in the solution's overrides is not declared in the text.
    """
    files = [*model_files(solution), *solution.data]
    key = _key(solution.source, solution.overrides, solution.method, files)
    if not _last or _last[0].key != key:
        problem = elaborate(parse(source_of(solution)), solution.overrides, solution.method)
        _last[:] = [_Restated(key, problem)]
    return _last[0].problem


def stated_again(solution: Solution) -> Stated:
    """The problem of a solution on its frames, built from the text in it.

    Raises:
        SpecError, UsageError: as :func:`problem_of`.
        SolutionError: that problem has another number of frames.
    """
    problem = problem_of(solution)
    if problem.n != solution.n:
        raise SolutionError(f"its text states a motion of {problem.n} steps, and it has {solution.n}")
    restated = _last[0]
    if restated.stated is None:
        restated.stated = state(problem)
    return restated.stated


def require_stated(solution: Solution) -> None:
    """Refuse to save a solution that was made by hand and could not be read again.

    Raises:
        UsageError: its text does not state its unknowns.
    """
    try:
        stated = stated_again(solution)
        _require_same(
            "unknowns",
            [_primed(*key) for key in solution.unknowns],
            [_primed(*key) for key in stated.layout.names],
        )
        if len(solution.x) != stated.layout.size:
            raise SolutionError(
                f"the file was altered: its text states {stated.layout.size} unknowns, and `x` has {len(solution.x)}"
            )
    except StcError as error:
        reason = str(error).splitlines()[0]
        raise UsageError(
            f"the solution of {solution.name} cannot be saved: {reason}",
            "a file holds the unknowns of the problem that its text states; all else is evaluated from the two",
        ) from None


def _primed(name: str, order: int) -> str:
    return name + "'" * order


def _key(source: str, overrides: Mapping[str, float], method: str, files: Sequence[RecordedFile]) -> _Key:
    return source, tuple(sorted(overrides.items())), method, tuple([file.sha256 for file in files])


def read(path: str | os.PathLike[str]) -> Solution:
    """Read a solution file; see :func:`stc.solution.read`."""
    stored = load(path)
    try:
        return solution_of(stored, Path(path).parent)
    except SolutionError as error:
        raise SolutionError(f"{path}: {error}") from None
    except MISSHAPEN as error:
        raise damaged(path) from error


#: Facts that are text.
_WORDS = ("name", "source", "directory", "method", "status", "message", "optimizer", "sha256", "stc_version")


def solution_of(stored: Stored, beside: Path | None = None) -> Solution:
    """The solution of a file; ``beside`` is the file's folder.

    Raises:
        SolutionError: the file contradicts itself or its own text.
        ValueError, KeyError, TypeError: it is damaged.
    """
    facts = stored.facts
    plain: dict[str, Any] = {key: facts[key] for key in PLAIN_FACTS}
    for key in _WORDS:
        if not isinstance(plain[key], str):
            raise TypeError(f"{key} is not text")
    if plain["sha256"] != sha256(plain["source"].encode()).hexdigest():
        raise SolutionError("the spec's text does not match its hash: the file was altered")
    files = files_of(stored)
    data = [file for file in files if file.role == DATA_ROLE]
    files = files[: len(files) - len(data)]
    stated = _stated(plain, stored, files, data, beside)
    read = {each.file.path for each in stated.problem.data.values() if each.file is not None}
    if read != {file.path for file in data}:
        raise SolutionError("the file was altered: it contains other data than its text reads")
    x = _unknowns(stated, stored)
    if plain["status"] == "optimal" and not np.isfinite(x).all():
        raise SolutionError("the file was altered: an optimal solution has no numbers that are not finite")
    y, z = _multipliers(stated, stored)
    if unknown := set(stored.members) - stored.used:
        raise SolutionError(
            f"the file was altered: it holds {min(unknown)}, which does not belong to this solution"
        )
    model = Path(stated.problem.model or "").name
    if files and files[0].path not in (model, f"{model}.xml"):
        raise SolutionError(
            f"the file was altered: it depends on {files[0].path}, its text on {model or 'no model'}"
        )
    motion = motion_at(stated, x, stated.problem.constants)
    return Solution(
        **{**motion, **plain},
        row_multipliers=y,
        bound_multipliers=z,
        multipliers=multiplier_blocks(stated, y, z),
        files=files,
    )


def _stated(
    plain: Mapping[str, Any],
    stored: Stored,
    files: Sequence[RecordedFile],
    data: Sequence[RecordedFile],
    beside: Path | None,
) -> Stated:
    """The problem of a file's text, once it is known to have as many frames as there are values."""
    overrides = {str(name): float(value) for name, value in plain["overrides"].items()}
    folder = Path(plain["directory"]) if plain["directory"] else beside
    if folder is not None and beside is not None and files and not (folder / files[0].path).is_file():
        folder = beside if (beside / files[0].path).is_file() else folder
    source = _source(str(plain["name"]), plain["source"], folder, files, data)
    try:
        problem = elaborate(parse(source), overrides, plain["method"])
        n = int(stored.facts["n"])
        if problem.n != n:
            raise SolutionError(f"the file was altered: it states {n} steps, its text {problem.n}")
        for unknown in stored.facts["unknowns"]:
            found = len(stored.vector(f"unknowns/{unknown['name']}")) - 1
            if found != n:
                raise SolutionError(f"the file was altered: it states {n} steps and has {found}")
        stated = state(problem)
        key = _key(plain["source"], overrides, plain["method"], [*files, *data])
        _last[:] = [_Restated(key, problem, stated)]
        return stated
    except SolutionError:
        raise
    except StcError as error:
        reason = str(error).splitlines()[0]
        missing = [file.path for file in files if file.content is None]
        if missing and source.model_file is None:
            reason += f" (of its model the file contains all but {', '.join(missing[:3])})"
        raise SolutionError(f"this version cannot read its text: {reason}") from None


def _unknowns(stated: Stated, stored: Stored) -> FloatArray:
    """The decision vector, (N,), from values by name."""
    layout = stated.layout
    x = np.full(layout.size, np.nan)
    apart = {str(unknown["name"]): unknown["after"] for unknown in stored.facts["unknowns"]}
    slots = {_primed(name, order): rest for name, order, *rest in layout.slots()}
    _require_same("unknowns", apart, slots)
    for name, (before, after, middle) in slots.items():
        place = f"unknowns/{name}"
        values = stored.vector(place)
        x[before] = x[after] = values
        frames = np.array(apart[name], dtype=np.intp)
        if frames.size:
            single = before[frames] == after[frames]
            if single.any():
                raise SolutionError(
                    f"the file was altered: {name} has two values at frame {frames[single][0]}, where it does not jump"
                )
            x[after[frames]] = _of_length(stored, f"{place}/after", len(frames))
        if len(middle):
            x[middle] = _of_length(stored, f"{place}/mid", len(middle))
    names = [str(name) for name in stored.facts["parameters"]]
    _require_same("parameters", names, layout.parameters)
    values = _of_length(stored, "parameters", len(names))
    x[[layout.parameters[name] for name in names]] = values
    return x


def _of_length(stored: Stored, name: str, count: int) -> FloatArray:
    values = stored.vector(name)
    if len(values) != count:
        raise SolutionError(f"the file was altered: {name} has {len(values)} numbers where there are {count}")
    return values


def _require_same(what: str, found: Collection[str], stated: Collection[str]) -> None:
    if len(set(found)) != len(found) or set(found) != set(stated):
        raise SolutionError(
            f"its {what} are {', '.join(found) or 'none'}; its text states {', '.join(stated) or 'none'}"
        )


def _multipliers(stated: Stated, stored: Stored) -> tuple[FloatArray, FloatArray]:
    """The multipliers of rows (M,) and bounds (N,), as the solver orders them."""
    y, z = np.zeros(stated.row_count), np.zeros(stated.layout.size)
    places = {statement: ids for statement, (_, ids, _) in rows_by_statement(stated).items()}
    required = set(places)
    places |= {("bound", name): at for name, _, at in bound_nodes(stated)}
    blocks = [(str(block["kind"]), str(block["label"])) for block in stored.facts["multipliers"]]
    if len(set(blocks)) != len(blocks):
        raise SolutionError("the file was altered: it has the multipliers of a statement twice")
    for k, block in enumerate(blocks):
        if block not in places:
            raise SolutionError(
                f"the file was altered: it has multipliers of `{block[1]}`, which its text does not state"
            )
        at = places[block]
        into = z if block[0] == "bound" else y
        into[at] = _of_length(stored, f"multipliers/{k}", len(at))
    missing = required - set(blocks)
    if blocks and missing:
        raise SolutionError(f"the file was altered: it has no multipliers of `{min(missing)[1]}`")
    return y, z
