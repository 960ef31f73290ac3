"""Check the lines of a spec's replay section against its model, before anything is solved."""

from __future__ import annotations

from pathlib import Path

from stc.errors import Diagnostic, SpecError
from stc.problem import Problem
from stc.validate import ModelError
from stc.validate.model import find_model, load_model
from stc.validate.setup import require_line
from stc.validate.warnings import caught_warnings


def check_replay_lines(problem: Problem) -> None:
    """Find every joint, actuator, field, place of a force and compared output that the replay section names.

    Args:
        problem: a spec, with or without a model.

    Raises:
        SpecError: the model does not exist, MuJoCo does not accept it, or lines do not fit it.
    """
    if problem.model is None:
        return
    folder = [Path(problem.source.path).parent] if problem.source.path else []
    mistakes = []
    with caught_warnings():
        try:
            compiled = load_model(find_model(problem.model, folder), problem.additions)
        except ModelError as error:
            raise SpecError([Diagnostic("error", str(error), problem.model_span)]) from None
        for line in problem.replay:
            try:
                require_line(compiled, line.kind, line.path)
            except ModelError as error:
                mistakes.append(Diagnostic("error", str(error), line.span))
    if mistakes:
        raise SpecError(mistakes)
