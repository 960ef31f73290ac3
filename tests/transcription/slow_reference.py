"""The language's meaning written out slowly, one frame and one number at a time.

Shares nothing with the transcription but the problem and the layout of the decision vector: derivatives by
central differences come from fitted polynomials, definitions, sides and quadrature from loops over the rules
of the language.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from stc.problem import (
    ConstantRef,
    DefinitionRef,
    IndexRef,
    ParameterRef,
    Problem,
    TimeRef,
    VariableRef,
)
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import Expr, evaluate, symbols

Node = tuple[Fraction, str]


class SlowMotion:
    """A motion given by its decision vector, and what every statement is worth on it."""

    def __init__(self, problem: Problem, layout, x: np.ndarray) -> None:
        self.problem, self.n, self.method = problem, problem.n, problem.method
        self.values: dict[tuple[str, int, Fraction, str], float] = {}
        for name, order, before, after, middle in layout.slots():
            for i in range(self.n + 1):
                self.values[name, order, Fraction(i), "before"] = x[before[i]]
                self.values[name, order, Fraction(i), "after"] = x[after[i]]
            for i in range(len(middle)):
                self.values[name, order, Fraction(2 * i + 1, 2), "before"] = x[middle[i]]
                self.values[name, order, Fraction(2 * i + 1, 2), "after"] = x[middle[i]]
        self.parameters = {name: x[p] for name, p in layout.parameters.items()}
        self.jumps = {j.frame for j in problem.jumps}
        self.steps = [
            self.value(problem.step, (Fraction(s), "after" if s in self.jumps else "")) for s in range(self.n)
        ]
        self.times = np.concatenate([[0.0], np.cumsum(self.steps)]) if self.n else np.zeros(1)

    def time(self, at: Fraction) -> float:
        low = int(at)
        return float(self.times[low] + (0.5 * self.steps[low] if at != low else 0.0))

    def piece(self, name: str, node: Node) -> Expr | None:
        at, side = node
        frame = int(at)
        holding = [p for p in self.problem.definitions[name] if p.range.first <= frame <= p.range.last]
        if at != frame and frame in self.jumps:
            side = "after"  # a midpoint reads the frame before it on the side nearer to it
        if side and name != "h":
            wrong = "first" if side == "before" else "last"
            proper = [p for p in holding if p.range.first == p.range.last or getattr(p.range, wrong) != frame]
            holding = proper or holding
        return holding[-1].body if holding else None

    def read(self, ref: VariableRef, node: Node) -> float:
        at, side = node
        target = ref.scale * at + ref.shift
        if not 0 <= target <= self.n or (target.denominator != 1 and target != at):
            raise LookupError
        if self.method == "central":
            return self.difference(ref.name, ref.order, int(target))
        if ref.side:
            side = ref.side
        elif target > at:
            side = "before"
        elif target < at:
            side = "after"
        return self.values[ref.name, ref.order, target, side or "before"]

    def difference(self, name: str, order: int, frame: int) -> float:
        if order == 0:
            return self.values[name, 0, Fraction(frame), "before"]
        if order == 1:
            frames = [frame - 1, frame, frame + 1]
            if frame == 0:
                frames = [0, 1, 2]
            if frame == self.n:
                frames = [self.n - 2, self.n - 1, self.n]
        else:
            reach = {2: 1, 3: 2, 4: 2, 5: 3, 6: 3}[order]
            frames = list(range(frame - reach, frame + reach + 1))
        if frames[0] < 0 or frames[-1] > self.n:
            raise LookupError
        t = np.array([self.times[f] - self.times[frame] for f in frames])
        scale = max(abs(t))
        matrix = np.vander(t / scale, increasing=True)
        c = np.linalg.solve(matrix, [self.values[name, 0, Fraction(f), "before"] for f in frames])
        factorial = float(np.prod(np.arange(1, order + 1)))
        return float(c[order] * factorial / scale**order)

    def value(self, body: Expr, node: Node) -> float:
        """The expression at a node.

        Raises:
            LookupError: it reaches outside the motion there.
        """
        given: dict[object, float] = {}
        for key in symbols(body):
            match key:
                case ConstantRef(name):
                    given[key] = self.problem.constants[name]
                case ParameterRef(name):
                    given[key] = self.parameters[name]
                case IndexRef():
                    given[key] = float(node[0])
                case TimeRef():
                    given[key] = self.time(node[0])
                case VariableRef():
                    given[key] = self.read(key, node)
                case DefinitionRef():
                    given[key] = self.definition(key, node)
        return float(evaluate(body, given))

    def definition(self, ref: DefinitionRef, node: Node) -> float:
        at = (node[0], ref.side) if ref.side and node[1] else node
        body = self.piece(ref.name, at)
        if body is None and ref.name == "h":
            body = self.problem.definitions["h"][-1].body
        if body is None:
            raise LookupError
        for _ in range(ref.order):
            body = self.prime(body)
        return self.value(body, at)

    def prime(self, body: Expr) -> Expr:
        total = body - body
        for key in symbols(body):
            slope = derivative(body, key)
            if isinstance(key, VariableRef | DefinitionRef):
                from stc.symbolic.expr import sym

                total = total + slope * sym(replace(key, order=key.order + 1))
            elif isinstance(key, TimeRef):
                total = total + slope
        return total

    def relative(self, body: Expr, node: Node) -> bool:
        """Whether the expression reads from a frame at a relative index, by itself or in a definition that holds."""
        for key in symbols(body):
            if isinstance(key, VariableRef) and key.scale != 0 and (key.scale, key.shift) != (1, 0):
                return True
            if isinstance(key, DefinitionRef):
                piece = self.piece(key.name, node)
                if piece is not None and self.relative(piece, node):
                    return True
        return False

    def nodes(self, first: int, last: int, body: Expr | None = None) -> list[Node]:
        """Where a statement on first..last stands, by sections 5 and 6 of the language."""
        result: list[Node] = []
        for i in range(first, last + 1):
            at = Fraction(i)
            if i not in self.jumps:
                result.append((at, ""))
            elif first == last or first < i < last:
                result += [(at, "before"), (at, "after")]
            else:
                result.append((at, "after" if i == first else "before"))
            middle = (at + Fraction(1, 2), "")
            if self.method == "hermite-simpson" and i < last:
                if body is None or not self.relative(body, middle):
                    result.append(middle)
        return result

    def defined(self, body: Expr, nodes: list[Node]) -> dict[Node, float]:
        found = {}
        for node in nodes:
            try:
                found[node] = self.value(body, node)
            except LookupError:
                continue
        return found

    def objective(self) -> float:
        total = 0.0
        for term in self.problem.objective:
            first, last = term.range.first, term.range.last
            values = self.defined(term.body, self.nodes(first, last, term.body))
            total += (self.integral if term.integral else self.plain)(values, first, last)
        return total

    def one_sided(self, values: dict[Node, float], frame: int, side: str) -> float:
        for s in (side, ""):
            if (Fraction(frame), s) in values:
                return values[Fraction(frame), s]
        if self.method == "central":
            nearest = min((node[0] for node in values), key=lambda at: abs(at - frame))
            return values[nearest, ""]
        other = "before" if side == "after" else "after"
        return values[Fraction(frame), other]

    def integral(self, values: dict[Node, float], first: int, last: int) -> float:
        total = 0.0
        for i in range(first, last):
            left, right = self.one_sided(values, i, "after"), self.one_sided(values, i + 1, "before")
            h = self.steps[i]
            middle = values.get((Fraction(2 * i + 1, 2), ""))
            if middle is None:
                total += h * (left + right) / 2
            else:
                total += h * (left + 4 * middle + right) / 6
        return total

    def plain(self, values: dict[Node, float], first: int, last: int) -> float:
        def mean(i: int) -> float:
            sides = [v for (at, _), v in values.items() if at == i]
            return sum(sides) / len(sides) if sides else 0.0

        if any(at.denominator == 2 for at, _ in values):
            total = (mean(first) + mean(last)) / 2
            for i in range(first, last):
                left, right = self.one_sided(values, i, "after"), self.one_sided(values, i + 1, "before")
                middle = values.get((Fraction(2 * i + 1, 2), ""))
                total += (left + right) / 2 if middle is None else (left + 4 * middle + right) / 6
            return total
        return sum(mean(i) for i in range(first, last + 1))
