"""The arguments and options that several commands share, as the parser wants them declared."""

from __future__ import annotations

from typing import Annotated

import typer


def _bundled(incomplete: str) -> list[str]:
    """The bundled specs whose names begin so, for the completion of shells, which add files of their own."""
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
        help="central, trapezoidal, hermite-simpson or stepping, whatever the spec says.",
    ),
]
MaxIterations = Annotated[
    int | None, typer.Option("--max-iterations", metavar="COUNT", help="Stop after this many iterations.")
]
TimeLimit = Annotated[
    float | None, typer.Option("--time-limit", metavar="SECONDS", help="Stop so long after the start.")
]
Tolerance = Annotated[
    float | None, typer.Option("--tolerance", metavar="ERROR", help="Largest error that counts as solved.")
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
        help="Which to run, in this order; default sqp,nlopt:slsqp,nlopt:auglag, without what is slow on large specs.",
    ),
]
CompareLimit = Annotated[
    float | None,
    typer.Option("--time-limit", metavar="SECONDS", help="Stop each of them after this much time."),
]
WarmStart = Annotated[
    str | None,
    typer.Option(
        "--warm-start", metavar="FILE", help="Start from a saved solution, resampled where n differs."
    ),
]
GuessFrom = Annotated[
    str | None,
    typer.Option(
        "--guess-from", metavar="FILE", help="Start from the values in a .csv or .npz file, by name."
    ),
]
Continue = Annotated[
    str | None,
    typer.Option(
        "--continue",
        metavar="NAME=FIRST:LAST:STEPS",
        help="Walk a constant to its last value, each solve starting from the one before.",
    ),
]
Starts = Annotated[
    int | None,
    typer.Option("--starts", metavar="COUNT", help="Solve from so many starts and keep the best optimum."),
]
Seed = Annotated[int | None, typer.Option("--seed", metavar="NUMBER", help="Of --starts; default 1.")]
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
        help="Add frames until MuJoCo's replay stays this near, in m and rad, or say what stands in the way.",
    ),
]
Output = Annotated[
    str | None,
    typer.Option(
        "-o", "--output", metavar="FILE", help="Where the solution goes: .npz or .csv; default NAME.npz."
    ),
]
PictureOutput = Annotated[
    str,
    typer.Option(
        "-o", "--output", metavar="FILE", help="Where the picture goes; its ending says what it is."
    ),
]
Explain = Annotated[
    bool,
    typer.Option(
        "--explain",
        help="Also tell what holds the solution back and what each statement costs, or who is to blame.",
    ),
]
Direct = Annotated[
    bool, typer.Option("--direct", help="Solve on all frames at once, never on fewer of them first.")
]
Threads = Annotated[
    int | None, typer.Option("--threads", metavar="COUNT", help="1 leaves the second processor alone.")
]
Profile = Annotated[bool, typer.Option("--profile", help="Also tell where the time went.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]
Force = Annotated[bool, typer.Option("--force", help="Replay even what the solver did not call optimal.")]
Report = Annotated[
    str | None,
    typer.Option("--report", metavar="FILE.html", help="Write the certificate as one self-contained page."),
]
Table = Annotated[
    bool, typer.Option("--table", help="Print every measurement of the validation, not its summary alone.")
]
