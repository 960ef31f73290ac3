"""The commands and their options; :mod:`stc.cli.jobs` has their implementation."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Annotated

import typer
from typer.models import CommandInfo

from stc.cli import editor, explaining, exports, jobs, perturbed, pictures, steering, studies, sweeping
from stc.cli import view as viewing
from stc.cli.options import SolveOptions, writable_page
from stc.cli.parameters import (
    CompareLimit,
    Force,
    Json,
    Optimizers,
    PictureOutput,
    Report,
    Spec,
    SpecOrSolution,
    Table,
    with_options,
)
from stc.errors import UsageError
from stc.version import __version__

app = typer.Typer(
    help="Solve for an optimal motion, stated as constraints and an objective, and validate it in MuJoCo.",
    epilog="Exit status: 0 if optimal (or validated), 1 if not, 2 for a mistake in the input.",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)


def app_for(arguments: Sequence[str]) -> typer.Typer:
    """The application with only the command that is called, or with all commands if that is not clear.

    Setting up the parsers of all commands takes longer than reading and transcribing a small spec.
    """
    called = [known for known in app.registered_commands if arguments and _name(known) == arguments[0]]
    if not called:
        return app
    small = copy.copy(app)
    small.registered_commands = called
    return small


def _name(command: CommandInfo) -> str:
    return str(command.name or getattr(command.callback, "__name__", ""))


@app.callback(invoke_without_command=True)
def top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        print(f"stc {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


#: Options of a solve: those of all commands that solve, and those of the commands that may search.
_SOLVING = ("settings", "method", "max_iterations", "time_limit", "tolerance", "optimizer", "warm_start")
_SEARCHING = (*_SOLVING, "guess_from", "walk", "starts", "seed", "workers", "refine")


@app.command()
@with_options(*_SEARCHING, "output", "explain", "direct", "profile", "threads")
def solve(spec: Spec, options: SolveOptions, json: Json = False) -> int:
    """Solve a spec and save the motion."""
    return jobs.solve(spec, options, as_json=json)


@app.command()
@with_options(*_SEARCHING, "until", "until_passed", "direct", "threads", "output")
def run(
    spec: Spec,
    options: SolveOptions,
    force: Force = False,
    report: Report = None,
    table: Table = False,
    json: Json = False,
) -> int:
    """Solve a spec, save the motion and validate it in MuJoCo."""
    page = None if report is None else writable_page(report)
    return jobs.run(spec, options, force=force, page=page, table=table, as_json=json)


@app.command()
@with_options("method", "max_iterations", "tolerance")
def sweep(
    spec: Spec,
    options: SolveOptions,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUES",
            help="Values of a constant: FIRST:LAST:COUNT or VALUE,VALUE,... Repeatable; all combinations are solved.",
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="The folder for the results; default NAME_sweep."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="COUNT", help="Number of processes; default one per processor."),
    ] = None,
    solve_only: Annotated[
        bool, typer.Option("--solve-only", help="Do not replay the motions in MuJoCo.")
    ] = False,
    json: Json = False,
) -> int:
    """Solve and validate a spec for all combinations of values. Repeat the command to continue a stopped sweep."""
    return sweeping.run(spec, settings, output, options, workers=workers, replay=not solve_only, as_json=json)


@app.command()
def dataset(
    folder: Annotated[str, typer.Argument(metavar="FOLDER", help="The folder of a sweep.")],
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Where it goes; default FOLDER_dataset."),
    ] = None,
    time_step: Annotated[
        float | None,
        typer.Option(
            "--time-step", metavar="SECONDS", help="Between instants, at most; default: the model's."
        ),
    ] = None,
    unverified: Annotated[
        bool, typer.Option("--unverified", help="Take motions, too, that no replay has passed.")
    ] = False,
    json: Json = False,
) -> int:
    """Write the motions of a sweep for learning: states, actions, contacts and verdicts, in Minari's layout."""
    return sweeping.dataset(folder, output, time_step=time_step, unverified=unverified, as_json=json)


@app.command()
@with_options("settings", "method", "max_iterations", "tolerance", time_limit=(CompareLimit, 60.0))
def compare(
    spec: Spec,
    options: SolveOptions,
    optimizers: Optimizers = None,
    json: Json = False,
) -> int:
    """Solve a spec with several optimizers and print the result of each."""
    return jobs.compare(spec, optimizers, options, as_json=json)


@app.command()
@with_options(*_SOLVING, "output")
def validate(
    target: SpecOrSolution,
    options: SolveOptions,
    force: Force = False,
    report: Report = None,
    table: Table = False,
    equations: Annotated[
        bool,
        typer.Option(
            "--equations", help="Compare the spec's equations of motion with the model's, term by term."
        ),
    ] = False,
    order: Annotated[
        bool,
        typer.Option(
            "--order", help="Solve with n, 2n and 4n frames and measure the replay's order of convergence."
        ),
    ] = False,
    robustness: Annotated[
        bool,
        typer.Option(
            "--robustness", help="Replay many times with perturbed masses, friction, start and time step."
        ),
    ] = False,
    samples: Annotated[
        int | None,
        typer.Option(
            "--samples", metavar="COUNT", help="Replays per perturbation of --robustness; default 16."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed", metavar="NUMBER", help="Seed of the perturbations of --robustness; default 0."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="COUNT", help="Processes that share --robustness; default 1."),
    ] = None,
    json: Json = False,
) -> int:
    """Validate a saved motion in MuJoCo; a spec is solved first."""
    page = None if report is None else writable_page(report)
    if robustness:
        if page is not None or equations or order:
            raise UsageError("--robustness cannot be combined with --report, --equations or --order")
        return perturbed.run(
            target, options, force=force, samples=samples, seed=seed, workers=workers, as_json=json
        )
    for option, value in (("--samples", samples), ("--seed", seed), ("--workers", workers)):
        if value is not None:
            raise UsageError(f"{option} can only be used with --robustness")
    if page is None and (equations or order):
        return studies.run(target, options, equations=equations, order=order, as_json=json)
    return jobs.validate(target, options, force=force, page=page, order=order, table=table, as_json=json)


@app.command()
@with_options("settings", "method")
def check(spec: Spec, options: SolveOptions, json: Json = False) -> int:
    """Report mistakes, warnings and sizes of a spec without solving it."""
    return jobs.check(spec, options, as_json=json)


@app.command()
@with_options("settings", "method")
def show(
    spec: Spec,
    options: SolveOptions,
    stage: Annotated[
        str,
        typer.Option("--stage", metavar="STAGE", help="The stage to print; --stage list prints their names."),
    ] = "problem",
) -> int:
    """Print a stage of a spec's processing (tokens, syntax, problem, machine code, ...), or a model's names."""
    return jobs.show(spec, stage, options)


@app.command()
@with_options("settings", "method")
def plot(
    target: SpecOrSolution,
    output: PictureOutput,
    options: SolveOptions,
    force: Force = False,
    json: Json = False,
) -> int:
    """Draw the solved and the replayed joints, torques and paths over time, as .png, .svg or .pdf.

    Without a model the variables are drawn.
    """
    return pictures.plot(target, output, options, force=force, as_json=json)


@app.command()
@with_options("settings", "method")
def render(
    target: SpecOrSolution,
    output: PictureOutput,
    options: SolveOptions,
    show: Annotated[
        str,
        typer.Option(
            "--show",
            metavar="MOTION",
            help="solved, replayed or tracked; the last two also show the solved motion.",
        ),
    ] = "solved",
    camera: Annotated[
        str | None,
        typer.Option("--camera", metavar="NAME", help="A camera of the model, which is not moved."),
    ] = None,
    size: Annotated[
        str, typer.Option("--size", metavar="WIDTHxHEIGHT", help="Size of an image or tile, in pixels.")
    ] = "640x480",
    tiles: Annotated[
        int, typer.Option("--tiles", metavar="COUNT", help="Number of images in a filmstrip.")
    ] = 6,
    rate: Annotated[int, typer.Option("--rate", metavar="COUNT", help="Images per second of a video.")] = 30,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed", metavar="SHARE", help="Speed of a video as a share of real time, such as 0.1."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Render the motion as a filmstrip (.png, .jpg) or a video (.webp, .gif, .mp4); no screen is needed."""
    look = pictures.look(size, camera, rate, speed, tiles)
    return pictures.render(target, output, look, show, options, force=force, as_json=json)


@app.command()
@with_options("settings", "method")
def export(
    target: SpecOrSolution,
    options: SolveOptions,
    kind: Annotated[str | None, typer.Option("--format", metavar="FORMAT", help=exports.HELP)] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="The file to write; by default named after the spec."
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Instants per second of tables and ros (default: frames), glTF and USD (60).",
        ),
    ] = None,
    time_step: Annotated[
        float | None,
        typer.Option(
            "--time-step",
            metavar="SECONDS",
            help="Longest step of keyframes and controls; default the model's.",
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write a motion for other programs: tables, MuJoCo keyframes and controls with gains, glTF, USD, ROS."""
    return exports.export(
        target, kind, output, options, rate=rate, time_step=time_step, force=force, as_json=json
    )


@app.command()
@with_options("settings", "method", "time_limit")
def steer(
    spec: Spec,
    options: SolveOptions,
    port: Annotated[
        int | None,
        typer.Option("--port", metavar="NUMBER", help="Of the page; default: a free one from 8090."),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Where the steered text is written; default: the spec itself, of a bundled one NAME.stc here.",
        ),
    ] = None,
    native: Annotated[
        bool, typer.Option("--native", help="In a window of MuJoCo's viewer, not in a browser.")
    ] = False,
) -> int:
    """Steer a motion by hand in a browser: drag what the spec states, and write it back into its text."""
    return steering.steer(spec, options, port, output, native=native)


@app.command()
@with_options(*_SOLVING, "output")
def view(
    target: SpecOrSolution,
    options: SolveOptions,
    web: Annotated[
        bool, typer.Option("--web", help="Show the motion in a browser; no screen is needed.")
    ] = False,
    host: Annotated[
        str | None,
        typer.Option("--host", metavar="ADDRESS", help="Serve --web on this address, not 127.0.0.1."),
    ] = None,
    port: Annotated[
        int | None, typer.Option("--port", metavar="NUMBER", help="Serve --web on this port; default 8080.")
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show every iterate of the solve; stopping it saves the best one.")
    ] = False,
    tracked: Annotated[
        bool, typer.Option("--tracked", help="Begin with the tracked replay instead of the open-loop one.")
    ] = False,
    speed: Annotated[
        float, typer.Option("--speed", metavar="SHARE", help="Speed as a share of real time.")
    ] = 1.0,
) -> int:
    """Show a motion in MuJoCo's viewer, and change its constants while it runs."""
    return viewing.view(target, options, viewing.Window(web, host, port, tracked, speed), live=live)


@app.command("list")
def list_(json: Json = False) -> int:
    """List the bundled specs."""
    return jobs.list_specs(as_json=json)


@app.command()
@with_options("settings")
def schedule(
    target: SpecOrSolution,
    options: SolveOptions,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="FILE", help="The spec to write; default NAME_scheduled.stc."),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write the contacts that a `free:` solve found as a spec with ranges of frames, for an exact solve."""
    return exports.schedule(target, output, options, force=force, as_json=json)


@app.command("language-server")
def language_server(
    stdio: Annotated[
        bool, typer.Option("--stdio", help="Over standard input and output, as it always is.")
    ] = True,
) -> int:
    """Tell an editor what the text of a spec says: mistakes, meanings, completions (docs/editor.md)."""
    return editor.serve()


@app.command("explain-motion")
def explain_motion(
    motion: Annotated[str, typer.Argument(metavar="MOTION", help="A recorded motion, .csv or .npz.")],
    model: Annotated[str, typer.Option("--model", metavar="FILE", help="The MuJoCo model that moves.")],
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="The spec to write; default MOTION_explained.stc."
        ),
    ] = None,
    search_time: Annotated[
        float,
        typer.Option(
            "--search-time", metavar="SECONDS", help="Time for the search for weights; default 600."
        ),
    ] = 600.0,
    json: Json = False,
) -> int:
    """Propose a short spec whose solution is close to a recorded motion: contacts, ends, and what it wants least of."""
    return explaining.run(motion, model, output, search_time=search_time, as_json=json)


@app.command()
def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the spec; the command writes NAME.stc.")
    ],
    model: Annotated[
        str | None, typer.Option("--model", metavar="FILE", help="A MuJoCo model for the spec.")
    ] = None,
    copied: Annotated[
        str | None,
        typer.Option("--from", metavar="SPEC", help="Copy this bundled spec, to change the copy."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--time-limit",
            metavar="S",
            help="Processor time for each page that is tried for a model, in seconds; 20 without it.",
        ),
    ] = None,
) -> int:
    """Write a commented starter spec that solves and validates, or a copy of a bundled one."""
    return jobs.new(name, model, copied, seconds)
