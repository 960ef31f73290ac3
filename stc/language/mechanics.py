"""The `lagrangian:` and `forces:` sections: from energies to equations of motion.

For every variable q whose first derivative appears in a Lagrangian L the spec gains the Euler-Lagrange row

    d/dt (dL/dq') - dL/dq - Q = 0

on the range of L's header; Q is the generalised force that `forces:` gives to q.  Lines of `forces:` before any
range header are summed and hold everywhere.  Lines under headers act on those frames in addition; of several
that name the same coordinate on the same frame the later one replaces the others, as with ranged definitions.
"""

from __future__ import annotations

from collections.abc import Mapping

from stc.language import syntax
from stc.language.context import Context
from stc.language.diagnostics import did_you_mean
from stc.problem import (
    ConstantRef,
    DefinitionPiece,
    DefinitionRef,
    FrameRange,
    IndexRef,
    ParameterRef,
    Relation,
    TimeRef,
    VariableRef,
)
from stc.symbolic.expr import ZERO, Expr, mul, num, render, sub, sum_of, sym, symbols
from stc.symbolic.rules import coefficient


def force_name(coordinate: str) -> str:
    """The definition that collects the ranged forces on a coordinate; no spec can declare such a name."""
    return f"force on {coordinate}"


def momentum_name(coordinate: str) -> str:
    """The definition that holds the momentum of a coordinate in several Lagrangians; no spec can declare it."""
    return f"momentum of {coordinate}"


def equations_of_motion(context: Context) -> list[Relation]:
    """The equations of all Lagrangians of a spec; mistakes are added to the context."""
    if context.model is not None:
        for block in context.tree.blocks("lagrangian"):
            for statement in block.statements:
                hint = "forces that the model lacks are added under `forces:`, as in `joint.knee: -k*joint.knee;`"
                context.error(
                    statement, "a spec with a model has no Lagrangian: the model brings its equations", hint
                )
        return []
    everywhere = _forces(context)
    found: list[Relation] = []
    momenta: dict[str, list[DefinitionPiece]] = {}
    for block in context.tree.blocks("lagrangian"):
        where = context.range(block)
        energies = [s for s in block.statements if isinstance(s, syntax.Relation)]
        bodies = [e for e in (_energy(context, s) for s in energies) if e is not None]
        if where is None or len(bodies) < len(energies) or not bodies:
            continue
        lagrangian = sum_of(bodies)
        coordinates = [name for name in context.table.of_kind("variable") if _moves(lagrangian, name)]
        if not coordinates:
            hint = "an energy of motion has terms such as `m*x'^2/2`"
            context.error(energies[0], "no variable's first derivative appears in this Lagrangian", hint)
        from stc.symbolic.variation import euler_lagrange

        variations = euler_lagrange(
            lagrangian,
            [(sym(VariableRef(name)), sym(VariableRef(name, 1))) for name in coordinates],
            _points(context.builder.derivatives),
            context.builder.rate,
        )
        for name, of_name in zip(coordinates, variations, strict=True):
            piece = DefinitionPiece(of_name.momentum, where, context.span(energies[0]))
            momenta.setdefault(name, []).append(piece)
            row = sub(of_name.row, sum_of(everywhere.get(name, [])))
            if force_name(name) in context.builder.pieces:
                row = sub(row, sym(DefinitionRef(force_name(name))))
            row = context.settled(row, where, energies[0])
            text = f"equation of motion of {name}"
            found.append(Relation(row, ZERO, ZERO, where, context.span(energies[0]), text, name))
    context.builder.momenta = {name: _momentum(context, name, pieces) for name, pieces in momenta.items()}
    _check_forces(context, set(momenta))
    return found


def forces_on_coordinates(context: Context) -> dict[str, list[Expr]]:
    """The forces that `forces:` adds to the equations of a model, by coordinate."""
    found = _forces(context)
    for name in [*found, *context.table.of_kind("variable")]:
        if force_name(name) in context.builder.pieces:
            found.setdefault(name, []).append(sym(DefinitionRef(force_name(name))))
    known = {name for one in context.model.coordinates for name in one.freedoms} if context.model else set()
    for block in context.tree.blocks("forces"):
        for statement in block.statements:
            if isinstance(statement, syntax.Assignment) and statement.name.name not in known:
                name = statement.name.name
                if context.table.kind(name) == "variable":
                    hint = did_you_mean(name, known) or "forces act on joints, as in `joint.knee: ...;`"
                    context.error(
                        statement.name, f"this force acts on nothing: `{name}` is not a coordinate", hint
                    )
    return found


def _points(derivatives: Mapping[Expr, Expr]) -> dict[Expr, Expr]:
    """Velocities written with a prime in the spec, and the functions of the configuration that they belong to.

    Without constant factors and divisors: these move when a velocity is multiplied by something.
    """
    found: dict[Expr, Expr] = {}
    for position, velocity in derivatives.items():
        if not all(_of_configuration(key) for key in symbols(position)):
            continue
        factor, speed = coefficient(velocity)
        point = position if factor == 1.0 else mul(num(1.0 / factor), position)
        while speed.op == "div" and not any(isinstance(key, VariableRef) for key in symbols(speed.args[1])):
            point, speed = mul(point, speed.args[1]), speed.args[0]
        if speed.op != "sym" and any(isinstance(key, VariableRef) and key.order for key in symbols(speed)):
            found[speed] = point
    return found


def _of_configuration(key: object) -> bool:
    """Whether a symbol may occur in the position of a point: a coordinate, the time, or a constant."""
    if isinstance(key, VariableRef):
        return key == VariableRef(key.name)
    return isinstance(key, ConstantRef | ParameterRef | TimeRef)


def _momentum(context: Context, name: str, pieces: list[DefinitionPiece]) -> Expr:
    """The value of `momentum(name)`: one expression, or pieces if Lagrangians are under range headers."""
    if len(pieces) == 1 and (pieces[0].range.first, pieces[0].range.last) == (0, context.n):
        return pieces[0].body
    context.builder.pieces[momentum_name(name)] = pieces
    return sym(DefinitionRef(momentum_name(name)))


def _moves(lagrangian: Expr, name: str) -> bool:
    return VariableRef(name, 1) in symbols(lagrangian)


def _energy(context: Context, statement: syntax.Relation) -> Expr | None:
    """One line of a Lagrangian; None after a mistake."""
    context.builder.poisoned = False
    body = context.builder.build(statement.operands[0])
    if statement.operators:
        hint = "write the kinetic energy less the potential energy"
        context.error(statement, "a Lagrangian is an expression, not a relation", hint)
        return None
    if context.builder.poisoned:
        return None
    for key in symbols(body):
        if isinstance(key, DefinitionRef):
            if not context.tell_of_stray(key.name, "the Lagrangian uses it"):
                hint = "give the Lagrangian itself range headers, one expression for each"
                context.error(
                    statement, f"a Lagrangian cannot use `{key}`, which differs between frames", hint
                )
            return None
        if isinstance(key, IndexRef):
            context.error(statement, "a Lagrangian cannot use the index `i`", "write it in terms of `t`")
            return None
        if isinstance(key, VariableRef) and (key.order > 1 or key != VariableRef(key.name, key.order)):
            hint = "it is made of variables, their first derivatives, constants, parameters and `t`"
            context.error(statement, f"a Lagrangian cannot use `{render(sym(key))}`", hint)
            return None
    return body


def _forces(context: Context) -> dict[str, list[Expr]]:
    """Forces that hold everywhere, by coordinate; those under headers become pieces of a definition."""
    everywhere: dict[str, list[Expr]] = {}
    pieces: dict[str, list[DefinitionPiece]] = {}
    for block, where, statement in context.statements("forces", syntax.Assignment):
        body = context.builder.build(statement.value)
        if context.builder.poisoned or where is None or not _is_coordinate(context, statement.name):
            continue
        name = statement.name.name
        body = context.settled(body, where, statement)
        if block.header is None:
            everywhere.setdefault(name, []).append(body)
        else:
            pieces.setdefault(name, []).append(DefinitionPiece(body, where, context.span(statement)))
    for name, found in pieces.items():
        rest = DefinitionPiece(ZERO, FrameRange(0, context.n), found[0].span)
        context.builder.pieces[force_name(name)] = [rest, *found]
    return everywhere


def _is_coordinate(context: Context, name: syntax.Name) -> bool:
    kind = context.table.kind(name.name)
    if kind == "variable":
        return True
    if name.name not in context.tree.damaged and not ("." in name.name and context.builder.model_is_missing):
        what = f"`{name.name}` is a {kind}" if kind else f"`{name.name}` is not declared"
        context.error(name, f"{what}; a generalised force acts on a variable", _nearest(context, name.name))
    return False


def _nearest(context: Context, name: str) -> str:
    return did_you_mean(name, context.table.of_kind("variable")) or "write `q: expression;` for a variable q"


def _check_forces(context: Context, moved: set[str]) -> None:
    if context.diagnostics.error_count:
        return
    for block in context.tree.blocks("forces"):
        for statement in block.statements:
            if isinstance(statement, syntax.Assignment) and statement.name.name not in moved:
                name = statement.name.name
                hint = f"no Lagrangian has `{name}'` in it, so {name} has no equation of motion"
                context.error(statement.name, f"this force acts on nothing: `{name}`", hint)
