"""Every planted fault fails, and the first line of the verdict names a joint and the term that is wrong."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from planted_faults import Fault, faults

import stc
from stc.certification import certify

ALL = {
    name: list(faults(name))
    for name in ("particle_waypoints", "arm_reach", "cart_pole_swing_up", "luxo_poses")
}

TERMS = (
    "gravity|static force|mass matrix entry|velocity product|damping|force of actuator|"
    "the spec states no equation of motion"
)


def check(fault: Fault, folder: Path) -> None:
    model = None
    if fault.model:
        model = folder / "model.xml"
        model.write_text(fault.model)
    solution = stc.load(fault.spec).solve(max_iterations=150)
    certificate = certify(solution, model, force=True)
    assert not certificate.passed
    assert re.match(rf"joint \w+: ({TERMS})", certificate.headline), certificate.headline


def test_there_are_many_and_all_differ() -> None:
    every = [fault for found in ALL.values() for fault in found]
    assert len(every) > 120
    assert len({(fault.spec, fault.model) for fault in every}) == len(every)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ALL)
def test_all(name: str, tmp_path: Path) -> None:
    for fault in ALL[name]:
        try:
            check(fault, tmp_path)
        except AssertionError as error:
            raise AssertionError(f"{fault.what}: {error}") from None
