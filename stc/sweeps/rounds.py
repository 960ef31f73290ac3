"""A whole sweep: round by round, each point from its parent, saved as soon as it is done."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

from stc.arguments import numbers
from stc.arguments import path as path_of
from stc.data_sets import files_of
from stc.errors import EndedError
from stc.in_notebook import in_notebook
from stc.pipeline import Model, load
from stc.problem import Problem
from stc.recorded_files import record
from stc.solver.options import given_options
from stc.sweeps.folder import Folder, Sweep
from stc.sweeps.grid import Grid
from stc.sweeps.point import Found, Task, solve_point
from stc.version import __version__
from stc.workers import Workers

__all__ = ["sweep"]


def sweep(
    spec: str | os.PathLike[str] | Model,
    axes: Mapping[str, Iterable[float]],
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    replay: bool = True,
    method: str | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    on_point: Callable[[Sweep, Found], None] | None = None,
) -> Sweep:
    """Solve a spec for all combinations of values of some constants, and judge each motion.

    Every point starts from the solution of a neighbour that the grid determines (:mod:`stc.sweeps.grid`), or of the
    neighbour's neighbour if no optimum was found there; if this finds no optimum, from the spec's guess.  The results
    do not depend on the number of workers or on interruptions: the same call with the same folder continues where the
    last one stopped.

    Parameters
    ----------
    spec : str | os.PathLike[str] | Model
        A path, a bundled name, the text, or a loaded model with constants for all points.
    axes : Mapping[str, Iterable[float]]
        The values of each swept constant, in the units of the spec.
    folder : str | os.PathLike[str]
        Folder for the results; created if it is missing.
    workers : int | None
        Number of processes; None for one per processor, or as set by ``joblib.parallel_config``.
    replay : bool
        Whether motions are judged in MuJoCo, if the spec names a model.
    method, tolerance, max_iterations
        Arguments of every solve, as for :meth:`stc.pipeline.Model.solve`.
    on_point : Callable[[Sweep, Found], None] | None
        Function that is called in this process with the sweep and the result after every point.

    Returns
    -------
    Sweep
        The results: see :class:`stc.sweeps.folder.Sweep`.

    Raises
    ------
    UsageError
        Invalid values, an unknown constant, or a folder that holds something else.
    SpecError
        Mistakes in the spec, at the first point.
    WorkerError
        Worker processes died again and again; the points that were done are kept.
    EndedError
        The process was asked to stop; the points that were done are kept.
    """
    given = {"method": method, "tolerance": tolerance, "max_iterations": max_iterations}
    given_options(tolerance, max_iterations)
    model = spec if isinstance(spec, Model) else load(spec)
    swept = set(axes) if isinstance(axes, Mapping) else set()
    problem = model.problem(method)
    grid = Grid(axes, problem.constants)
    fixed = {name: value for name, value in model.overrides.items() if name not in swept}
    first = grid.rounds()[0][0]
    _require_solvable(model, method, grid.constants(first))
    kept = Folder(
        Path(path_of(folder, "the folder of a sweep")),
        {
            "spec": model.name,
            "text": model.text,
            "files": _files(problem),
            "stc": __version__,
            "axes": grid.axes,
            "constants": fixed,
            **given,
            "replay": bool(replay),
        },
    )
    found = Sweep(kept.path, grid, kept.done(grid))

    def task(index: int) -> Task:
        ancestor = grid.parent(index)
        while ancestor is not None and found.facts[ancestor]["status"] != "optimal":
            ancestor = grid.parent(ancestor)
        start = None if ancestor is None else kept.motion(ancestor)
        constants = {**fixed, **grid.constants(index)}
        return Task(index, model.source, constants, given, bool(replay), start)

    progress: AbstractContextManager[Callable[[Sweep], None] | None] = nullcontext()
    if in_notebook():
        # By name: nothing here is imported from the layers above.
        progress = import_module("stc.notebook_progress").sweeping(model.name)
    try:
        with progress as show, Workers(workers) as side_by_side:
            for indices in grid.rounds():
                left = (index for index in indices if index not in found.facts)
                for one in side_by_side.results(solve_point, map(task, left)):
                    if one.facts["status"] == "interrupted":
                        raise EndedError("the sweep was interrupted", "interrupted")
                    kept.keep(one)
                    found.facts[one.index] = one.facts
                    if show is not None:
                        show(found)
                    if on_point is not None:
                        on_point(found, one)
    finally:
        kept.write_table(found)
    return found


def _require_solvable(model: Model, method: str | None, constants: Mapping[str, float]) -> None:
    """Raise the mistakes of the spec or its model before any work is done."""
    from stc.studies.replay_lines import check_replay_lines

    check_replay_lines(model.problem(method, **numbers(constants)))


def _files(problem: Problem) -> dict[str, str]:
    """The hashes of the files that the spec depends on, by path: its data, and the files of its model."""
    from stc.validate.model import find_model

    files: list[Any] = list(files_of(problem.data))
    if problem.model is not None:
        folders = [Path(problem.source.path).parent] if problem.source.path else []
        files += record(find_model(problem.model, folders))
    return {file.path: file.sha256 for file in files}
