"""The actions of the commands: each function carries out one command and returns the exit status.

Mistakes in the input are raised and turned into a message in :mod:`stc.cli`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from stc import deadline
from stc.arguments import spare
from stc.bundled import is_solution
from stc.cli import console, guard, reasons, record, searches, statuses
from stc.cli.inputs import load
from stc.cli.live import Watch, validating
from stc.cli.options import SolveOptions, existing_solution, writable_solution
from stc.cli.outcome import Ending, Outcome, keep_solution
from stc.cli.statuses import BAD, GOOD
from stc.errors import OWN_MODEL, Diagnostic, EndedError, UsageError

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution
    from stc.studies.compare import Run
    from stc.validate.certificate import Certificate
    from stc.validate.metrics import Metric

#: What is compared unless others are named.
COMPARED = "sqp,nlopt:slsqp,nlopt:auglag"


def solve(spec: str, options: SolveOptions, *, as_json: bool) -> int:
    """Solve and save."""
    outcome = _solved(load(spec, options.constants), options, as_json, save=True)
    if as_json:
        record.write(outcome.record())
    else:
        outcome.show()
    return GOOD if outcome.good else BAD


def run(
    spec: str, options: SolveOptions, *, force: bool, page: Path | None, table: bool, as_json: bool
) -> int:
    """Solve, save, validate; ``page`` is the file of the certificate, and ``table`` prints every measurement."""
    from stc.studies.replay_lines import check_replay_lines

    model = load(spec, options.constants)
    if page is not None:
        from stc.cli.keeping import inputs_of

        spare(page, inputs_of(model), "--report")
    check_replay_lines(model.problem(options.method))
    outcome = replace(_solved(model, options, as_json, save=True), brief=not table)
    if outcome.solution.model is None:
        return _not_validated(outcome, f"{_no_replay(outcome.solution.name)}; {OWN_MODEL}", page, as_json)
    return _judged(outcome, outcome.solution, force=force, page=page, table=table, as_json=as_json)


def compare(spec: str, optimizers: str | None, options: SolveOptions, *, as_json: bool) -> int:
    """Solve with several optimizers; the exit status is good if any of them found an optimum.

    Without a list the default optimizers are used; on large problems, without those that are slow there.
    """
    from stc.studies.compare import compare as run_all

    model = load(spec, options.constants)
    names = [name.strip() for name in (optimizers or COMPARED).split(",") if name.strip()]
    table = console.Comparison(model.name, names)
    runs: list[Run] = []

    def done(run: Run) -> None:
        runs.append(run)
        if not as_json:
            watch.clear()
            table.add(run)

    def announce(name: str, number: int, count: int) -> None:
        # That of the first one began with the process, if it was given.
        if options.time_limit is not None and (number > 1 or math.isinf(deadline.until())):
            guard.limit(options.time_limit, time.perf_counter())
        watch.announce(f"{model.name}  {name} ({number} of {count})")

    def told(why: str) -> int:
        """The last word; ``why`` it comes before all have been run, if it does."""
        if not as_json:
            table.end()
        console.warn(model.warnings)
        if why:
            console.note(f"{why}; {len(runs)} of {len(names)} optimizers were run")
        good = any(run.status == "optimal" for run in runs) and not why
        if as_json:
            rows = [run.to_dict() for run in runs]
            status = why or ("ok" if good else "failed")
            record.write({"status": status, "name": model.name, "optimizers": rows})
        return GOOD if good else BAD

    with (
        Watch(model.name) as watch,
        console.warnings_as_notes(),
        guard.on_end(told),
        suppress(KeyboardInterrupt),
    ):
        run_all(
            model,
            names,
            method=options.method,
            tolerance=options.tolerance,
            max_iterations=options.max_iterations,
            time_limit=options.time_limit,
            callback=watch,
            on_run=done,
            skip_slow=optimizers is None,
            announce=announce,
        )
    return told("interrupted" if watch.stopped else "")


def validate(
    target: str,
    options: SolveOptions,
    *,
    force: bool,
    page: Path | None,
    order: bool,
    table: bool,
    as_json: bool,
) -> int:
    """Validate a saved solution, or the solution of a spec, which is saved only if a file is named.

    With ``order`` the observed order of convergence is one of the measurements; ``table`` prints every measurement.
    """
    if page is not None:
        spare(page, [(target, "the solution to validate")], "--report")
    outcome, motion = solved(target, options, as_json)
    outcome = replace(outcome, brief=not table)
    further: Sequence[Metric] = ()
    if order:
        from stc.cli import studies

        model, method = studies.subject(target, options)
        further = studies.observe_order(model, method, options).metrics
    return _judged(outcome, motion, force=force, page=page, table=table, as_json=as_json, further=further)


def solved(
    target: str,
    options: SolveOptions,
    as_json: bool,
    needs_model: str = "MuJoCo cannot replay it",
    without: str = "`stc solve` solves it without validation",
) -> tuple[Outcome, Solution | Path]:
    """A saved solution, or the solution of a spec, and the object to validate.

    Args:
        target: the argument of the command line.
        options: options of the solve, if the target is a spec.
        as_json: whether to print no progress.
        needs_model: what cannot be done without a model; "" if no model is needed.
        without: what can be done instead.

    Raises:
        UsageError: options of a solve for a saved solution, or a motion that names no model.
        SpecError: a spec whose replay lines do not fit its model.
    """
    if is_solution(target):
        if options != SolveOptions({}):
            raise UsageError(f"`{target}` is solved already: the options of a solve do not apply to it")
        from stc.solution import read

        path = existing_solution(target)
        # The file and not the solution is handed on: the model may lie beside it.
        outcome = Outcome(read(path), path, was_read=True)
        if needs_model and outcome.solution.model is None:
            raise UsageError(_no_replay(outcome.solution.name, needs_model), f"{without}; {OWN_MODEL}")
        return outcome, path
    from stc.studies.replay_lines import check_replay_lines

    model = load(target, options.constants)
    problem = model.problem(options.method)
    if needs_model and problem.model is None:
        raise UsageError(_no_replay(model.name, needs_model), f"{without}; {OWN_MODEL}")
    check_replay_lines(problem)
    outcome = _solved(model, options, as_json, save=options.output is not None)
    return outcome, outcome.solution


def to_show(
    target: str, options: SolveOptions, as_json: bool, *needs: str
) -> tuple[Outcome, Solution | Path]:
    """As :func:`solved`, for commands that show or pass on a motion without judging it.

    ``needs`` are the last two arguments of :func:`solved`.  If the spec has changed since the solve, a note says so.
    """
    outcome, motion = solved(target, options, as_json, *needs)
    if outcome.file is not None and outcome.file is motion:
        from stc.validate.certificate.staleness import stale

        for line in stale(outcome.solution):
            console.note(f"{line}; the saved motion is shown")
    return outcome, motion


def require_optimal(solution: Solution, done: str, force: bool) -> None:
    """Refuse to show or pass on a motion whose solve did not end optimal, unless ``force`` is given.

    Args:
        solution: the result of a solve.
        done: the action as a participle, such as ``drawn``.
        force: whether ``--force`` was given.

    Raises:
        UsageError: the solve did not end optimal.
    """
    if solution.status != "optimal" and not force:
        raise UsageError(
            f"the motion of {solution.name} is not {done}: its solve ended {solution.status}, not optimal",
            f"solve the spec again with `stc solve` to see why, or use --force to have the motion {done} nevertheless",
        )


def check(spec: str, options: SolveOptions, *, as_json: bool) -> int:
    """Build the nonlinear program of a spec and print its sizes; the exit status is good if no failure is certain."""
    from stc.language.show_data import described
    from stc.solving.solve import contradictions_of
    from stc.studies.replay_lines import check_replay_lines

    model = load(spec, options.constants)
    problem, transcription = model.transcription(options.method)
    check_replay_lines(problem)
    # Evaluating everything once at the starting point finds what the text alone does not show.
    contradictions = contradictions_of(transcription, transcription.bind(problem.constants))
    console.warn(problem.warnings)
    status = "infeasible" if contradictions else "ok"
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
            {
                **record.blank(status, "; ".join(contradictions)),
                **facts,
                "constants": dict(problem.constants),
                "data": dict(described(problem)),
                "warnings": warnings,
                "contradictions": contradictions,
            }
        )
        return BAD if contradictions else GOOD
    for message in contradictions:
        console.note(f"no solve can meet all constraints: {message}")
    rows = [
        ("unknowns", f"{len(problem.variables)} variables a frame, {len(problem.parameters)} parameters"),
        ("size", f"{sizes['variables']} variables, {sizes['rows']} rows"),
        ("nonzeros", f"{sizes['jacobian']} in the Jacobian, {sizes['hessian']} in the Hessian's lower half"),
        *((f"data {name}", text) for name, text in described(problem)),
        ("warnings", str(len(problem.warnings))),
    ]
    verdict = "infeasible, its bounds contradict each other" if contradictions else "no mistakes"
    console.print_table(f"{model.name}, {problem.method}, n = {problem.n}: {verdict}", rows)
    return BAD if contradictions else GOOD


def show(spec: str, stage: str, options: SolveOptions) -> int:
    """Print one stage of the processing from text to solution."""
    from stc.cli import model_files, stages

    if model_files.is_model(spec):
        print(model_files.listing(spec))
        return GOOD
    if stage == "list":
        rows = [(name, (printer.__doc__ or "").split("\n")[0]) for name, printer in stages.STAGES.items()]
        console.print_table("", rows)
        return GOOD
    printer = stages.find(stage)
    print(printer(load(spec, options.constants), options.method))
    return GOOD


def list_specs(*, as_json: bool) -> int:
    """Print the names of the bundled specs."""
    from stc import specs

    found = [(name, specs.title(name)) for name in specs.names()]
    if as_json:
        record.write({"status": "ok", "specs": [{"name": name, "summary": text} for name, text in found]})
    else:
        console.print_table("", [(name, console.escape(text)) for name, text in found])
    return GOOD


def new(name: str, model: str | None, copied: str | None = None, seconds: float | None = None) -> int:
    """Write a starter spec or a copy of a bundled one, under a name that does not exist."""
    import shlex

    from stc import specs
    from stc.cli.starter import write

    path = write(name, model, copied, seconds)
    print(f"{path} written; next: stc run {shlex.quote(str(path))}")
    if path.parent == Path() and path.stem in specs.names():
        console.note(f"{path.stem} is a bundled spec too: in this folder that name means {path} from now on")
        if copied is None:
            console.note(
                f"{path} is a starter spec and no copy of the bundled one, "
                f"which `stc new mine --from {path.stem}` copies"
            )
    return GOOD


def _solved(model: Model, options: SolveOptions, as_json: bool, save: bool) -> Outcome:
    """Solve with a progress line, and save the result."""
    file = options.output
    if save and file is None:
        file = writable_solution(f"{model.name}.npz")
    if file is not None and file.exists():
        from stc.cli.keeping import keep_inputs

        keep_inputs(file, model, options.search.guess)
    from stc.optimizers import DEFAULT

    if options.threads is not None:
        from stc.codegen.threads import limit

        limit(options.threads)
    profile = None
    if options.profile:
        from stc.studies.profile import Profile

        profile = Profile()
        profile.begin(statuses.owns_process)
    minimizer = None if profile is None else profile.minimize
    with Watch(model.name, saves=file is not None) as watch, console.warnings_as_notes():
        ending = Ending(watch, file, as_json)
        with guard.on_end(ending):
            try:
                searched = model
                if options.search.adds_frames:
                    from stc.studies.frames import in_shares

                    searched = in_shares(model, options.method)
                found = searches.find(
                    searched,
                    options.search,
                    ending.noting(partial(searched.solve, callback=watch, minimizer=minimizer)),
                    not as_json,
                    method=options.method,
                    tolerance=options.tolerance,
                    max_iterations=options.max_iterations,
                    time_limit=options.time_limit,
                    warm_start=options.warm_start,
                    optimizer=options.optimizer or DEFAULT,
                    fewer_first=not options.direct,
                )
            except EndedError as ended:
                left = ending.found(ended.status)
                if left is None:
                    raise
                found = left
            solution = found.solution
            keep = None if profile is None else profile.saving.over(solution.save)
            with guard.claimed():
                unsaved = "" if file is None else keep_solution(solution, file, keep)
                file = None if unsaved else file
                warnings = _stated_warnings(model, options)
                parts = () if profile is None else profile.parts(solution)
                outcome = Outcome(solution, file, warnings, found=found, profile=parts, unsaved=unsaved)
                ending.outcome = outcome
    console.warn(warnings)
    with guard.on_end(ending):
        if solution.status != "optimal":
            return replace(outcome, blame=reasons.find_blame(model, solution, options.explain))
        outcome = ending.outcome = replace(
            outcome,
            uncertainty=reasons.find_uncertainty(model, solution),
            **reasons.find_remarks(solution),
        )
        if options.explain:
            from stc.studies.explain import explain

            return replace(outcome, explanation=explain(model, solution))
    return outcome


def _stated_warnings(model: Model, options: SolveOptions) -> Sequence[Diagnostic]:
    """The warnings about the spec as given, not about the frame counts of a search."""
    search = options.search
    if search.walk is None and not search.adds_frames:
        return model.warnings
    last = {} if search.walk is None else {search.walk.name: search.walk.last}
    return model.problem(options.method, **last).warnings


def _judged(
    outcome: Outcome,
    motion: Solution | Path,
    *,
    force: bool,
    page: Path | None,
    table: bool,
    as_json: bool,
    further: Sequence[Metric] = (),
) -> int:
    """Replay a motion and show its certificate: the verdict in a few lines, or the whole ``table``."""
    status = outcome.solution.status  # what a search found before it was stopped is judged as well
    if status != "optimal" and not force:
        reason = f"the solve ended {status}, not optimal; --force replays it nevertheless"
        return _not_validated(outcome, reason, page, as_json)
    if outcome.solution.is_sketch:
        reason = "a motion from time stepping is too coarse for a replay"
        return _not_validated(outcome, reason, page, as_json)
    from stc.certification import certify

    if not as_json:
        with guard.claimed():
            outcome.show()

    def ended(why: str) -> int:
        reason = f"the command was ended: {why}"
        return _not_validated(outcome, reason, page, as_json, why, shown=True)

    try:
        with validating(outcome.solution.name), guard.on_end(ended):
            certificate = certify(
                motion, force=force, equations=True if page is not None else None, further=further
            )
    except EndedError as error:
        return ended(error.status)
    if not as_json:
        # What was found is shown before anything else can go wrong.
        console.show_certificate(certificate, table)
        if certificate.passed and not outcome.good:
            console.note("the motion passed, but the search did not reach its goal")
    unwritten = "" if page is None else _written(certificate, page)
    if as_json:
        known = outcome.record()
        if unwritten:
            known["message"] = f"{known['message']} {unwritten}".strip()
        written = None if page is None or unwritten else str(page)
        record.write({**known, "validation": certificate.to_dict(), "report": written})
    if unwritten:
        console.note(unwritten)
    elif page is not None and not as_json:
        print(f"certificate: {page}")
    return GOOD if certificate.passed and outcome.good and not unwritten else BAD


def _written(certificate: Certificate, page: Path) -> str:
    """Write a certificate's page; returns why that failed, or ""."""
    try:
        certificate.write(page)
    except OSError as error:
        if error.errno is None:
            raise
        return f"{page}: {error.strerror or error}: the report is not written"
    return ""


def _not_validated(
    outcome: Outcome, reason: str, page: Path | None, as_json: bool, status: str = "", shown: bool = False
) -> int:
    """Show a solution that is not replayed, and why; ``page`` is the file that its certificate would have had.

    The ``status`` is that of the solve unless another one is given; the solution may have been ``shown`` already.
    """
    if page is not None:
        reason = f"{reason}; {page} is not written"
    if as_json:
        known = outcome.record()
        known["status"] = status or known["status"]
        record.write({**known, "validation": None, "report": None})
    elif not shown:
        outcome.show()
    console.note(f"not validated: {reason}")
    return BAD


def _no_replay(name: str, reason: str = "MuJoCo cannot replay it") -> str:
    return f"{name} has no `replay:` section that names a model, so that {reason}"
