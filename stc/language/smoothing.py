"""Smooth products with a root that is not smooth alone: drag c v sqrt(vx^2 + vy^2) from rest, v abs(v).

The root of a sum of squares has a kink where all of them vanish, and no derivative there.  Multiplied by a factor that
vanishes at the same place it is differentiable, with the derivative 0 there.  Such a root is written ``sqrt(vx^2 + vy^2
+ 1e-200)``, which is the same number wherever the sum is above 1e-184, and whose derivatives, multiplied out, are
bounded everywhere and 0 at rest.  A power of such a sum between 1 and 2 has no second derivative there, and is written
in the same way.
"""

from __future__ import annotations

from stc.problem import ParameterRef, VariableRef
from stc.symbolic.expr import (
    ONE,
    Expr,
    add,
    call,
    div,
    mul,
    num,
    postorder,
    pow_,
    reachable,
    substitute,
    symbols,
)

#: What is added under a root: its power 3/2, in second derivatives, is still a number above the smallest.
NOTHING = num(1e-200)

#: Functions that are 0 at 0.
_ODD = frozenset(("sin", "tan", "asin", "atan", "sinh", "tanh", "sqrt"))
#: Places of parts of an expression, each with what multiplies it, that are looked at: larger ones are left as they are.
MOST_PLACES = 20_000
#: How deep factors are looked into for whether they vanish.
_DEEPEST = 40


def smoothed(e: Expr) -> Expr:
    """The same expression with roots that make products differentiable wherever that is possible."""
    if not any(_is_root(node) or _is_between(node) for node in reachable([e])):
        return e
    e = _cancelled(e)
    safe, bare = _roots(e)
    replaced: dict[Expr, Expr] = {}
    for node in reachable([e]):
        if _is_between(node) and _squared(node.args[0]):
            replaced[node] = pow_(add(node.args[0], NOTHING), node.args[1])
        elif node in safe and node not in bare:
            above = add(node.args[0], NOTHING)
            replaced[node] = call("sqrt", above) if node.op == "sqrt" else pow_(above, node.args[1])
    return substitute(e, {}, replaced) if replaced else e


def _is_root(node: Expr) -> bool:
    return node.op == "sqrt" or (
        node.op == "pow" and node.args[1].op == "num" and node.args[1].payload == 0.5
    )


def _is_between(node: Expr) -> bool:
    """Whether the node is a power with an exponent between 1 and 2."""
    return node.op == "pow" and node.args[1].op == "num" and 1.0 < node.args[1].payload < 2.0


def _cancelled(e: Expr) -> Expr:
    """The expression with V in place of V^2/V and (vx^2 + vy^2)/V, where V is the root of a sum of squares."""
    replaced: dict[Expr, Expr] = {}
    for node in postorder([e]):
        if node.op in ("mul", "div"):
            found = _shortened(node)
            if found is not node:
                replaced[node] = found
    return substitute(e, {}, replaced) if replaced else e


def _shortened(node: Expr) -> Expr:
    """A product without roots that occur both as factor and as divisor."""
    parts = _signed(node)
    roots = {_base(part)[0] for part, sign in parts if sign < 0.0 and _is_root(_base(part)[0])}
    for root in roots:
        if not _squared(root.args[0]):
            continue
        powers = [_power_of(part, root) for part, _ in parts]
        above = sum(power for power, (_, sign) in zip(powers, parts) if sign > 0.0)
        below = sum(power for power, (_, sign) in zip(powers, parts) if sign < 0.0)
        if not above or not below:
            continue
        rest = [part for part, power in zip(parts, powers, strict=True) if not power]
        parts = [*rest, (pow_(root, num(abs(above - below))), 1.0 if above >= below else -1.0)]
    if not roots:
        return node
    result: Expr = ONE
    for part, sign in parts:
        result = mul(result, part) if sign > 0.0 else div(result, part)
    return result


def _signed(node: Expr) -> list[tuple[Expr, float]]:
    """The factors of a product with 1, and its divisors with -1."""
    found: list[tuple[Expr, float]] = []
    waiting = [(node, 1.0)]
    while waiting:
        at, sign = waiting.pop()
        if at.op == "mul":
            waiting += [(arg, sign) for arg in at.args]
        elif at.op == "div":
            waiting += [(at.args[0], sign), (at.args[1], -sign)]
        elif at.op == "neg":
            waiting += [(at.args[0], sign), (num(-1.0), 1.0)]
        else:
            found.append((at, sign))
    return found


def _base(e: Expr) -> tuple[Expr, float]:
    """The base and the exponent of an expression."""
    plain = e.op == "pow" and e.args[1].op == "num"
    return (e.args[0], e.args[1].payload) if plain and not _is_root(e) else (e, 1.0)


def _power_of(e: Expr, root: Expr) -> float:
    """The exponent of a root in an expression; 0 for none."""
    base, power = _base(e)
    return power if base is root else 2.0 * power if base is root.args[0] else 0.0


def _roots(e: Expr) -> tuple[set[Expr], set[Expr]]:
    """The roots of sums of squares in smooth products, and the others."""
    safe: set[Expr] = set()
    bare: set[Expr] = set()
    holding: set[Expr] = set()  # what has a root in it: all else is passed over
    for node in postorder([e]):
        if _is_root(node) or any(arg in holding for arg in node.args):
            holding.add(node)
    nothing: tuple[Expr, ...] = ()
    waiting = [(e, nothing)]
    seen = set(waiting)
    while waiting:
        node, beside = waiting.pop()  # in the sum, with what multiplies it
        if _is_root(node):
            squared = _squared(node.args[0])
            (safe if any(_vanishes(part, squared) for part in beside) else bare).add(node)
        factors, divisors = _factors(node)
        if len(factors) > 1 or divisors or factors[0] is not node:
            found = [(one, (*beside, *factors[:k], *factors[k + 1 :])) for k, one in enumerate(factors)]
            found += [(one, nothing) for one in divisors]
        else:
            kept = beside if node.op in ("add", "sub") else nothing
            found = [(arg, kept) for arg in node.args]
        found = [place for place in found if place[0] in holding and place not in seen]
        seen.update(found)
        waiting += found
        if len(seen) > MOST_PLACES:
            return set(), bare
    return safe, bare


def _factors(node: Expr) -> tuple[list[Expr], list[Expr]]:
    """The factors of a product (a single one for other nodes), and its divisors."""
    found: list[Expr] = []
    divisors: list[Expr] = []
    waiting = [node]
    while waiting:
        at = waiting.pop()
        if at.op == "mul":
            waiting += at.args
        elif at.op == "div":
            waiting.append(at.args[0])
            divisors.append(at.args[1])
        elif at.op == "neg":
            waiting.append(at.args[0])
        elif at.op == "pow" and at.args[1].op == "num" and at.args[1].payload > 1.0:
            waiting += [at.args[0]] * (2 if at.args[1].payload >= 2.0 else 1)
        else:
            found.append(at)
    return found, divisors


def _squared(e: Expr) -> frozenset[Expr]:
    """The expressions whose squares a sum adds; empty for other sums, or if it cannot vanish."""
    found: set[Expr] = set()
    waiting = [e]
    while waiting:
        at = waiting.pop()
        if at.op == "add":
            waiting += at.args
            continue
        if at.op == "mul" and at.args[0] is not at.args[1]:
            known = [arg for arg in at.args if not _is_unknown(arg)]
            if not known:
                return frozenset()
            waiting.append(at.args[1] if known[0] is at.args[0] else at.args[0])
            continue
        if at.op == "mul":
            base = at.args[0]
        elif at.op == "pow" and at.args[1].op == "num" and at.args[1].payload == 2.0:
            base = at.args[0]
        else:
            return frozenset()
        if not _is_unknown(base):
            return frozenset()
        found.add(base)
    return frozenset(found)


def _is_unknown(e: Expr) -> bool:
    return any(isinstance(key, VariableRef | ParameterRef) for key in symbols(e))


def _vanishes(e: Expr, zeros: frozenset[Expr], deep: int = 0) -> bool:
    """Whether an expression is 0 wherever all of ``zeros`` are."""
    if e in zeros:
        return True
    if deep > _DEEPEST or not e.args:
        return False
    one, *other = (e.args[0], *e.args[1:])
    if e.op in ("add", "sub"):
        return all(_vanishes(arg, zeros, deep + 1) for arg in e.args)
    if e.op == "mul":
        return any(_vanishes(arg, zeros, deep + 1) for arg in e.args)
    if e.op == "pow":
        return other[0].op == "num" and other[0].payload > 0.0 and _vanishes(one, zeros, deep + 1)
    return (e.op in _ODD or e.op in ("neg", "div")) and _vanishes(one, zeros, deep + 1)
