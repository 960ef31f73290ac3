"""The lamp's jump, stated by its model instead of its energies, is the same motion."""

from __future__ import annotations

import numpy as np
import pytest

import stc

MODEL = """
constants:
  k = 1, na = 20*k, nb = 36*k, n = 60*k, T1 = 0.4, T2 = 0.4, T3 = 0.35,
  D = 0.4, mu = 0.6, landing = 100, room = 0.02, umax = 15, wmax = 20,
  l1 = 0.28, l2 = 0.28, mouth = 0.12, rim = 0.09, A1 = -0.733949874893429;
model: "luxo.xml";
definitions:
  [0, na - 1]:  h = T1/na;
  [na, nb - 1]: h = T2/(nb - na);
  [nb, n]:      h = T3/(n - nb);
definitions:
  a1 = joint.hip; a2 = joint.elbow; a3 = joint.neck;
  b3 = a1 + a2 + a3;  c3 = a2 + a3;
  over = l1*cos(a1) + l2*cos(a1 + a2) + mouth*cos(b3);
  ahead = l2*sin(a2) + mouth*sin(c3);
contact:
  sole = foot(geom.foot), reach = 0.8, friction = mu, clearance = 0.01, landing = landing;
  [0, na]: sole at 0;
  [nb, n]: sole at D;
poses:
  stand = keyframe.reference, joint.hip = A1, joint.elbow = 1.5, joint.neck = 1;
constraints:
  [0, n]:
    -umax <= actuator.* <= umax;
    -wmax <= joint.hip' <= wmax; -wmax <= joint.elbow' <= wmax; -wmax <= joint.neck' <= wmax;
    -1.4 <= a1 <= 1.4; 0.15 <= a2 <= 2.6; -0.5 <= a3 <= 2.4; -1 <= joint.pitch <= 1;
    body.upper_arm.z >= 2*room;
    over - rim*sin(b3) >= room;  over + rim*sin(b3) >= room;
    ahead - rim*cos(c3) >= room; ahead + rim*cos(c3) >= room;
  [0]: stand; rest;
  [n]: joint.hip = A1; joint.elbow = 1.5; joint.neck = 1; joint.hip'; joint.elbow'; joint.neck';
guess: [na, nb]: joint.z = 0.1*sin(pi*(i - na)/(nb - na));
objective:
  [0, n]: integral(effort + 1e-3*(actuator.hip'^2 + actuator.elbow'^2 + actuator.neck'^2)
                   + 2e-5*(joint.pitch''^2 + joint.hip''^2 + joint.elbow''^2 + joint.neck''^2));
"""

SAME = {
    "x": "joint.x",
    "z": "joint.z",
    "th": "joint.pitch",
    "a1": "joint.hip",
    "a2": "joint.elbow",
    "a3": "joint.neck",
    "u1": "actuator.hip",
    "u2": "actuator.elbow",
    "u3": "actuator.neck",
    "sole_fz": "sole_fz",
}


@pytest.mark.slow
def test_the_jump_is_the_same_from_energies_and_from_the_model() -> None:
    by_hand = stc.load("luxo_jump").solve(k=1)
    # The jump has several optima close to one another: both are asked for the same one.
    by_model = stc.load(MODEL).solve(guess={model: by_hand[hand] for hand, model in SAME.items()})
    assert by_hand.status == by_model.status == "optimal"
    assert by_model.objective == pytest.approx(by_hand.objective, rel=1e-8)
    for hand, model in SAME.items():
        scale = max(1.0, float(np.abs(by_hand[hand]).max()))
        assert np.abs(by_hand[hand] - by_model[model]).max() < 1e-6 * scale
