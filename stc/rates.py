"""Time derivatives and one-sided values of expressions whose symbols are the references of a problem."""

from __future__ import annotations

from dataclasses import replace

from stc.problem import DefinitionRef, TimeRef, VariableRef
from stc.symbolic.differentiate import total_derivative
from stc.symbolic.expr import ONE, ZERO, Expr, substitute, sym, symbols


def rate(key: object) -> Expr:
    """The time derivative of a symbol, as the language defines primes.

    A variable, at whatever frame, gives its next derivative there; ``t`` gives 1, constants and parameters 0.
    The index of the frame has none; elaboration refuses its prime, so it counts as 0 here.
    """
    if isinstance(key, VariableRef | DefinitionRef):
        return sym(replace(key, order=key.order + 1))
    return ONE if isinstance(key, TimeRef) else ZERO


def time_derivative(e: Expr, order: int) -> Expr:
    """The total time derivative of the given order, by the chain rule."""
    for _ in range(order):
        e = total_derivative(e, rate)
    return e


def one_sided(e: Expr, side: str) -> Expr:
    """``before(e)`` or ``after(e)``: every variable and ranged definition in it read on that side."""
    keys = [k for k in symbols(e) if isinstance(k, VariableRef | DefinitionRef) and k.side != side]
    return substitute(e, {k: sym(replace(k, side=side)) for k in keys}) if keys else e
