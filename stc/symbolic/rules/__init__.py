"""Simplification: the rule table, and the rules by the operators that they apply to."""

from stc.symbolic.rules import functions, products, sums
from stc.symbolic.rules.table import RULES, Rule, coefficient, collect

__all__ = ["RULES", "Rule", "coefficient", "collect", "functions", "products", "sums"]
