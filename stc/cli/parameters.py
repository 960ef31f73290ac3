"""The arguments and options that several commands share, declared for typer."""

import functools
import inspect
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import typer

from stc.cli.options import solve_options


def _bundled(incomplete: str) -> list[str]:
    """The names of bundled specs that begin with a text, for shell completion; the shell itself completes files."""
    from stc import specs

    return [name for name in specs.names() if name.startswith(incomplete)]


Spec = Annotated[
    str,
    typer.Argument(
        metavar="SPEC", help="A .stc file or the name of a bundled spec.", autocompletion=_bundled
    ),
]
SpecOrSolution = Annotated[
    str,
    typer.Argument(
        metavar="SPEC|SOLUTION",
        help="A saved solution (.npz, .csv), or a spec to solve first.",
        autocompletion=_bundled,
    ),
]
Optimizers = Annotated[
    str | None,
    typer.Option(
        "--optimizers",
        metavar="NAME,NAME,...",
        help="The optimizers; default sqp,nlopt:slsqp,nlopt:auglag, without slow ones for large specs.",
    ),
]
CompareLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="Stop each optimizer after this time; default 60."),
]
PictureOutput = Annotated[
    str,
    typer.Option(
        "-o", "--output", metavar="FILE", help="The picture file to write; its suffix selects the format."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]
Force = Annotated[
    bool, typer.Option("--force", help="Go on with the motion even if the solve did not end optimal.")
]
Report = Annotated[
    str | None,
    typer.Option("--report", metavar="FILE.html", help="Write the certificate as one self-contained page."),
]
Table = Annotated[
    bool, typer.Option("--table", help="Print every measurement of the validation, not only the summary.")
]


class OfSolve:
    """The options of a solve, by the argument of :func:`stc.cli.options.solve_options` that they are."""

    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="Give a constant another value, such as h=1/30. Repeatable."
        ),
    ] = None
    method: Annotated[
        str | None,
        typer.Option(
            "--method",
            metavar="METHOD",
            help="central, trapezoidal, hermite-simpson or stepping; overrides the spec's method.",
        ),
    ] = None
    max_iterations: Annotated[
        int | None, typer.Option("--max-iterations", metavar="COUNT", help="Stop after this many iterations.")
    ] = None
    time_limit: Annotated[
        float | None,
        typer.Option(
            "--time-limit", metavar="SECONDS", help="Stop this long after the start of the process."
        ),
    ] = None
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance", metavar="ERROR", help="Largest optimality error of a solution; default 1e-8."
        ),
    ] = None
    optimizer: Annotated[
        str | None,
        typer.Option(
            "--optimizer",
            metavar="NAME",
            help="sqp (the default), witkin-kass, nlopt:slsqp, nlopt:auglag, ...",
        ),
    ] = None
    warm_start: Annotated[
        str | None,
        typer.Option(
            "--warm-start", metavar="FILE", help="Start from a saved solution, resampled if n differs."
        ),
    ] = None
    guess_from: Annotated[
        str | None,
        typer.Option(
            "--guess-from",
            metavar="FILE",
            help="Start from the columns of a .csv or .npz file, matched by name.",
        ),
    ] = None
    walk: Annotated[
        str | None,
        typer.Option(
            "--continue",
            metavar="NAME=FIRST:LAST:STEPS",
            help="Change a constant in STEPS steps from FIRST to LAST; each solve starts from the one before.",
        ),
    ] = None
    starts: Annotated[
        int | None,
        typer.Option(
            "--starts", metavar="COUNT", help="Solve from COUNT random guesses and keep the best optimum."
        ),
    ] = None
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="NUMBER", help="Seed of the random guesses of --starts; default 1."),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="COUNT",
            help="Number of processes that share the solves of --starts; default 1.",
        ),
    ] = None
    refine: Annotated[
        float | None,
        typer.Option(
            "--refine",
            metavar="ERROR",
            help="Add frames until the estimated discretisation error is this small.",
        ),
    ] = None
    until: Annotated[
        float | None,
        typer.Option(
            "--until-verified",
            metavar="DRIFT",
            help="Add frames until MuJoCo's replay drifts less than this, in m and rad, or say why it does not.",
        ),
    ] = None
    until_passed: Annotated[
        bool,
        typer.Option(
            "--until-passed",
            help="Add frames until the motion passes its validation, or say why more frames do not help.",
        ),
    ] = False
    output: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="The solution file to write, .npz or .csv; default NAME.npz.",
        ),
    ] = None
    explain: Annotated[
        bool,
        typer.Option(
            "--explain",
            help="Also list the active statements and what each costs, or the statements that cause a failure.",
        ),
    ] = False
    direct: Annotated[
        bool, typer.Option("--direct", help="Solve on all frames at once, not on fewer frames first.")
    ] = False
    profile: Annotated[
        bool, typer.Option("--profile", help="Also print the time of each part of the solve.")
    ] = False
    threads: Annotated[
        int | None,
        typer.Option("--threads", metavar="COUNT", help="Threads of the solver, 1 or 2; default 2."),
    ] = None


def with_options(
    *names: str, **others: tuple[Any, Any]
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Give a command options of a solve in the place of its parameter ``options``, which has all of them, checked.

    Args:
        names: those of :class:`OfSolve`.
        others: by name, the declaration and the default of those that this command declares in its own way.
    """
    declared = {name: (OfSolve.__annotations__[name], getattr(OfSolve, name)) for name in names} | others
    keyword = inspect.Parameter.KEYWORD_ONLY

    def parameters(command: Callable[..., int]) -> Iterator[inspect.Parameter]:
        for own in inspect.signature(command, eval_str=True).parameters.values():
            if own.name == "options":
                for name, (kind, default) in declared.items():
                    yield inspect.Parameter(name, keyword, annotation=kind, default=default)
            else:
                yield own.replace(kind=keyword)

    def decorated(command: Callable[..., int]) -> Callable[..., int]:
        @functools.wraps(command)
        def called(**given: Any) -> int:
            solving = {name: given.pop(name) for name in declared}
            return command(options=solve_options(**solving), **given)

        called.__signature__ = inspect.Signature(list(parameters(command)))  # type: ignore[attr-defined]
        return called

    return decorated
