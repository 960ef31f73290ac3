"""A motion that every test of the viewer may show: solved once."""

from functools import cache

from stc.pipeline import load
from stc.solution import Solution

#: A ball that is pushed from rest to rest in half a second, seen from the side.
PUSH = """
constants:
  n = 8,                 # steps
  T = 0.5,               # s
  h = T/n,
  m = 1, d = 0.3;        # m, how far
variables: x, f;
constraints:
  [0, n]: m*x'' = f;
  [0]: x; x';
  [n]: x = d; x';
  [0, n]: -40 <= f <= 40;
objective:
  [0, n]: integral(f^2);
method: hermite-simpson;
replay:
  model = "particle.xml";
  joint x = x;
  actuator fx = f;
  set body.particle.mass = m;
  set option.gravity.z = 0;
"""


@cache
def push() -> Solution:
    """The solved motion."""
    return load(PUSH).solve()


@cache
def jump() -> Solution:
    """The lamp's jump on few frames: contact, impacts and torques."""
    return load("luxo_jump").solve(k=1)
