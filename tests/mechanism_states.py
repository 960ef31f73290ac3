"""Expressions of a mechanism, and what MuJoCo computes for the same random states of motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from tape_reference import run

from stc.codegen.tape import build_tape
from stc.mechanism.dynamics import Dynamics
from stc.mechanism.kinematics import Motion
from stc.mechanism.mechanism import Mechanism
from stc.mechanism.numbers import Numbers
from stc.mechanism.read import read_model
from stc.model_source import opened
from stc.symbolic.expr import Expr, sym

#: What of a state is given to expressions, in this order.
PARTS = ("q", "v", "a", "u", "z")


def symbols_of(mechanism: Mechanism) -> dict[str, list[Expr]]:
    """A symbol for every coordinate, velocity, acceleration, control and activation."""
    m = mechanism
    counts = (m.n_coordinates, m.n_freedoms, m.n_freedoms, m.n_controls, m.n_activations)
    return {
        part: [sym(f"{part}{k}") for k in range(count)] for part, count in zip(PARTS, counts, strict=True)
    }


def dynamics_of(mechanism: Mechanism, numbers: Numbers | None = None) -> Dynamics:
    """The mechanism's expressions in these symbols."""
    s = symbols_of(mechanism)
    return Dynamics(mechanism, Motion(s["q"], s["v"], s["a"]), s["u"], s["z"], numbers)


class Compared:
    """A model twice: as expressions, and in MuJoCo without constraints; and random states of it.

    Angles of ball joints, and of the controls that are angles, stay below ``most`` rad, coordinates are normal
    numbers, velocities and accelerations three times that.
    """

    def __init__(
        self,
        source: str | Path,
        states: int = 1000,
        seed: int = 0,
        most: float = 3.0,
        additions: Sequence[str] = (),
    ) -> None:
        if isinstance(source, Path):
            self.mechanism = read_model(source, additions=additions)
            self.model = opened(source, additions).model
        else:
            self.mechanism = read_model("model.xml", text=source)
            self.model = mujoco.MjModel.from_xml_string(source)
        m = self.model
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        m.opt.enableflags = 0
        m.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
        for limited in (m.actuator_forcelimited, m.jnt_actfrclimited, m.tendon_actfrclimited):
            limited[:] = 0  # the expressions hold inside the limits
        m.actuator_actearly[:] = 0  # and at infinitely small time steps
        self.data = mujoco.MjData(m)
        self.dynamics = dynamics_of(self.mechanism)
        rng = np.random.default_rng(seed)
        self.states = [self._state(rng, most) for _ in range(states)]

    def _state(self, rng: np.random.Generator, most: float) -> dict[str, np.ndarray]:
        m = self.model
        q = rng.normal(size=m.nq)
        for joint in self.mechanism.joints:
            if joint.kind in ("ball", "free"):
                axis, angle = rng.normal(size=3), rng.uniform(-most, most)
                at = joint.coordinates[-4]
                mujoco.mju_axisAngle2Quat(q[at : at + 4], axis / np.linalg.norm(axis), angle)
        v, a = 3.0 * rng.normal(size=(2, m.nv))
        u = rng.uniform(-1.0, 1.0, m.nu)
        for k in np.flatnonzero(m.actuator_ctrllimited):
            u[k] = rng.uniform(*m.actuator_ctrlrange[k])
        return {"q": q, "v": v, "a": a, "u": u, "z": rng.uniform(-1.0, 1.0, m.na)}

    @cached_property
    def inputs(self) -> np.ndarray:
        """One column for each state."""
        return np.array([np.concatenate([state[part] for part in PARTS]) for state in self.states]).T

    def values(self, expressions: Sequence[Expr]) -> np.ndarray:
        """The values of expressions: a row for each, a column for each state."""
        keys = [e.payload for part in symbols_of(self.mechanism).values() for e in part]
        return run(build_tape(list(expressions), [], keys), [], self.inputs)

    def in_mujoco(self, ask: Callable[[mujoco.MjModel, mujoco.MjData], Sequence[float]]) -> np.ndarray:
        """What ``ask`` reads from MuJoCo at the states, in the same order; positions and velocities are computed."""
        m, d = self.model, self.data
        found = []
        for state in self.states:
            d.qpos[:], d.qvel[:], d.qacc[:] = state["q"], state["v"], state["a"]
            d.ctrl[:], d.act[:] = state["u"], state["z"]
            mujoco.mj_fwdPosition(m, d)
            mujoco.mj_fwdVelocity(m, d)
            found.append(np.array(ask(m, d), dtype=float).ravel())
        return np.array(found).T


def inverse(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
    """The forces that the accelerations take."""
    mujoco.mj_inverse(m, d)
    return d.qfrc_inverse.copy()


def actuation(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
    """The forces of the actuators on every degree of freedom."""
    mujoco.mj_fwdActuation(m, d)
    return d.qfrc_actuator.copy()


def relative_error(found: np.ndarray, wanted: np.ndarray) -> float:
    """The largest difference at any state in the size of the largest value there, or of 1e-3 of that anywhere."""
    sizes = np.abs(wanted).max(axis=0)
    return float((np.abs(found - wanted).max(axis=0) / np.maximum(sizes, 1e-3 * sizes.max() + 1e-300)).max())
