"""Short ways to read specs in tests, and to write the expressions that are expected."""

from __future__ import annotations

from fractions import Fraction

from stc.errors import Source, SpecError
from stc.language import read_problem
from stc.problem import ConstantRef, DefinitionRef, IndexRef, ParameterRef, Problem, TimeRef, VariableRef
from stc.symbolic.expr import Expr, sym


def problem_of(text: str, method: str | None = None, **constants: float) -> Problem:
    """The problem that a text states, with constants from outside."""
    return read_problem(Source("test.stc", text), constants, method)


def messages_of(text: str, method: str | None = None, **constants: float) -> list[str]:
    """The messages of all mistakes in a text, without places and excerpts."""
    try:
        problem_of(text, method, **constants)
    except SpecError as error:
        return [diagnostic.message for diagnostic in error.diagnostics]
    return []


def warnings_of(text: str, method: str | None = None, **constants: float) -> list[str]:
    """The messages of all warnings about a text."""
    return [diagnostic.message for diagnostic in problem_of(text, method, **constants).warnings]


def body_of(expression: str, extra: str = "", method: str = "trapezoidal", n: int = 60) -> Expr:
    """An expression in the names x, y, u (variables), T (parameter), m, g, l (constants), as elaborated."""
    text = f"""constants: n = {n}, m = 2, g = 9.8, l = 0.5;
    variables: x, y, u;  parameters: T;  method: {method};  {extra}
    constraints: [1, n - 1]: {expression};"""
    (relation,) = problem_of(text).relations
    return relation.body


def c(name: str) -> Expr:
    """A constant."""
    return sym(ConstantRef(name))


def p(name: str) -> Expr:
    """A parameter."""
    return sym(ParameterRef(name))


def v(
    name: str, order: int = 0, scale: Fraction | int = 1, shift: Fraction | int = 0, side: str = ""
) -> Expr:
    """A variable or a derivative of it at frame ``scale*i + shift``."""
    return sym(VariableRef(name, order, scale, shift, side))


def d(name: str, order: int = 0, side: str = "") -> Expr:
    """A definition that stands under range headers."""
    return sym(DefinitionRef(name, order, side))


t = sym(TimeRef())
i = sym(IndexRef())
