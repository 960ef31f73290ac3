"""Nonlinear optimisation that knows nothing of where its problems come from."""

from stc.solver.nlp import NLP
from stc.solver.options import Options
from stc.solver.report import Callback, IterationRecord, Result, Start
from stc.solver.sqp import minimize
from stc.solver.status import Status

__all__ = ["NLP", "Callback", "IterationRecord", "Options", "Result", "Start", "Status", "minimize"]
