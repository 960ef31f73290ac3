"""Every smooth term of the equations of motion, each in a small model, against MuJoCo at random states."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_models import TERMS as MODELS
from mechanism_states import Compared, actuation, inverse, relative_error


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", MODELS)
def test_forces_are_mujocos(name: str) -> None:
    """Inverse dynamics, passive forces and actuators' forces, to 1e-9 of the largest of each."""
    both = Compared(MODELS[name])
    dyn, nv = both.dynamics, both.model.nv
    found = both.values([*dyn.inverse(), *dyn.passive_forces(), *dyn.actuation()])
    wanted = np.vstack(
        [both.in_mujoco(inverse), both.in_mujoco(lambda m, d: d.qfrc_passive), both.in_mujoco(actuation)]
    )
    for rows in (slice(0, nv), slice(nv, 2 * nv), slice(2 * nv, None)):
        assert relative_error(found[rows], wanted[rows]) < 1e-9


@pytest.mark.parametrize("name", MODELS)
def test_residual_is_what_is_missing(name: str) -> None:
    """The residual is the force that the accelerations take less that of the actuators."""
    both = Compared(MODELS[name], states=50)
    found = both.values(both.dynamics.residual())
    wanted = both.in_mujoco(inverse) - both.in_mujoco(actuation)
    assert relative_error(found, wanted) < 1e-9


#: Without actuation, MuJoCo leaves the actuators' rates as they were.
ACTUATED = [name for name, text in MODELS.items() if "<actuator>" in text and name != "no actuation"]


@pytest.mark.parametrize("name", ACTUATED)
def test_actuators_lengths_forces_and_states_are_mujocos(name: str) -> None:
    """Each actuator by itself: its length, rate and force, and how its state changes."""
    both = Compared(MODELS[name], states=200)
    dyn, m = both.dynamics, both.model

    def ask(m, d):  # type: ignore[no-untyped-def]
        actuation(m, d)
        return [*d.actuator_length, *d.actuator_velocity, *d.actuator_force, *d.act_dot]

    found = both.values(
        [*[line.length for line in dyn.lines], *[line.rate for line in dyn.lines], *dyn.actuator_forces]
        + dyn.activation_rates
    )
    wanted = both.in_mujoco(ask)
    assert len(found) == 3 * m.nactuator + m.na
    assert np.abs(found - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())
