"""Specs with one planted mistake each in their equations of motion.

Mistakes are made in two ways: in the expressions of the rows (every constant, number, summand and sign of every
equation of motion) and in the text of the spec (every constant and number that is used, every ``+`` and
``-``, in energies, forces, definitions and constraints).  Whether a mistake matters is decided without a model:
it does if the spec's own accelerations change.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class Mutant:
    """A spec with a mistake.

    ``matters`` tells whether the accelerations change; ``rows`` which equations of motion, by number, the mistake
    is in (empty where it was made in the text).
    """

    what: str
    problem: Problem
    matters: bool
    rows: frozenset[int] = frozenset()


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


def differ(a: FloatArray, b: FloatArray | None) -> bool:
    return b is None or not np.allclose(a, b, rtol=1e-9, atol=1e-9 * float(np.abs(a).max()))


def equations_of_motion(problem: Problem) -> list[int]:
    """Numbers of the relations that are equations of motion: equations with second derivatives all the way."""
    return [
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
            relations = list(problem.relations)
            relations[number] = replace(relations[number], body=body)
            mutant = replace(problem, relations=relations)
            matters = differ(truth, accelerations(mutant, numbers))
            yield Mutant(f"row {number}: {what}", mutant, matters, frozenset([number]))


def _changed(problem: Problem, body: Expr) -> Iterator[tuple[str, Expr]]:
    for key in symbols(body):
        if isinstance(key, ConstantRef):
            value = problem.constants[key.name]
            node = next(e for e in reachable([body]) if e.op == "sym" and e.payload == key)
            yield f"{key.name} wrong by 1 %", _swap(body, node, num(value * FACTOR or 0.01))
    exponents = {e.args[1] for e in reachable([body]) if e.op == "pow"}
    for node in reachable([body]):
        if node.op == "num" and node not in exponents and node.payload != 0.0:
            yield f"{node.payload:g} wrong by 1 %", _swap(body, node, num(node.payload * FACTOR))
        elif node.op in ("add", "sub"):
            a, b = node.args
            yield f"sign of {b}", _swap(body, node, a - b if node.op == "add" else a + b)
            yield f"without {b}", _swap(body, node, a)
            yield f"without {a}", _swap(body, node, b if node.op == "add" else -b)
        elif node.op == "neg":
            yield f"sign of {node}", _swap(body, node, node.args[0])
        elif node.op in ("sin", "cos"):
            other = rebuild("cos" if node.op == "sin" else "sin", node.args)
            yield f"{node.op} for {other.op}", _swap(body, node, other)


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
        try:
            mutant = elaborate(parse(Source(source.name, text, source.path)))
        except SpecError:
            continue  # the language itself refuses it: a unit of its own kind of test
        yield Mutant(what, mutant, differ(truth, accelerations(mutant, numbers)))


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
