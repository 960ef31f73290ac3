"""Specs with one planted mistake each in their equations of motion.

Mistakes are made in two ways: in the expressions of the rows (every constant, number, summand and sign of every
equation of motion) and in the text of the spec (every constant and number that is used, every ``+`` and
``-``, in energies, forces, definitions and constraints).  Whether a mistake matters is decided without a model:
it does if the spec's own accelerations change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from stc.errors import Source, SpecError
from stc.language.diagnostics import Diagnostics
from stc.language.lexer import tokenize
from stc.phases import phases
from stc.pipeline import elaborate, parse
from stc.problem import ConstantRef, Problem, VariableRef
from stc.studies.spec_equations import SpecEquations, State, constant_values
from stc.symbolic.expr import Expr, num, reachable, rebuild, symbols

FloatArray = NDArray[np.float64]

FACTOR = 1.01


@dataclass
class Mutant:
    """A spec with a mistake; made when it is looked at.

    ``rows`` tells which equations of motion, by number, the mistake is in (empty where it was made in the text).
    """

    what: str
    build: Callable[[], Problem]
    numbers: list[int]
    truth: FloatArray
    rows: frozenset[int] = frozenset()

    @cached_property
    def problem(self) -> Problem | None:
        """The problem, or None where the language itself refuses it."""
        try:
            return self.build()
        except SpecError:
            return None

    @property
    def matters(self) -> bool:
        """Whether the accelerations change."""
        assert self.problem is not None
        found = accelerations(self.problem, self.numbers)
        scale = float(np.abs(self.truth).max())
        return found is None or not np.allclose(self.truth, found, rtol=1e-9, atol=1e-9 * scale)


def accelerations(problem: Problem, numbers: Sequence[int], seed: int = 1) -> FloatArray | None:
    """(S, k) accelerations that the relations with these numbers imply at random states of the first phase."""
    rng = np.random.default_rng(seed)
    lines = {kind: [c.body for c in problem.replay if c.kind == kind] for kind in ("joint", "actuator")}
    known = constant_values(problem, dict.fromkeys(problem.parameters, 1.3), 0.4)
    spec = SpecEquations(problem, phases(problem)[0], lines["joint"], lines["actuator"], known)
    wanted = [problem.relations[k] for k in numbers]
    rows = [k for k, e in enumerate(spec.dynamic) if any(e.relation is r for r in wanted)]
    if len(rows) != len(numbers):
        return None
    shape = (16, len(spec.coordinates))
    names = sorted(spec.auxiliaries)
    z = dict(zip(names, rng.uniform(-5, 5, (len(names), 16))))
    state = State(
        rng.uniform(-2, 2, shape),
        rng.uniform(-3, 3, shape),
        np.array([z[name] for name in spec.auxiliaries]).T.reshape(16, -1),
    )
    linear = spec.linear(state)
    return np.asarray(-np.linalg.solve(linear.matrix[:, rows], linear.offset[:, rows, None])[..., 0])


def equations_of_motion(problem: Problem) -> list[int]:
    """Numbers of the relations that are equations of motion.

    These are the ones made from energies; where there are none, all equations with second derivatives.
    """
    made = [number for number, relation in enumerate(problem.relations) if relation.coordinate]
    return made or [
        number
        for number, relation in enumerate(problem.relations)
        if relation.is_equality
        and relation.range.first < relation.range.last
        and any(isinstance(k, VariableRef) and k.order == 2 for k in symbols(relation.body))
    ]


def in_rows(problem: Problem) -> Iterator[Mutant]:
    """Every constant, number, sign and summand in the rows of the equations of motion, changed one at a time."""
    numbers = equations_of_motion(problem)
    truth = accelerations(problem, numbers)
    assert truth is not None
    for number in numbers:
        for what, body in _changed(problem, problem.relations[number].body):
            build = partial(_with_row, problem, number, body)
            yield Mutant(f"row {number}: {what}", build, numbers, truth, frozenset([number]))


def _with_row(problem: Problem, number: int, body: Callable[[], Expr]) -> Problem:
    relations = list(problem.relations)
    relations[number] = replace(relations[number], body=body())
    return replace(problem, relations=relations)


def _changed(problem: Problem, body: Expr) -> Iterator[tuple[str, Callable[[], Expr]]]:
    nodes = reachable([body])
    exponents = {e.args[1] for e in nodes if e.op == "pow"}

    def swap(node: Expr, new: Expr) -> Callable[[], Expr]:
        return lambda: _swap(body, node, new)

    for node in nodes:
        if node.op == "sym" and isinstance(node.payload, ConstantRef):
            value = problem.constants[node.payload.name]
            yield f"{node.payload.name} wrong by 1 %", swap(node, num(value * FACTOR or 0.01))
        elif node.op == "num" and node not in exponents and node.payload != 0.0:
            yield f"{node.payload:g} wrong by 1 %", swap(node, num(node.payload * FACTOR))
        elif node.op in ("add", "sub"):
            a, b = node.args
            yield f"sign of {b}", swap(node, a - b if node.op == "add" else a + b)
            yield f"without {b}", swap(node, a)
            yield f"without {a}", swap(node, b if node.op == "add" else -b)
        elif node.op == "neg":
            yield f"sign of {node}", swap(node, node.args[0])
        elif node.op in ("sin", "cos"):
            other = rebuild("cos" if node.op == "sin" else "sin", node.args)
            yield f"{node.op} for {other.op}", swap(node, other)


def _swap(body: Expr, old: Expr, new: Expr) -> Expr:
    """``body`` with one node replaced wherever it occurs."""
    done: dict[Expr, Expr] = {old: new}
    for node in reachable([body]):
        if node not in done:
            args = tuple(done[arg] for arg in node.args)
            done[node] = rebuild(node.op, args) if args and args != node.args else node
    return done[body]


def in_text(source: Source, problem: Problem) -> Iterator[Mutant]:
    """Every use of a constant or number and every sign in the sections that make the equations of motion."""
    numbers = equations_of_motion(problem)
    truth = accelerations(problem, numbers)
    assert truth is not None
    for what, text in _edits(source, problem):
        yield Mutant(what, partial(_read, Source(source.name, text, source.path)), numbers, truth)


def _read(source: Source) -> Problem:
    return elaborate(parse(source))


def _edits(source: Source, problem: Problem) -> Iterator[tuple[str, str]]:
    tree = parse(source)
    spans = [
        (statement.start, statement.end)
        for section in tree.sections
        if section.kind in ("lagrangian", "forces", "definitions", "constraints")
        for block in section.blocks
        for statement in block.statements
        # Of the constraints those with accelerations: a bound with another sign pins what it bounded.
        if section.kind != "constraints" or "''" in source.text[statement.start : statement.end]
    ]
    tokens = tokenize(source, Diagnostics(source))
    text = source.text
    for k, (kind, start, end) in enumerate(zip(tokens.kinds, tokens.starts, tokens.ends)):
        if not any(first <= start and end <= last for first, last in spans):
            continue
        word, line = text[start:end], source.position(start)[0]
        before = tokens.kinds[k - 1] if k else ""
        if (kind == "name" and word in problem.constants) or kind == "number":
            if before != "^" and word != "n":
                yield f"line {line}: {word} wrong by 1 %", f"{text[:start]}({FACTOR}*{word}){text[end:]}"
        elif word in "+-" and word:
            other = "-" if word == "+" else "+"
            changed = f"{text[:start]}{other}{text[end:]}"
            if word == "-" and before not in ("name", "number", ")", "'", "]"):
                changed = f"{text[:start]}{text[end:]}"
            yield (
                f"line {line}, column {source.position(start)[1]}: sign of {text[start : end + 12]!r}",
                changed,
            )
