"""Simplification: the rule table, and the rules by the operators that they apply to."""

from stc.symbolic.rules import functions, products, sums
from stc.symbolic.rules.table import RULES, Rule, collect

__all__ = ["RULES", "Rule", "collect", "functions", "products", "sums"]
