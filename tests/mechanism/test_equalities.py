"""Equality constraints: what they hold, its derivatives along a motion, and what their forces are on the joints."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mechanism_models import BALL, FREE, SLIDE, chain, hinge
from mechanism_states import Compared

from stc.mechanism.equalities import held
from stc.symbolic.expr import num

TREE = (FREE.format("root", ""), BALL.format("c", ""), hinge("a"), SLIDE.format("s", 'ref=".2"'))
MODELS = {
    "connect": '<connect body1="b3" body2="b0" anchor=".1 .2 .3"/>',
    "connect to the world": '<connect body1="b3" anchor=".1 .2 .3"/>',
    "connect of sites": '<connect site1="s3" site2="s0"/>',
    "weld": '<weld body1="b3" body2="b1" relpose=".1 .2 .3 .5 .5 -.5 .5" anchor=".1 0 .2"/>',
    "weld that turns": '<weld body1="b3" body2="b1" relpose=".1 .2 .3 .5 .5 -.5 .5" torquescale="0"/>',
    "weld of sites": '<weld site1="s3" site2="s1"/>',
    "joints": '<joint joint1="a" joint2="s" polycoef=".1 .2 .3 .4 .5"/>',
    "one joint": '<joint joint1="a" polycoef=".1"/>',
    "tendons": '<tendon tendon1="t" tendon2="u" polycoef=".1 .2 .3 .4 .5"/>',
}
TENDONS = (
    '<tendon><fixed name="t"><joint joint="a" coef="2"/><joint joint="s" coef="-1"/></fixed>'
    '<spatial name="u"><site site="s0"/><site site="s2"/></spatial></tendon>'
)


def compared(name: str, states: int) -> Compared:
    text = chain(*TREE, rest=f"{TENDONS}<equality>{MODELS[name]}</equality>")
    return Compared(text, states=states)


def efc(m: mujoco.MjModel, d: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo's rows of the equality: their values and Jacobian."""
    m.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    mujoco.mj_makeConstraint(m, d)
    return d.efc_pos.copy(), d.efc_J.reshape(d.nefc, m.nv).copy()


@pytest.mark.parametrize("name", MODELS)
def test_places_rates_and_forces(name: str) -> None:
    """Rows along a line are MuJoCo's; those of a weld's rotation change as its two frames turn."""
    both = compared(name, 50)
    found = held(both.dynamics, both.mechanism.equalities[0])
    count = min(3, len(found.names))
    forces = [0.7, -0.3, 0.4, 0.2, -0.6, 0.5][: len(found.names)]
    acting = both.dynamics.inverse()
    given = found.act([num(force) for force in forces])
    pushed = both.dynamics.inverse(given.wrenches)
    pushed = [force - given.on_dofs.get(dof, num(0.0)) for dof, force in enumerate(pushed)]
    values = both.values([*found.places, *found.rates, *[a - b for a, b in zip(acting, pushed, strict=True)]])
    n = len(found.names)

    def ask(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
        places, jacobian = efc(m, d)
        assert not jacobian[n:].any()
        jacobian = jacobian[:n]
        jacobian[3:] = _turning(m, d, both)[: n - 3] if n > 3 else jacobian[3:]
        return np.concatenate([places[:count], jacobian @ d.qvel, jacobian.T @ forces])

    wanted = both.in_mujoco(ask)
    assert np.abs(values[:count] - wanted[:count]).max() < 1e-11
    assert np.abs(values[n:] - wanted[count:]).max() < 1e-10


def _turning(m: mujoco.MjModel, d: mujoco.MjData, both: Compared) -> np.ndarray:
    """The Jacobian of the difference of the angular velocities of a weld's two things."""
    weld = both.mechanism.equalities[0]
    rows = []
    for index in (weld.first, weld.second):
        jacobian = np.zeros((3, m.nv))
        if weld.between == "site":
            mujoco.mj_jacSite(m, d, None, jacobian, index)
        else:
            mujoco.mj_jacBody(m, d, None, jacobian, index)
        rows.append(jacobian)
    return rows[0] - rows[1]


@pytest.mark.parametrize("name", ["weld", "weld of sites"])
def test_rotation_of_a_weld(name: str) -> None:
    """The rows are its axis times twice the tangent of half the angle; MuJoCo's, times the sine of half the angle."""
    both = compared(name, 50)
    found = held(both.dynamics, both.mechanism.equalities[0])

    axes, values = both.in_mujoco(lambda m, d: efc(m, d)[0][3:]), both.values(found.places[3:])
    cosines = np.sqrt(1 - (axes**2).sum(axis=0))
    along = np.sign(
        (axes * values).sum(axis=0)
    )  # the two may differ in which of the two things they take first
    assert along * values * cosines == pytest.approx(2 * axes, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_accelerations_are_derivatives_of_rates(name: str) -> None:
    """By central differences along the motion."""
    both = compared(name, 20)
    found = held(both.dynamics, both.mechanism.equalities[0])
    values, h = both.values(found.accelerations), 1e-5
    ends = []
    for sign in (1.0, -1.0):
        moved = []
        for state in both.states:
            q, v = state["q"].copy(), state["v"] + sign * h * state["a"]
            mujoco.mj_integratePos(both.model, q, state["v"] + 0.5 * sign * h * state["a"], sign * h)
            moved.append({**state, "q": q, "v": v})
        other = compared(name, 0)
        other.states = moved
        ends.append(other.values(found.rates))
    difference = (ends[0] - ends[1]) / (2 * h)
    assert np.abs(difference - values).max() < 1e-6 * max(1.0, np.abs(values).max())
