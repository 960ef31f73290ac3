"""Which way rows bend, against second derivatives at random points."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.transcription.bind import BoundProgram

TEXT = """
    constants: n = 4, a = 3, b = -2;
    variables: x, y, z;
    definitions: h = 0.1;
    constraints:
        [0, n]: STATEMENT;
    objective: [0, n]: x + y + z;
"""


def bound(statement: str, **constants: float) -> BoundProgram:
    _, transcription = stc.load(TEXT.replace("STATEMENT", statement)).transcription()
    transcription.compile(backend="interpreter")
    return transcription.bind({**transcription.problem.constants, **constants}, check=False)


def measured(nlp: BoundProgram, row: int) -> set[int]:
    """Which ways a row may bend, by the eigenvalues of its second derivatives at some points."""
    rng = np.random.default_rng(row)
    ways = {1, -1}
    for _ in range(5):
        y = np.zeros(nlp.m)
        y[row] = 1.0
        _, _, entries = nlp.derivatives(rng.uniform(0.5, 2.0, nlp.n), y, 0.0)
        matrix = np.zeros((nlp.n, nlp.n))
        matrix[nlp.hess_rows, nlp.hess_cols] = matrix[nlp.hess_cols, nlp.hess_rows] = entries
        eigenvalues = np.linalg.eigvalsh(matrix)
        if eigenvalues[0] < -1e-9:
            ways.discard(1)
        if eigenvalues[-1] > 1e-9:
            ways.discard(-1)
    return ways


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ("x^2 + y^2 <= 4", {1}),
        ("(x - a*y)^2/a + 2*z <= 4", {1}),
        ("b*(x + y)^2 - z^2 >= -9", {-1}),
        ("x*y <= 1", {0}),
        ("x^2 - y^2 + z <= 1", {0}),
        ("x^2 + 2*x*y + y^2 <= 1", {1}),
        ("x^2 + 2.1*x*y + y^2 <= 1", {0}),
        ("(i - 1.5)*x^2 + y <= 1", {1, -1}),
        ("(2*i - n)*x^2 <= 1", {1, -1}),
        ("exp(x) + y <= 4", {0}),
        ("x^4 <= 1", {0}),
        ("x + a*y >= z", {1}),
    ],
)
def test_rows_bend_as_their_second_derivatives_tell(statement: str, expected: set[int]) -> None:
    nlp = bound(statement)
    bends = nlp.row_bends()
    assert bends.shape == (nlp.m,) and nlp.m >= 4
    assert set(bends.tolist()) == expected
    for row, bend in enumerate(bends.tolist()):
        if bend:
            assert bend in measured(nlp, row)


def test_they_do_so_for_the_constants_at_hand() -> None:
    assert (bound("b*x^2 + y <= 1").row_bends() == -1).all()
    assert (bound("b*x^2 + y <= 1", b=2.0).row_bends() == 1).all()


def test_one_unknown_in_two_places_counts_as_one() -> None:
    """At the middle frame ``x[n - i]*x`` is a square, elsewhere it is neither."""
    bends = bound("x[n - i]*x <= 1").row_bends()
    assert not bends.any()  # not known to be one, which is safe
