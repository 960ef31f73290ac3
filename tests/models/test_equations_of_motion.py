"""The equations that specs state, or that follow from their energies, are MuJoCo's: at random states, to rounding."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
import pytest

import stc
from stc import models
from stc.models.build import descriptions
from stc.models.measures import rewrite
from stc.problem import ConstantRef, Problem, VariableRef
from stc.symbolic.expr import Expr, evaluate

PROBLEMS = Path(__file__).resolve().parents[1] / "problems"

DERIVED = ["arm_reach", "cart_pole_swing_up", "luxo_poses", "luxo_three_poses"]

FREE_LAMP = """
constants: n = 1, g = 9.81;
# measures of luxo
constants: m0, m1, m2, m3, I0, I1, I2, I3, d0, d1, d2, d3, lb, l1, l2;
# end of measures
variables: x, z, p0, a1, a2, a3, u1, u2, u3;
definitions:
  p1 = p0 + a1;  p2 = p1 + a2;  p3 = p2 + a3;
  X1 = x + lb*sin(p0);   Z1 = z + lb*cos(p0);
  X2 = X1 + l1*sin(p1);  Z2 = Z1 + l1*cos(p1);
  X3 = X2 + l2*sin(p2);  Z3 = Z2 + l2*cos(p2);
  x0 = x + d0*sin(p0);   z0 = z + d0*cos(p0);
  x1 = X1 + d1*sin(p1);  z1 = Z1 + d1*cos(p1);
  x2 = X2 + d2*sin(p2);  z2 = Z2 + d2*cos(p2);
  x3 = X3 + d3*sin(p3);  z3 = Z3 + d3*cos(p3);
lagrangian:
  m0/2*(x0'^2 + z0'^2) + I0/2*p0'^2 + m1/2*(x1'^2 + z1'^2) + I1/2*p1'^2
  + m2/2*(x2'^2 + z2'^2) + I2/2*p2'^2 + m3/2*(x3'^2 + z3'^2) + I3/2*p3'^2
  - g*(m0*z0 + m1*z1 + m2*z2 + m3*z3);
forces: a1: u1; a2: u2; a3: u3;
method: trapezoidal;
replay:
  model = "luxo.xml";
  joint x = x; joint z = z; joint pitch = p0; joint hip = a1; joint elbow = a2; joint neck = a3;
  actuator hip = u1; actuator elbow = u2; actuator neck = u3;
"""


def largest_difference(problem: Problem, rows: Mapping[str, Expr], states: int = 1000) -> float:
    """Between equations of motion, by coordinate, and ``mj_inverse``: a share of the largest generalised force.

    The model is the file's own and nothing is handed over from the spec, so that its constants are judged too.
    """
    random = np.random.default_rng(7)
    values: dict[object, object] = {ConstantRef(name): value for name, value in problem.constants.items()}
    drawn = {
        VariableRef(name, order): random.normal(0.0, 2.0, states)
        for name in problem.variables
        for order in range(3)
    }
    residual = {name: evaluate(row, values | drawn) for name, row in rows.items()}
    assert problem.model is not None
    model = mujoco.MjModel.from_xml_path(str(models.locate(problem.model)))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    joints, actuators = ({}, {})
    for line in problem.replay:
        if line.kind == "joint":
            joints[line.body.payload.name] = model.joint(line.path[-1])
        elif line.kind == "actuator":
            actuators[line.body.payload.name] = model.actuator(line.path[-1]).id
    assert set(joints) == set(rows)
    worst = largest = 0.0
    for k in range(states):
        for name, joint in joints.items():
            data.qpos[joint.qposadr[0]] = drawn[VariableRef(name)][k]
            data.qvel[joint.dofadr[0]] = drawn[VariableRef(name, 1)][k]
            data.qacc[joint.dofadr[0]] = drawn[VariableRef(name, 2)][k]
        for name, index in actuators.items():
            data.ctrl[index] = drawn[VariableRef(name)][k]
        mujoco.mj_inverse(model, data)
        mujoco.mj_fwdActuation(model, data)
        rest = data.qfrc_inverse - data.qfrc_actuator
        for name, joint in joints.items():
            worst = max(worst, abs(float(residual[name][k] - rest[joint.dofadr[0]])))
        largest = max(largest, float(np.max(np.abs(data.qfrc_inverse))))
    return worst / largest


def derived_rows(problem: Problem) -> dict[str, Expr]:
    """The rows that come from a Lagrangian, by coordinate."""
    return {relation.coordinate: relation.body for relation in problem.relations if relation.coordinate}


@pytest.mark.parametrize("name", DERIVED)
def test_energies_give_the_models_equations(name: str) -> None:
    problem = stc.load(name).problem()
    assert largest_difference(problem, derived_rows(problem)) < 1e-12


def test_the_equations_by_hand_are_the_models_too() -> None:
    problem = stc.load("arm_reach_by_hand").problem()
    first, second = problem.relations[:2]
    assert largest_difference(problem, {"a1": first.body, "a2": second.body}) < 1e-12


@pytest.fixture(scope="module")
def free_lamp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lamp standing free, its constants filled in as in any spec."""
    path = tmp_path_factory.mktemp("lamp") / "free_lamp.stc"
    known = {description.name: description.measures for description in descriptions()}
    path.write_text(rewrite(FREE_LAMP, known, path.name))
    return path


def test_the_free_lamps_energies_give_its_models_equations(free_lamp: Path) -> None:
    problem = stc.load(free_lamp).problem()
    assert largest_difference(problem, derived_rows(problem)) < 1e-12


@pytest.mark.parametrize("constant", ["m3", "I2", "d3", "l1", "g"])
def test_a_wrong_constant_shows(free_lamp: Path, constant: str) -> None:
    model = stc.load(free_lamp)
    value = model.problem().constants[constant]
    problem = model.problem(**{constant: value * (1 + 1e-6)})
    assert largest_difference(problem, derived_rows(problem), states=50) > 1e-10


def test_energies_and_equations_by_hand_have_the_same_solution() -> None:
    derived, written = stc.load("arm_reach").solve(), stc.load("arm_reach_by_hand").solve()
    assert derived.status == written.status == "optimal"
    assert derived.objective == pytest.approx(written.objective, rel=1e-10)
    for name in ("a1", "a2", "u1", "u2"):
        np.testing.assert_allclose(derived[name], written[name], atol=1e-6)


def test_a_bob_without_size_makes_kellys_problem() -> None:
    expected = json.loads((PROBLEMS / "traj" / "expected.json").read_text())["cart_pole.stc"]
    solution = stc.load("cart_pole_swing_up").solve(I2=0.0)
    assert solution.objective == pytest.approx(expected["objective"], rel=1e-6)


def test_a_motion_and_its_reverse_cost_the_same() -> None:
    # Torques at rest poses do not know the direction of time: swap the poses and the same path runs backwards.
    spec = stc.load("luxo_poses")
    forth = spec.solve()
    poses = {name: forth.constants[name] for name in ("A1", "A2", "A3", "B1", "B2", "B3")}
    back = spec.solve(**{name.translate({65: 66, 66: 65}): value for name, value in poses.items()})
    assert back.objective == pytest.approx(forth.objective, rel=1e-8)
    np.testing.assert_allclose(back["a1"][::-1], forth["a1"], atol=1e-6)
