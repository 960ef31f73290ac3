"""The messages, word for word: each `golden/NAME.stc` must give exactly `golden/NAME.txt`.

After a change of wording, `python tests/language/test_golden.py` rewrites the expected files; read the
difference.
"""

from pathlib import Path

import pytest

from stc.errors import Source, SpecError
from stc.language import read_problem
from stc.transcription import transcribe

GOLDEN = Path(__file__).parent / "golden"
CASES = sorted(path.stem for path in GOLDEN.glob("*.stc"))


def output(name: str) -> str:
    """What a user sees: the error, or the warnings; where there are none, the error when numbers are bound."""
    path = GOLDEN / f"{name}.stc"
    try:
        problem = read_problem(Source(path.name, path.read_text(encoding="utf-8")))
        if not problem.warnings:
            transcribe(problem).bind(problem.constants)
    except SpecError as error:
        return f"{error}\n"
    return "".join(f"{warning}\n" for warning in problem.warnings)


@pytest.mark.parametrize("name", CASES)
def test_messages_are_as_recorded(name: str) -> None:
    assert output(name) == (GOLDEN / f"{name}.txt").read_text(encoding="utf-8")


def test_every_case_says_something() -> None:
    assert len(CASES) > 20
    assert all(output(name) for name in CASES)


if __name__ == "__main__":
    for case in CASES:
        (GOLDEN / f"{case}.txt").write_text(output(case), encoding="utf-8")
