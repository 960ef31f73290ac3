"""Do the lines of a spec's replay section fit its model?  Told with their places, before anything is solved."""

from __future__ import annotations

from pathlib import Path

from stc.errors import Diagnostic, SpecError
from stc.problem import Problem
from stc.validate import ModelError
from stc.validate.model import find_model, load_model
from stc.validate.setup import require_line
from stc.validate.warnings import caught_warnings


def check_replay_lines(problem: Problem) -> None:
    """Find every joint, actuator, field and place of a force that the replay section names.

    What ``compare`` lines name is found when the motion is replayed, and not here.

    Args:
        problem: a spec, with or without a model.

    Raises:
        ModelError: there is no model of that name, or MuJoCo does not accept it.
        SpecError: lines that do not fit it.
    """
    if problem.model is None:
        return
    folder = [Path(problem.source.path).parent] if problem.source.path else []
    path = find_model(problem.model, folder)
    mistakes = []
    with caught_warnings():
        compiled = load_model(path)
        for line in problem.replay:
            try:
                require_line(compiled, line.kind, line.path)
            except ModelError as error:
                mistakes.append(Diagnostic("error", str(error), line.span))
    if mistakes:
        raise SpecError(mistakes)
