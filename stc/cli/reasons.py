"""Explanations of a result for people: statements that cause a failure, costs of statements, and the grid's error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from stc import deadline
from stc.cli import console
from stc.errors import UsageError

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solution import Solution
    from stc.studies.blame import Blame
    from stc.studies.explain import Explanation, Sensitivity
    from stc.studies.uncertainty import Uncertainty

#: Seconds for finding who is to blame: unasked, and when the user wants an explanation.
UNASKED, ASKED = 2.0, 60.0
#: Less time than this is not worth a beginning.
SHORTEST = 0.05

#: Statements listed in a table.
MOST = 15

#: Characters of a statement in a table.
LONGEST = 50


def find_blame(model: Model, solution: Solution, asked: bool) -> Blame | None:
    """The statements that cause a solve not to end optimal; None if there is nothing to report."""
    seconds = min(ASKED if asked else UNASKED, deadline.left())
    if seconds < SHORTEST:
        return None
    from stc.studies.blame import blame

    return blame(model, solution, seconds)


def find_remarks(solution: Solution) -> dict[str, Any]:
    """What :class:`stc.cli.outcome.Outcome` has of the discretisation, of controls that ring, and of complementary
    pairs of an optimal solution; as much as there is time for.
    """
    from stc.studies.complementarity import complementarity
    from stc.studies.grid_error import grid_error
    from stc.studies.ringing import ringing

    studies: dict[str, Callable[[Solution], Any]]
    studies = {"grid": grid_error, "ringing": ringing, "complementarity": complementarity}
    return {name: study(solution) for name, study in studies.items() if deadline.left() >= SHORTEST}


def find_uncertainty(model: Model, solution: Solution) -> Uncertainty | None:
    """The standard errors of the estimated parameters; None if the spec estimates none."""
    problem, _ = model.transcription(solution.method, **solution.overrides)
    if not problem.parameters or not any(term.rows for term in problem.objective):
        return None
    from stc.studies.uncertainty import uncertainty

    try:
        return uncertainty(model, solution)
    except UsageError as reason:
        console.note(str(reason))
        return None


def show_explanation(explanation: Explanation) -> None:
    """Print two tables: the active statements, and the change of the objective per unit by which each statement is
    relaxed.
    """
    from stc.studies.explain import frames_in_words

    print()
    active = [
        (console.escape(_short(one.statement)), one.end, frames_in_words(one.frames), _place(one))
        for one in explanation.active[:MOST]
    ]
    _table("Active inequalities", active, ("statement", "end", "frames", "place"), len(explanation.active))
    print()
    rows: list[Sequence[str]] = []
    for one in explanation.sensitivities[:MOST]:
        there = "" if one.frame is None else f"{one.change_there:.4g} at {one.frame:g}"
        rows.append((console.escape(_short(one.statement)), one.end, f"{one.change:.6g}", there, _place(one)))
    _table(
        "Change of the objective per unit by which a statement is relaxed (an equation: by which its right side grows)",
        rows,
        ("statement", "end", "change", "most of it", "place"),
        len(explanation.sensitivities),
    )


def _table(title: str, rows: Sequence[Sequence[str]], header: tuple[str, ...], count: int) -> None:
    if not rows:
        print(f"{title}: none")
        return
    console.print_table(title, rows, header)
    if count > len(rows):
        print(f"and {count - len(rows)} more; --json lists all")


def _short(statement: str) -> str:
    return statement if len(statement) <= LONGEST else f"{statement[: LONGEST - 3]}..."


def _place(one: Sensitivity) -> str:
    return console.escape(f"{one.file}:{one.line}:{one.column}")
