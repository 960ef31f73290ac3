"""Distances between geoms, against MuJoCo's mj_geomDistance at random poses."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
import pytest

from stc.mechanism.dynamics import Dynamics
from stc.mechanism.kinematics import Motion
from stc.mechanism.read import read_model
from stc.mechanism.separation import separation
from stc.problem import VariableRef
from stc.symbolic.expr import Expr, evaluate_all, num, sym

SHAPES = {"sphere": "0.1", "capsule": "0.05 0.3", "box": "0.1 0.2 0.3", "plane": "1 1 1"}
PAIRS = [pair for pair in itertools.combinations_with_replacement(SHAPES, 2) if pair != ("plane", "plane")]
KINKED = [pair for pair in PAIRS if "plane" not in pair and pair != ("sphere", "sphere")]
POSES = 200


def model_of(first: str, second: str) -> str:
    """Two geoms: one behind a ball joint on a free body, the other fixed in that body, or a tilted plane."""
    fixed = (
        f'<geom name="b" type="{second}" size="{SHAPES[second]}" pos=".1 .2 -.1" euler="20 -30 40" mass="1"/>'
    )
    moving = f'<geom name="a" type="{first}" size="{SHAPES[first]}" pos=".4 0 .1" euler="10 20 30" mass="1"/>'
    ball = f'<body pos=".3 0 0"><joint type="ball"/>{moving}</body>'
    outside, inside = (fixed, '<geom size=".01" mass="1"/>') if second == "plane" else ("", fixed)
    return f"<mujoco><worldbody>{outside}<body><freejoint/>{inside}{ball}</body></worldbody></mujoco>"


class Posed:
    """Two geoms at random poses, for MuJoCo and as expressions.

    Attributes:
        distances: MuJoCo's, (k,).
        apart: what lies between them.
    """

    def __init__(self, first: str, second: str, seed: int) -> None:
        text = model_of(first, second)
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        q = np.random.default_rng(seed).normal(size=(POSES, model.nq))
        for k in (3, 7):
            q[:, k : k + 4] /= np.linalg.norm(q[:, k : k + 4], axis=1, keepdims=True)
        self.q = q
        self.distances = np.empty(POSES)
        geoms = model.geom("a").id, model.geom("b").id
        for k in range(POSES):
            data.qpos[:] = q[k]
            mujoco.mj_kinematics(model, data)
            self.distances[k] = mujoco.mj_geomDistance(model, data, *geoms, 10.0, np.zeros(6))
        still = [num(0.0)] * model.nv
        symbols = [sym(VariableRef(f"q{k}")) for k in range(model.nq)]
        dynamics = Dynamics(read_model("two.xml", text), Motion(symbols, still, still))
        self.apart = separation(dynamics, *geoms)

    def values(self, expressions: Sequence[Expr], **more: np.ndarray) -> np.ndarray:
        """A row for each expression, a column for each pose."""
        known = {VariableRef(f"q{k}"): column for k, column in enumerate(self.q.T)}
        known |= {VariableRef(name): value for name, value in more.items()}
        return np.array([np.broadcast_to(v, POSES) for v in evaluate_all(list(expressions), known)])

    @property
    def clear(self) -> np.ndarray:
        """Where the shapes do not overlap: how deep they do MuJoCo estimates only."""
        return self.distances > (-np.inf if self.apart.normal is not None else 1e-4)


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_the_bound_is_below_the_distance_and_near_it(pair: tuple[str, str]) -> None:
    posed = Posed(*pair, 3)
    bounds = posed.values([posed.apart.lower_bound(), posed.apart.value()])
    assert posed.clear.sum() > 50
    rough, fine = (posed.distances - bounds)[:, posed.clear]
    assert min(rough.min(), fine.min()) > -1e-6
    assert np.median(rough) < (1e-9 if posed.apart.is_smooth else 0.03)
    assert fine.max() < 1e-3


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("pair", KINKED, ids="-".join)
def test_the_best_direction_sees_the_distance(pair: tuple[str, str]) -> None:
    """The gap of any unit vector is at most the distance, that along the shortest way is the distance."""
    posed = Posed(*pair, 4)
    n = [sym(VariableRef(f"n{axis}")) for axis in "xyz"]
    widths = [sym(VariableRef(f"w{k}")) for k in range(1, len(posed.apart.halves))]
    far = posed.distances > 1e-2
    assert far.sum() > 50
    nearest = posed.values(posed.apart.direction(1e-6, 300))
    other = np.random.default_rng(5).normal(size=(3, POSES))
    for direction, reached in ((nearest, True), (other / np.linalg.norm(other, axis=0), False)):
        known = {f"n{axis}": part for axis, part in zip("xyz", direction)}
        seen = np.abs(posed.values(posed.apart.widths(n), **known))
        known |= {f"w{k}": seen[k] for k in range(1, len(seen))}
        gaps = posed.values(posed.apart.gaps(n, widths), **known).min(axis=0)
        assert (gaps <= posed.distances + 1e-6)[far].all()
        if reached:
            assert np.quantile(np.abs(gaps - posed.distances)[far], 0.95) < 1e-5


@pytest.mark.parametrize("shape", ["sphere", "capsule", "box"])
def test_the_lowest_corner_is_at_the_distance_of_a_plane(shape: str) -> None:
    posed = Posed(shape, "plane", 6)
    found = posed.values(posed.apart.corners()).min(axis=0)
    assert np.abs(found - posed.distances).max() < 1e-9


def test_other_shapes_have_no_distance() -> None:
    text = '<mujoco><worldbody><geom name="a" type="cylinder" size=".1 .1"/><geom size=".1"/></worldbody></mujoco>'
    dynamics = Dynamics(read_model("two.xml", text), Motion([], [], []))
    with pytest.raises(ValueError, match="the geom `a` is a cylinder"):
        separation(dynamics, 0, 1)
