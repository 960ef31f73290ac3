"""Every stage of ``stc show`` prints what it is about."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.cli.sparsity import picture
from stc.cli.stages import STAGES, find
from stc.errors import UsageError

SPEC = """\
constants: n = 4, h = 1/n, g = 9.8;
variables: x, f;
constraints:
  x'' = f - g;
  [0]: x; x';
  f <= 20;
objective: integral(f^2);
"""


EXPECTED = {
    "tokens": ["1:1", "constants", "prime"],
    "syntax": ["constants:", "x'' = f - g;"],
    "contact": ["x'' = f - g;"],
    "problem": ["frames 0 to 4", "[0]: x = 0", "integral(f^2)"],
    "nlp": ["decision variables", "quadratic  minimise"],
    "sparsity": ["Jacobian", "Hessian"],
    "ops": ["naive trees", "shared"],
    "tape": ["outputs:"],
    "llvm": ["define "],
}


def test_every_stage_is_tested() -> None:
    assert set(EXPECTED) == set(STAGES)


@pytest.mark.parametrize("stage", EXPECTED)
def test_stage(stage: str) -> None:
    text = find(stage)(stc.load(SPEC), None)
    for piece in EXPECTED[stage]:
        assert piece in text
    assert "Ref(" not in text  # every symbol has a name


def test_the_method_can_be_chosen() -> None:
    assert "trapezoidal" in STAGES["problem"](stc.load(SPEC), "trapezoidal")


def test_contacts_of_a_model_are_no_plain_statements() -> None:
    with pytest.raises(UsageError, match="quadruped_hop takes its contacts from a model"):
        STAGES["contact"](stc.load("quadruped_hop"), None)


def test_an_unknown_stage_gets_the_nearest() -> None:
    with pytest.raises(UsageError, match="tape"):
        find("tap")


def test_operations_are_counted_as_by_hand() -> None:
    # Minimise x^2 subject to x*y = 1 at one frame; x and y are the unknowns.
    from stc.transcription.operations import count_operations

    model = stc.load("constants: n = 0; variables: x, y; constraints: x*y = 1; objective: x^2;")
    counts = count_operations(model.transcription()[1])
    # (x*y)' = x'*y + x*y' takes 3 operations, for each of 2 unknowns; so does (x^2)' = 2*x^1 * x'.
    assert counts["jacobian"].naive_all == 12
    assert counts["jacobian"].naive_own == 9
    # The Jacobian's entries are y and x, the gradient 2*x.
    assert counts["jacobian"].simplified == counts["jacobian"].shared == 1


@pytest.mark.parametrize("name", ["particle_waypoints", "cart_pole_swing_up", "luxo_jump"])
def test_nearly_all_operations_vanish(name: str) -> None:
    """The report of 2001 claims more than 99 % for its problems."""
    from stc.transcription.operations import count_operations

    for count in count_operations(stc.load(name).transcription()[1]).values():
        assert 0 < count.shared <= count.simplified < 0.01 * count.naive_all
        assert count.vanished(count.naive_all) > 0.999
        assert count.vanished(count.naive_own) > 0.9


def test_columns_of_operations_stay_apart() -> None:
    for line in find("ops")(stc.load("luxo_jump"), None).splitlines():
        assert len(line) <= 100
        assert len(line[46:].replace(" %", "").split()) == 2
        assert "100.00" not in line


def test_picture_of_a_small_matrix_is_exact() -> None:
    assert picture(np.array([0, 1, 1]), np.array([0, 0, 2]), (2, 3)).splitlines() == [
        "+---+",
        "|#  |",
        "|# #|",
        "+---+",
    ]


def test_picture_of_a_large_matrix_keeps_every_entry_visible() -> None:
    text = picture(np.array([999]), np.array([0]), (1000, 1000), (10, 10))
    assert text.splitlines()[10] == "|.         |"
    assert "100 x 100" in text


def test_picture_of_nothing() -> None:
    assert picture(np.zeros(0, int), np.zeros(0, int), (0, 3)) == "(empty)"
