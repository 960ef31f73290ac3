"""The arguments and options that several commands share, declared for typer."""

from __future__ import annotations

from typing import Annotated

import typer


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
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Give a constant another value, such as h=1/30. Repeatable."
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        "--method",
        metavar="METHOD",
        help="central, trapezoidal, hermite-simpson or stepping; overrides the spec's method.",
    ),
]
MaxIterations = Annotated[
    int | None, typer.Option("--max-iterations", metavar="COUNT", help="Stop after this many iterations.")
]
TimeLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="Stop this long after the start of the process."),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        "--tolerance", metavar="ERROR", help="Largest optimality error of a solution; default 1e-8."
    ),
]
Optimizer = Annotated[
    str | None,
    typer.Option(
        "--optimizer", metavar="NAME", help="sqp (the default), witkin-kass, nlopt:slsqp, nlopt:auglag, ..."
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
WarmStart = Annotated[
    str | None,
    typer.Option("--warm-start", metavar="FILE", help="Start from a saved solution, resampled if n differs."),
]
GuessFrom = Annotated[
    str | None,
    typer.Option(
        "--guess-from", metavar="FILE", help="Start from the columns of a .csv or .npz file, matched by name."
    ),
]
Continue = Annotated[
    str | None,
    typer.Option(
        "--continue",
        metavar="NAME=FIRST:LAST:STEPS",
        help="Change a constant in STEPS steps from FIRST to LAST; each solve starts from the one before.",
    ),
]
Starts = Annotated[
    int | None,
    typer.Option(
        "--starts", metavar="COUNT", help="Solve from COUNT random guesses and keep the best optimum."
    ),
]
Seed = Annotated[
    int | None,
    typer.Option("--seed", metavar="NUMBER", help="Seed of the random guesses of --starts; default 1."),
]
StartWorkers = Annotated[
    int | None,
    typer.Option(
        "--workers", metavar="COUNT", help="Number of processes that share the solves of --starts; default 1."
    ),
]
Refine = Annotated[
    float | None,
    typer.Option(
        "--refine", metavar="ERROR", help="Add frames until the estimated discretisation error is this small."
    ),
]
UntilVerified = Annotated[
    float | None,
    typer.Option(
        "--until-verified",
        metavar="DRIFT",
        help="Add frames until MuJoCo's replay drifts less than this, in m and rad, or say why it does not.",
    ),
]
Output = Annotated[
    str | None,
    typer.Option(
        "-o", "--output", metavar="FILE", help="The solution file to write, .npz or .csv; default NAME.npz."
    ),
]
PictureOutput = Annotated[
    str,
    typer.Option(
        "-o", "--output", metavar="FILE", help="The picture file to write; its suffix selects the format."
    ),
]
Explain = Annotated[
    bool,
    typer.Option(
        "--explain",
        help="Also list the active statements and what each costs, or the statements that cause a failure.",
    ),
]
Direct = Annotated[
    bool, typer.Option("--direct", help="Solve on all frames at once, not on fewer frames first.")
]
Threads = Annotated[
    int | None, typer.Option("--threads", metavar="COUNT", help="Threads of the solver, 1 or 2; default 2.")
]
Profile = Annotated[bool, typer.Option("--profile", help="Also print the time of each part of the solve.")]
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
