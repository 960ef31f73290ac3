"""Independent validation of a solution file in MuJoCo; this package does not import the solver.

    from stc.validate import validate

    report = validate("particle_waypoints.npz")
    report.passed, report.metrics, report.to_dict()

MuJoCo receives numbers only: the initial positions of the joints, the forces over time, and the model fields that the
spec sets.  It never receives the equations of the spec, so that it is an independent check of them.
"""

from __future__ import annotations

from stc.validate.metrics import Metric
from stc.validate.model import ModelError
from stc.validate.report import Report
from stc.validate.verdict import NotOptimalError, validate

__all__ = ["Metric", "ModelError", "NotOptimalError", "Report", "validate"]
