"""Constraints to bounded bodies, and objective statements to plain and integral terms."""

from __future__ import annotations

import math
from collections.abc import Callable

from stc.errors import Span
from stc.language import syntax
from stc.language.expressions import ExpressionBuilder
from stc.problem import ConstantRef, FrameRange, ParameterRef, Relation
from stc.records import dataclass
from stc.symbolic.expr import ONE, ZERO, Expr, div, mul, neg, sub, sum_of, symbols

#: So many integrals a statement of the objective may come to.
MOST_INTEGRALS = 10_000


@dataclass(slots=True)
class Bounded:
    """``lower <= body <= upper``; None means no bound, the same object twice an equality."""

    body: Expr
    lower: Expr | None
    upper: Expr | None


def infinite(node: syntax.Expression) -> float:
    """``inf`` or ``-inf`` for these words alone, else 0."""
    if isinstance(node, syntax.Name) and node.name == "inf":
        return math.inf
    return -infinite(node.operand) if isinstance(node, syntax.Negate) else 0.0


def complementary_relations(
    one: Expr, other: Expr, where: FrameRange, span: Span, text: str
) -> list[Relation]:
    """``0 <= one complements other >= 0`` on a range: both inequalities, then their product.

    They must stay adjacent, in this order, in ``Problem.relations``, from which the solver finds the sides of a product
    (:mod:`stc.transcription.pairs`).
    """
    sides = [Relation(side, ZERO, None, where, span, text) for side in (one, other)]
    return [*sides, Relation(mul(one, other), None, ZERO, where, span, text, complementary=True)]


class Relations:
    """Splits relations into bounded expressions; ``is_fixed`` recognises expressions that are known at every frame
    before solving.
    """

    def __init__(self, builder: ExpressionBuilder, is_fixed: Callable[[Expr], bool]) -> None:
        self.builder = builder
        self.is_fixed = is_fixed

    def split(self, node: syntax.Relation) -> list[Bounded]:
        """The bounded expressions of a statement; mistakes are added in the builder."""
        builder = self.builder
        operators = node.operators
        if len(set(operators)) > 1 or operators.count("=") > 1:
            hint = "a chain is `lo <= e <= hi` or `hi >= e >= lo`; write separate statements"
            mixed = "`=` cannot be chained" if "=" in operators else "this chain points both ways"
            builder.fail(node, mixed, hint)
        if any(isinstance(operand, syntax.Vector) for operand in node.operands):
            builder.fail(node, "an expression is a number, not a vector", self._components(node))
            return []
        sides: list[Expr | float] = []
        for operand in node.operands:
            size = infinite(operand)
            sides.append(size if size and operators else builder.build(operand))
        if builder.poisoned:
            return []
        if not operators:
            assert isinstance(sides[0], Expr)
            return [Bounded(sides[0], ZERO, ZERO)]
        found: list[Bounded] = []
        for place, operator in enumerate(operators):
            left, right = sides[place], sides[place + 1]
            if operator == ">=":
                pair = self._pair(node, right, "<=", left, swapped=True)
            else:
                pair = self._pair(node, left, operator, right, swapped=False)
            if pair is None:
                continue
            known = next((b for b in found if b.body is pair.body), None)
            if known is not None and known.lower is None and pair.upper is None:
                known.lower = pair.lower
            elif known is not None and known.upper is None and pair.lower is None:
                known.upper = pair.upper
            else:
                found.append(pair)
        return found

    def _components(self, node: syntax.Relation) -> str:
        """The hint for a relation of vectors: a relation for each component."""
        source = self.builder.diagnostics.source
        sizes = {len(operand.items) for operand in node.operands if isinstance(operand, syntax.Vector)}
        if len(sizes) > 1:
            return "its sides have other numbers of components than each other"
        rows = []
        for k in range(sizes.pop()):
            parts = []
            for operand in node.operands:
                if isinstance(operand, syntax.Vector):
                    parts.append(syntax.statement_text(source, operand.items[k]))
                elif isinstance(operand, syntax.Name):
                    parts.append(f"{operand.name}{k + 1}")
                elif isinstance(operand, syntax.Prime) and isinstance(operand.operand, syntax.Name):
                    parts.append(f"{operand.operand.name}{k + 1}" + "'" * operand.order)
                else:
                    parts.append(syntax.statement_text(source, operand))
            row = parts[0]
            for operator, part in zip(node.operators, parts[1:]):
                row += f" {operator} {part}"
            rows.append(row + (";" if node.operators else " = 0;"))
        return f"state each component by itself: `{' '.join(rows)}`"

    def _pair(
        self, node: syntax.Relation, left: Expr | float, operator: str, right: Expr | float, *, swapped: bool
    ) -> Bounded | None:
        """``left <= right`` or ``left = right``; ``swapped`` if the text has ``right >= left``."""
        if isinstance(left, float) or isinstance(right, float):
            if operator == "=":
                self.builder.fail(node, "nothing equals `inf`", "`inf` is a bound: `e <= inf`")
            elif left == math.inf or right == -math.inf:
                self.builder.fail(
                    node, "no number satisfies this", "an absent upper bound is `inf`, a lower one `-inf`"
                )
            return None
        if self.is_fixed(right):
            return Bounded(left, right if operator == "=" else None, right)
        if self.is_fixed(left):
            return Bounded(right, left, left if operator == "=" else None)
        if operator == "=":
            return Bounded(sub(left, right), ZERO, ZERO)
        # the difference is taken in the order of the text
        return Bounded(sub(right, left), ZERO, None) if swapped else Bounded(sub(left, right), None, ZERO)


@dataclass(slots=True)
class Summand:
    """One objective term multiplied by its factor."""

    body: Expr
    integral: bool


class Objective:
    """Splits objective statements into terms; ``formulas`` are the unranged definitions by name."""

    def __init__(self, builder: ExpressionBuilder, formulas: dict[str, syntax.Expression]) -> None:
        self.builder = builder
        self.formulas = formulas

    def holds_integral(self, node: syntax.Expression) -> bool:
        """Whether the syntax contains an integral, also within definitions."""
        return any(
            (isinstance(part, syntax.Call) and part.function == "integral")
            or (isinstance(part, syntax.Name) and part.name in self.builder.integral_definitions)
            for part in syntax.walk(node)
        )

    def split(self, node: syntax.Expression) -> list[Summand]:
        """The integral terms in the order of the text, then the rest as one plain term (if there is any)."""
        if not self.holds_integral(node):
            body = self.builder.build(node)
            return [] if self.builder.poisoned else [Summand(body, False)]
        plain: list[Expr] = []
        integrals: list[Expr] = []
        self._split(node, plain, integrals)
        if self.builder.poisoned:
            return []
        found = [Summand(body, True) for body in integrals]
        return [*found, Summand(sum_of(plain), False)] if plain else found

    def _split(self, whole: syntax.Expression, plain: list[Expr], integrals: list[Expr]) -> None:
        """Split a sum, also through chains of definitions of any length."""
        builder = self.builder
        waiting: list[tuple[syntax.Expression, Expr]] = [(whole, ONE)]
        while waiting and not builder.poisoned:
            node, factor = waiting.pop()
            if not self.holds_integral(node):
                plain.append(mul(factor, builder.build(node)))
            elif isinstance(node, syntax.Sum):
                terms = [(term, factor if sign == "+" else neg(factor)) for sign, term in node.terms]
                waiting += reversed(terms)
            elif isinstance(node, syntax.Negate):
                waiting.append((node.operand, neg(factor)))
            elif isinstance(node, syntax.Product):
                waiting += self._product(node, factor)
            elif isinstance(node, syntax.Name):
                builder.table.entries[node.name].used = True
                waiting.append((self.formulas[node.name], factor))
            elif isinstance(node, syntax.Call) and node.function == "integral":
                if len(integrals) == MOST_INTEGRALS:
                    message = f"the objective comes to more than {MOST_INTEGRALS} integrals"
                    builder.fail(whole, message, "each use of a definition repeats the integrals in it")
                    return
                self._integral(node, factor, integrals)
            else:
                builder.build(node)  # notes the integral that cannot stand there

    def _product(self, node: syntax.Product, factor: Expr) -> list[tuple[syntax.Expression, Expr]]:
        """The integral in a product, and the product of the other factors; nothing after a mistake."""
        builder = self.builder
        holding = [(operator, part) for operator, part in node.factors if self.holds_integral(part)]
        if len(holding) > 1 or holding[0][0] == "/":
            what = (
                "integrals cannot be multiplied"
                if len(holding) > 1
                else "nothing can be divided by an integral"
            )
            builder.fail(
                node,
                what,
                "an objective is a sum of integrals, each with a factor of constants and parameters",
            )
            return []
        for operator, part in node.factors:
            if part is holding[0][1]:
                continue
            e = builder.build(part)
            if not all(isinstance(k, ConstantRef | ParameterRef) for k in symbols(e)):
                hint = "what differs from frame to frame belongs inside the integral"
                builder.fail(part, "the factor of an integral is made of constants and parameters", hint)
            factor = mul(factor, e) if operator == "*" else div(factor, e)
        return [(holding[0][1], factor)]

    def _integral(self, node: syntax.Call, factor: Expr, integrals: list[Expr]) -> None:
        builder = self.builder
        if len(node.arguments) != 1:
            builder.fail(node, f"`integral` takes 1 argument, not {len(node.arguments)}")
            return
        argument = node.arguments[0]
        if self.holds_integral(argument):
            builder.fail(
                node,
                "an integral cannot stand within an integral",
                "make a variable of the inner one: `w' = e;`",
            )
            return
        body = builder.build(argument)
        if any(getattr(key, "side", "") for key in symbols(body)):
            builder.fail(
                node,
                "`before` and `after` cannot stand within an integral",
                "it reads each step on its own side",
            )
            return
        integrals.append(mul(factor, body))


__all__ = ["Bounded", "Objective", "Relations", "Summand", "infinite"]
