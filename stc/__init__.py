"""Spacetime constraints: state a motion as constraints and an objective, solve it, and have MuJoCo judge it."""

__version__ = "0.1.0"
