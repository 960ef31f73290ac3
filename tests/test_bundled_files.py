"""What ships with stc can be found by name, and says what it is."""

from __future__ import annotations

import re

import pytest

import stc
from stc import models, specs
from stc.cli.inputs import number
from stc.testing import assert_physical

#: What the heads of the specs suggest to try.
SUGGESTED = [
    pytest.param(name, dict(re.findall(r"--set (\w+)=(\S+)", line)), id=line.strip("# ").partition("  ")[0])
    for name in specs.names()
    for line in stc.load(name).text.splitlines()
    if re.match(rf"#\s+stc run {name} --set", line)
]


def test_specs_are_found_with_and_without_their_ending() -> None:
    assert {"particle_waypoints", "particle_jet"} <= set(specs.names())
    path = specs.locate("particle_jet")
    assert path is not None
    assert path == specs.locate("particle_jet.stc")
    assert specs.locate("particle") is None
    assert specs.locate("../specs/particle_jet") is None


@pytest.mark.parametrize("name", specs.names())
def test_every_spec_has_a_title_and_its_model_and_reads_without_a_warning(name: str) -> None:
    title, problem = specs.title(name), stc.load(name).problem()
    assert 10 < len(title) < 100
    assert not title.endswith(".")
    assert not problem.warnings
    assert problem.model is None or models.locate(problem.model) is not None


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "given"), SUGGESTED)
def test_what_a_spec_suggests_to_try_is_validated(name: str, given: dict[str, str]) -> None:
    solution = stc.load(name).solve(**{key: number(value, key) for key, value in given.items()})
    assert solution.status == "optimal"
    assert_physical(solution)


def test_unknown_names_are_not_found() -> None:
    with pytest.raises(KeyError):
        specs.title("none")
    assert models.locate("none") is None
    assert models.locate("particle") == models.locate("particle.xml")
