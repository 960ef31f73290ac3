"""What ships with stc can be found by name, and says what it is."""

from __future__ import annotations

import pytest

import stc
from stc import models, specs


def test_specs_are_found_with_and_without_their_ending() -> None:
    assert {"particle_waypoints", "particle_jet"} <= set(specs.names())
    path = specs.locate("particle_jet")
    assert path is not None
    assert path == specs.locate("particle_jet.stc")
    assert specs.locate("particle") is None
    assert specs.locate("../specs/particle_jet") is None


@pytest.mark.parametrize("name", specs.names())
def test_every_spec_has_a_title_and_reads_without_a_warning(name: str) -> None:
    title = specs.title(name)
    assert 10 < len(title) < 100
    assert not title.endswith(".")
    assert not stc.load(name).problem().warnings


@pytest.mark.parametrize("name", specs.names())
def test_every_model_that_a_spec_names_is_bundled(name: str) -> None:
    model = stc.load(name).problem().model
    assert model is None or models.locate(model) is not None


def test_unknown_names_are_not_found() -> None:
    with pytest.raises(KeyError):
        specs.title("none")
    assert models.locate("none") is None
    assert models.locate("particle") == models.locate("particle.xml")
