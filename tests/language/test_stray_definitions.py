"""A definition that came under the range header of another one is told as such, once."""

from __future__ import annotations

import pytest

from stc.errors import Source, SpecError
from stc.language import read_problem

TEXT = """
constants: n = 20, k = 10; variables: x, z;
definitions:
  e = 0.1;
  [k, n - 1]: {block}
lagrangian: x'^2/2 + {used}'^2/2;
constraints: [0]: x; z; {used} = 1; [n]: x = 1;
objective: integral({used}^2);
"""


def mistakes(block: str, used: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        read_problem(Source("case", TEXT.format(block=block, used=used)))
    return [f"{d.span.line}: {d.message}" for d in caught.value.diagnostics]


def test_the_definition_is_blamed_and_not_its_uses() -> None:
    assert mistakes("e = 0.2; zt = z + e;", "zt") == [
        "5: `zt` is defined on [10, 19] only, since it stands under that range header"
    ]


def test_a_definition_that_has_the_header_to_itself_is_blamed_where_it_is_used() -> None:
    found = mistakes("zt = z + e;", "zt")
    assert len(found) == 3
    assert all("differs between frames" in each or "no definition of it holds" in each for each in found)


def test_before_the_header_it_holds_everywhere() -> None:
    text = TEXT.replace("e = 0.1;", "e = 0.1; zt = z + 1;").format(block="e = 0.2;", used="zt")
    read_problem(Source("case", text))
