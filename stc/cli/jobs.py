"""What the commands do: each function carries out one and returns the exit status.

Mistakes in the input are raised and turned into a message in :mod:`stc.cli`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stc.cli import BAD, GOOD, console, record
from stc.cli.live import Watch
from stc.cli.options import SolveOptions, existing_solution, is_solution, writable_solution

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution


def solve(spec: str, options: SolveOptions, *, as_json: bool) -> int:
    """Solve and save."""
    model = load(spec, options)
    solution, file = solve_and_save(model, options, as_json=as_json, save=True)
    _show(solution, file, as_json)
    return GOOD if solution.status == "optimal" else BAD


def run(spec: str, options: SolveOptions, *, force: bool, as_json: bool) -> int:
    """Solve, save, validate."""
    model = load(spec, options)
    solution, file = solve_and_save(model, options, as_json=as_json, save=True)
    if solution.model is None:
        return _not_validated(solution, file, _no_replay(solution.name), as_json)
    return _judge(solution, solution, file, force, as_json)


def validate(target: str, options: SolveOptions, *, force: bool, as_json: bool) -> int:
    """Validate a saved solution, or what solving a spec gives; that is saved only if a file is named."""
    from stc.errors import UsageError

    if is_solution(target):
        from stc.solution import read

        if options != SolveOptions({}):
            raise UsageError(f"`{target}` is solved already: the options of a solve do not apply to it")
        path = existing_solution(target)
        return _judge(path, read(path), path, force, as_json)
    model = load(target, options)
    if model.problem(options.method).model is None:
        raise UsageError(_no_replay(model.name), "`stc solve` solves it without validation")
    solution, file = solve_and_save(model, options, as_json=as_json, save=options.output is not None)
    return _judge(solution, solution, file, force, as_json)


def check(spec: str, options: SolveOptions, *, as_json: bool) -> int:
    """Read a spec as far as its nonlinear program, and tell its sizes."""
    model = load(spec, options)
    problem, transcription = model.transcription(options.method)
    console.warn(problem.warnings)
    sizes = {
        "variables": transcription.program.size,
        "rows": transcription.program.row_count,
        "jacobian": len(transcription.program.jacobian),
        "hessian": len(transcription.program.hessian),
    }
    if as_json:
        facts = {"name": model.name, "method": problem.method, "n": problem.n, **sizes}
        warnings = record.of_diagnostics(problem.warnings)
        record.write(
            {**record.blank("ok"), **facts, "constants": dict(problem.constants), "warnings": warnings}
        )
        return GOOD
    rows = [
        ("unknowns", f"{len(problem.variables)} variables a frame, {len(problem.parameters)} parameters"),
        ("size", f"{sizes['variables']} variables, {sizes['rows']} rows"),
        ("nonzeros", f"{sizes['jacobian']} in the Jacobian, {sizes['hessian']} in the Hessian's lower half"),
        ("warnings", str(len(problem.warnings))),
    ]
    console.print_table(f"{model.name}, {problem.method}, n = {problem.n}: no mistakes", rows)
    return GOOD


def show(spec: str, stage: str, options: SolveOptions) -> int:
    """Print one stage of the walk from text to solution."""
    from stc.cli import stages

    if stage == "list":
        rows = [(name, (printer.__doc__ or "").split("\n")[0]) for name, printer in stages.STAGES.items()]
        console.print_table("", rows)
        return GOOD
    printer = stages.find(stage)
    print(printer(load(spec, options), options.method))
    return GOOD


def list_specs(*, as_json: bool) -> int:
    """Name the bundled specs."""
    from stc import specs

    found = [(name, specs.title(name)) for name in specs.names()]
    if as_json:
        record.write({"status": "ok", "specs": [{"name": name, "summary": text} for name, text in found]})
    else:
        console.print_table("", [(name, console.escape(text)) for name, text in found])
    return GOOD


def new(name: str) -> int:
    """Write the starter spec under a name that is still free."""
    from stc.cli.starter import write

    path = write(name)
    print(f"{path} written; next: stc run {path}")
    return GOOD


def load(spec: str, options: SolveOptions) -> Model:
    """The model of a path or bundled name with the constants that the user gave."""
    from stc.bundled import find_spec
    from stc.pipeline import Model, read_source

    return Model(read_source(find_spec(spec)), options.constants)


def solve_and_save(
    model: Model, options: SolveOptions, *, as_json: bool, save: bool
) -> tuple[Solution, Path | None]:
    """Solve, with the live line, and save whatever came out."""
    file = options.output
    if save and file is None:
        file = writable_solution(f"{model.name}.npz")
    with Watch(model.name, visible=not as_json) as watch:
        solution = model.solve(
            method=options.method,
            tolerance=options.tolerance,
            max_iterations=options.max_iterations,
            time_limit=options.time_limit,
            warm_start=options.warm_start,
            callback=watch,
        )
        if file is not None:
            solution.save(file)
    return solution, file


def _judge(
    replayed: Solution | Path, solution: Solution, file: Path | None, force: bool, as_json: bool
) -> int:
    """Replay a motion, given as a solution or (its model may lie beside it) as the file it is saved in."""
    if solution.status != "optimal" and not force:
        reason = f"the solve ended {solution.status}, not optimal; --force replays it all the same"
        return _not_validated(solution, file, reason, as_json)
    from stc.pipeline import replay

    if not as_json:
        console.show_solution(solution, file)
    report = replay(replayed, force=force)
    if as_json:
        record.write({**_record(solution, file), "validation": report.to_dict()})
    else:
        console.show_report(report)
    return GOOD if report.passed and solution.status == "optimal" else BAD


def _no_replay(name: str) -> str:
    return f"{name} has no `replay:` section that names a model, so that MuJoCo cannot replay it"


def _not_validated(solution: Solution, file: Path | None, reason: str, as_json: bool) -> int:
    """Show a solution that is not replayed, and why."""
    if as_json:
        record.write({**_record(solution, file), "validation": None})
    else:
        console.show_solution(solution, file)
    console.note(f"not validated: {reason}")
    return BAD


def _show(solution: Solution, file: Path | None, as_json: bool) -> None:
    if as_json:
        record.write(_record(solution, file))
    else:
        console.show_solution(solution, file)


def _record(solution: Solution, file: Path | None) -> record.Record:
    return record.of_solution(solution, None if file is None else str(file))
