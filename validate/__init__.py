"""Independent validation: reads a solution file and a MuJoCo model, and knows nothing of the solver.

    from stc.validate import validate

    report = validate("particle_waypoints.npz")
    report.passed, report.metrics, report.to_dict()

MuJoCo is told numbers only: where the joints start, the forces over time, and the model fields that the spec
names.  It never sees the equations of the spec, so that it stays an independent judge of them.
"""

from __future__ import annotations

from stc.validate.metrics import Metric
from stc.validate.model import ModelError
from stc.validate.report import Report
from stc.validate.verdict import NotOptimalError, validate

__all__ = ["Metric", "ModelError", "NotOptimalError", "Report", "validate"]
