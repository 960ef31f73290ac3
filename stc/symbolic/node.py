"""Interned expression nodes: the representation, and the constructors that simplify.

Every distinct expression exists once (hash-consing), so structural equality is identity, memo tables are
keyed by the node itself, and common subexpressions are shared by construction.

*Order.*  Each node carries ``order``, an integer made from its structure alone: the height above its leaves
in the high bits and a hash of its operator and operands in the low ones.  Sorting by it is a topological
order (operands first), puts literals before symbols before compound expressions, and is the same in every
process: no string hash, memory address or creation history enters.  Commutative operators keep their operands
in this order.

*Interning.*  The table holds nodes weakly: an expression that nobody uses any more is freed together with its
entry.  The table is not locked; expressions are to be built by one thread at a time.

*Simplifying.*  ``add``, ``sub``, ``mul``, ``div``, ``neg``, ``pow_`` and ``call`` look up the rules
registered for the operators of their operands (:mod:`stc.symbolic.rules`) and intern the node as it stands
only when none applies. ``raw`` interns without simplifying.  Sums and differences that are zero everywhere
are recognised by their fingerprint (:mod:`stc.symbolic.fingerprint`), however their operands are written.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable, Hashable, Iterable
from hashlib import blake2b
from struct import pack
from typing import TYPE_CHECKING, Any, Final

from stc.symbolic.fingerprint import (
    OF_FUNCTION,
    OF_PAIR,
    PRIME,
    Fingerprint,
    element,
    of_literal,
    power,
    reciprocal,
)

if TYPE_CHECKING:
    from stc.symbolic.tables import TableRef

FUNCTIONS: Final[dict[str, int]] = {
    "sin": 1,
    "cos": 1,
    "tan": 1,
    "asin": 1,
    "acos": 1,
    "atan": 1,
    "atan2": 2,
    "sinh": 1,
    "cosh": 1,
    "tanh": 1,
    "exp": 1,
    "log": 1,
    "sqrt": 1,
}
"""The functions of the spec language and how many arguments each takes."""

ARITY: Final[dict[str, int]] = {"add": 2, "sub": 2, "mul": 2, "div": 2, "pow": 2, "neg": 1, **FUNCTIONS}
"""Every operator whose operands are numbers."""

LOOK, AT, TABLE = "look", "at", "table"
OF_TABLES: Final[dict[str, int]] = {LOOK: 2, AT: 2}
"""The operators of tables, see :mod:`stc.symbolic.tables`; ``num``, ``sym`` and ``table`` are leaves."""

COMMUTATIVE: Final = frozenset({"add", "mul"})
_ADDITIVE: Final = frozenset({"add", "sub"})

_HASH_BITS: Final = 60
_HASH_MASK: Final = (1 << _HASH_BITS) - 1
_OPCODE: Final[dict[str, int]] = {op: 7919 * (k + 2) for k, op in enumerate((*ARITY, *OF_TABLES))}


class Expr:
    """One interned node; made by the constructors of this module only, never changed.

    ``op`` is ``"num"``, ``"sym"``, ``"table"`` or an operator that has operands, ``args``; ``payload`` the
    value of a literal (float), the key of a symbol (hashable) or a :class:`~stc.symbolic.tables.TableRef`.
    ``order`` is explained above, ``fingerprint`` in :mod:`stc.symbolic.fingerprint`; ``settled`` remembers that no rule
    applies.  Equality is identity.
    """

    __slots__ = ("__weakref__", "args", "fingerprint", "op", "order", "payload", "settled")

    op: Final[str]
    args: Final[tuple[Expr, ...]]
    payload: Final[Any]
    order: Final[int]
    fingerprint: Final[Fingerprint]
    settled: bool

    def __init__(
        self, op: str, args: tuple[Expr, ...], payload: Any, order: int, fingerprint: Fingerprint
    ) -> None:
        self.op = op
        self.args = args
        self.payload = payload
        self.order = order
        self.fingerprint = fingerprint
        self.settled = False

    def __add__(self, other: Expr | float) -> Expr:
        return add(self, other if isinstance(other, Expr) else num(other))

    def __radd__(self, other: float) -> Expr:
        return add(num(other), self)

    def __sub__(self, other: Expr | float) -> Expr:
        return sub(self, other if isinstance(other, Expr) else num(other))

    def __rsub__(self, other: float) -> Expr:
        return sub(num(other), self)

    def __mul__(self, other: Expr | float) -> Expr:
        return mul(self, other if isinstance(other, Expr) else num(other))

    def __rmul__(self, other: float) -> Expr:
        return mul(num(other), self)

    def __truediv__(self, other: Expr | float) -> Expr:
        return div(self, other if isinstance(other, Expr) else num(other))

    def __rtruediv__(self, other: float) -> Expr:
        return div(num(other), self)

    def __pow__(self, other: Expr | float) -> Expr:
        return pow_(self, other if isinstance(other, Expr) else num(other))

    def __rpow__(self, other: float) -> Expr:
        return pow_(num(other), self)

    def __neg__(self) -> Expr:
        return neg(self)

    def __copy__(self) -> Expr:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Expr:
        return self

    def __reduce__(self) -> tuple[Callable[..., Expr], tuple[Any, ...]]:
        return (_restore, (self.op, self.args, self.payload))

    def __repr__(self) -> str:
        return f"Expr({shown(self)})"


def _operation(e: Expr) -> str:
    return f"{e.op} ..."


#: How an expression is written where it is looked at; :mod:`stc.symbolic.render` puts its own text here.
shown: Callable[[Expr], str] = _operation


class _Ref(weakref.ref[Expr]):
    """A weak reference that knows its entry in the interning table."""

    __slots__ = ("key",)
    key: tuple[Any, ...]


_table: dict[tuple[Any, ...], _Ref] = {}


def _forget(ref: _Ref) -> None:
    """Drop the entry of a node that was freed, unless a new node has taken its place already."""
    if _table.get(ref.key) is ref:
        del _table[ref.key]


def interned_count() -> int:
    """The number of live nodes in this process."""
    return len(_table)


def _register(key: tuple[Any, ...], node: Expr) -> Expr:
    ref = _Ref(node, _forget)
    ref.key = key
    _table[key] = ref
    return node


def _intern(op: str, a: Expr, b: Expr | None = None) -> Expr:
    key = (op, a, b)
    ref = _table.get(key)
    found = None if ref is None else ref()
    return _make(key) if found is None else found


def _make(key: tuple[str, Expr, Expr | None]) -> Expr:
    """A new node, entered into the table."""
    op, a, b = key
    high = a.order
    mark = a.fingerprint
    if b is None:
        args: tuple[Expr, ...] = (a,)
        # A tuple of integers hashes the same in every process: only strings and bytes are salted.
        low = hash((_OPCODE[op], high)) & _HASH_MASK
        mark = -mark % PRIME if op == "neg" else OF_FUNCTION[op](mark)
    else:
        args = (a, b)
        other = b.order
        low = hash((_OPCODE[op], high, other)) & _HASH_MASK
        if other > high:
            high = other
        if op == "mul":
            mark = mark * b.fingerprint % PRIME
        elif op == "add":
            mark = (mark + b.fingerprint) % PRIME
        elif op == "sub":
            mark = (mark - b.fingerprint) % PRIME
        elif op == "div":
            mark = mark * reciprocal(b.fingerprint) % PRIME
        elif op == "pow":
            mark = power(mark, b.fingerprint, b.payload if b.op == "num" else None)
        else:
            mark = OF_PAIR[op](mark, b.fingerprint)
    node = Expr(op, args, None, ((high >> _HASH_BITS) + 1 << _HASH_BITS) | low, mark)
    ref = _Ref(node, _forget)
    ref.key = key
    _table[key] = ref
    return node


def _spread(value: float) -> int:
    """The sort key of a literal: the bits of its double, multiplied so that the 60 that are kept depend on all 64.

    (Python's hash of a float has 61 bits and a sign: cut to 60 of them, 2 and 2.5 are the same.)
    """
    bits = int.from_bytes(pack("<d", value if value == value else math.nan), "little")
    return (bits * 0x9E3779B97F4A7C15 >> 4) & _HASH_MASK


def num(value: float) -> Expr:
    """The literal ``value``.  Negative zero is stored as zero."""
    value = float(value) + 0.0
    key = ("num", value if value == value else "nan")
    ref = _table.get(key)
    if ref is not None:
        found = ref()
        if found is not None:
            return found
    return _register(key, Expr("num", (), value, _spread(value), of_literal(value)))


def sym(key: Hashable) -> Expr:
    """The symbol with this key; equal keys are one symbol, and their ``repr`` must not vary by process."""
    entry = ("sym", key)
    ref = _table.get(entry)
    if ref is not None:
        found = ref()
        if found is not None:
            return found
    digest = blake2b(repr(key).encode(), digest_size=8).digest()
    low = int.from_bytes(digest, "big") & _HASH_MASK
    return _register(entry, Expr("sym", (), key, (1 << _HASH_BITS) | low, element(0, low)))


def table_leaf(ref: TableRef) -> Expr:
    """The leaf for a table, or for a derivative of one."""
    entry = (TABLE, ref)
    known = _table.get(entry)
    found = None if known is None else known()
    if found is not None:
        return found
    digest = blake2b(repr(ref).encode(), digest_size=8).digest()
    low = int.from_bytes(digest, "big") & _HASH_MASK
    return _register(entry, Expr(TABLE, (), ref, (1 << _HASH_BITS) | low, element(11, low)))


def looked_up(ref: TableRef, *arguments: Expr) -> Expr:
    """The value of a table, or of a derivative of one, at one argument or two."""
    leaf = table_leaf(ref)
    x, *second = arguments
    return _construct((LOOK, x, _construct((AT, second[0], leaf)) if second else leaf))


def slope_of_look(x: Expr, place: Expr, argument: int) -> Expr:
    """The partial derivative of ``look(x, place)`` by one of the table's arguments, counted from 0."""
    leaf = place.args[1] if place.op == AT else place
    ref = leaf.payload.derivative(argument)
    if ref is None:
        return ZERO
    return looked_up(ref, x, *place.args[:1])


def raw(op: str, *args: Expr) -> Expr:
    """Intern ``op(*args)`` as it stands, without simplifying and without reordering operands.

    Raises:
        ValueError: the operator is unknown or has another number of operands.
    """
    if ARITY.get(op, OF_TABLES.get(op)) != len(args):
        raise ValueError(f"no operator {op!r} with {len(args)} operands")
    return _intern(op, *args)


def _restore(op: str, args: tuple[Expr, ...], payload: Any) -> Expr:
    if op == "num":
        return num(payload)
    if op == TABLE:
        return table_leaf(payload)
    return sym(payload) if op == "sym" else _intern(op, *args)


Rewrite = Callable[..., "Expr | None"]
"""A rule's action: takes the operands, returns the simpler expression, or None to leave them alone."""

binary_rules: dict[tuple[str, str, str], tuple[Rewrite, ...]] = {}
"""Actions by operator and the operators of its two operands, in the order in which they are tried."""

unary_rules: dict[tuple[str, str], tuple[Rewrite, ...]] = {}
"""Actions by operator and the operator of its operand, in the order in which they are tried."""


def _construct(key: tuple[str, Expr, Expr | None]) -> Expr:
    """The simplified node for an operator and its operands, those of commutative operators in order."""
    ref = _table.get(key)
    found = None if ref is None else ref()
    if found is not None and found.settled:
        return found
    op, a, b = key
    if b is None:
        for rule in unary_rules.get((op, a.op), ()):
            result = rule(a)
            if result is not None:
                return result
    else:
        for rule in binary_rules.get((op, a.op, b.op), ()):
            result = rule(a, b)
            if result is not None:
                return result
    node = _make(key) if found is None else found
    if not node.fingerprint and op in _ADDITIVE:
        return ZERO
    node.settled = True
    return node


def add(a: Expr, b: Expr) -> Expr:
    """``a + b``, simplified."""
    return _construct(("add", a, b) if a.order <= b.order else ("add", b, a))


def sub(a: Expr, b: Expr) -> Expr:
    """``a - b``, simplified."""
    return _construct(("sub", a, b))


def mul(a: Expr, b: Expr) -> Expr:
    """``a * b``, simplified."""
    return _construct(("mul", a, b) if a.order <= b.order else ("mul", b, a))


def div(a: Expr, b: Expr) -> Expr:
    """``a / b``, simplified."""
    return _construct(("div", a, b))


def pow_(a: Expr, b: Expr) -> Expr:
    """``a ^ b``, simplified; ``0^0`` is 1, a negative base with a fractional exponent is not a number."""
    return _construct(("pow", a, b))


def neg(a: Expr) -> Expr:
    """``-a``, simplified."""
    return _construct(("neg", a, None))


def call(name: str, *args: Expr) -> Expr:
    """The function ``name`` of :data:`FUNCTIONS` applied to its arguments, simplified.

    Raises:
        ValueError: the function is unknown or takes another number of arguments.
    """
    if FUNCTIONS.get(name) != len(args):
        raise ValueError(f"no function {name!r} of {len(args)} arguments")
    return rebuild(name, args)


def rebuild(op: str, args: tuple[Expr, ...]) -> Expr:
    """The simplified node of any operator of :data:`ARITY`: what ``raw`` leaves alone."""
    if len(args) == 1:
        return _construct((op, args[0], None))
    a, b = args
    return _construct((op, b, a) if op in COMMUTATIVE and a.order > b.order else (op, a, b))


def sum_of(terms: Iterable[Expr]) -> Expr:
    """The sum of the terms, as a balanced tree: rounding grows as the logarithm of their number."""
    level = list(terms)
    if not level:
        return ZERO
    while len(level) > 1:
        paired = [add(level[k], level[k + 1]) for k in range(0, len(level) - 1, 2)]
        if len(level) % 2:
            paired.append(level[-1])
        level = paired
    return level[0]


def is_literal(e: Expr, value: float) -> bool:
    """Whether ``e`` is the literal of this value."""
    return e.op == "num" and e.payload == value


def finite(value: float) -> Expr | None:
    """The literal of a finite value, None otherwise: folding must never hide an undefined operation."""
    return num(value) if math.isfinite(value) else None


ZERO: Final = num(0.0)
ONE: Final = num(1.0)
