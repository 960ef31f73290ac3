"""Warnings about a problem that is valid but probably not intended."""

from __future__ import annotations

import math
from collections.abc import Mapping

from stc.language.diagnostics import Diagnostics
from stc.language.name_table import NameTable
from stc.problem import ConstantRef, DefinitionRef, ParameterRef, Problem, VariableRef
from stc.symbolic.expr import Expr, evaluate, symbols
from stc.symbolic.traverse import reachable
from stc.time_derivatives import time_derivative

Place = tuple[int, int]

#: Angles that are given as multiples of five between these numbers are probably meant in degrees: two turns and more.
#: 70 pages of the specs, documents and tests limit an angle by another number than 0.  None of them gives an alarm; all
#: do with their limits in degrees, rounded to multiples of five, and 68 would from 20 degrees on.
_LEAST_DEGREES, _MOST_DEGREES = 15.0, 360.0


def warn(
    problem: Problem, table: NameTable, first_use: Mapping[tuple[str, int], Place], diagnostics: Diagnostics
) -> None:
    """Add all warnings; ``first_use`` gives the first position of each derivative of a variable in the text."""
    orders = derivative_orders(problem)
    _unused(table, diagnostics)
    _parameter_sums(problem, diagnostics)
    if problem.method == "central":
        _uncoupled(orders, first_use, diagnostics)
    _idle_jumps(problem, orders, diagnostics)
    _degrees(problem, diagnostics)
    pull, place = problem.constants.get("option.gravity.z", 0.0), problem.model_span
    if problem.of_model and pull > 0.0 and place is not None:
        hint = "z is up, and the gravity of the earth is -9.81: is a minus missing?"
        diagnostics.warning(f"gravity pulls upwards, by {pull:g} m/s^2", place.start, place.end, hint)


def derivative_orders(problem: Problem) -> dict[str, dict[int, Place]]:
    """Per variable, the orders of its derivatives in statements, each with its first statement's place."""
    found: dict[str, dict[int, Place]] = {}
    seen: set[DefinitionRef] = set()

    def note(e: Expr, place: Place) -> None:
        waiting = [e]
        while waiting:
            for key in symbols(waiting.pop()):
                if isinstance(key, VariableRef):
                    found.setdefault(key.name, {}).setdefault(key.order, place)
                elif isinstance(key, DefinitionRef) and key not in seen:
                    seen.add(key)
                    pieces = problem.definitions[key.name]
                    waiting += [time_derivative(p.body, key.order, problem.rotations) for p in pieces]

    for relation in problem.relations:
        note(relation.body, (relation.span.start, relation.span.end))
    for term in problem.objective:
        note(term.body, (term.span.start, term.span.end))
    return found


def _unused(table: NameTable, diagnostics: Diagnostics) -> None:
    for name, entry in table.entries.items():
        if not entry.used and name not in ("n", "h"):
            hint = "no constraint, objective or definition mentions it"
            diagnostics.warning(f"the {entry.kind} `{name}` is not used", entry.start, entry.end, hint)


def _parameter_sums(problem: Problem, diagnostics: Diagnostics) -> None:
    for term in problem.objective:
        keys = symbols(term.body)
        frames = term.range.last - term.range.first + 1
        if (
            not term.integral
            and frames > 1
            and any(isinstance(key, ParameterRef) for key in keys)
            and all(isinstance(key, ParameterRef | ConstantRef) for key in keys)
        ):
            message = f"this term is the same on every frame and counts {frames} times"
            hint = "put it under the range `[0]:` to count it once"
            diagnostics.warning(message, term.span.start, term.span.end, hint)


def _uncoupled(
    orders: Mapping[str, Mapping[int, Place]],
    first_use: Mapping[tuple[str, int], Place],
    diagnostics: Diagnostics,
) -> None:
    for name, places in orders.items():
        if 1 in places and 2 not in places:
            start, end = first_use.get((name, 1), places[1])
            message = (
                f"`{name}'` appears but `{name}''` never does: "
                f"central differences leave the odd and even frames of `{name}` uncoupled"
            )
            hint = "`method: trapezoidal;` is meant for first-order systems"
            diagnostics.warning(message, start, end, hint)


def _idle_jumps(
    problem: Problem, orders: Mapping[str, Mapping[int, Place]], diagnostics: Diagnostics
) -> None:
    for jump in problem.jumps:
        used = orders.get(jump.name, {})
        if jump.order > max(used, default=0):
            shown = jump.name + "'" * jump.order
            message = f"`{shown}` is used nowhere, so its jump changes nothing"
            diagnostics.warning(message, jump.span.start, jump.span.end)


def _degrees(problem: Problem, diagnostics: Diagnostics) -> None:
    """Limits that look like degrees, of variables whose sines or cosines are taken, alone or in sums."""
    given = []
    for relation in problem.relations:
        if relation.body.op != "sym" or not isinstance(relation.body.payload, VariableRef):
            continue
        for end in (relation.lower, relation.upper):
            keys = () if end is None else symbols(end)
            if end is not None and all(isinstance(key, ConstantRef) for key in keys):
                value = float(evaluate(end, {key: problem.constants[key.name] for key in keys}))
                if _LEAST_DEGREES <= abs(value) <= _MOST_DEGREES and value % 5.0 == 0.0:
                    given.append((relation, value))
                    break
    nodes = reachable(relation.body for relation in problem.relations) if given else []
    sums = [reachable(node.args) for node in nodes if node.op in ("sin", "cos")]
    plain = [parts for parts in sums if all(part.op in ("add", "sub", "neg", "sym", "num") for part in parts)]
    angles = {part.payload for parts in plain for part in parts if part.op == "sym"}
    for relation, value in given:
        if relation.body.payload in angles:
            message = f"`{relation.body.payload}` is an angle in rad: {value:g} rad are {value / math.tau:.1f} turns"
            hint = f"if degrees are meant, write `{value:g}*pi/180`"
            diagnostics.warning(message, relation.span.start, relation.span.end, hint)
