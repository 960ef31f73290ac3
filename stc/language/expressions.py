"""From syntax to expressions: names, definitions, primes, indices and sides of jumps are resolved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from stc.language import syntax
from stc.language.constants import MOST_FRAMES, Constants
from stc.language.definitions import runs
from stc.language.diagnostics import Diagnostics, derivative_meant, did_you_mean
from stc.language.habits import function_hint
from stc.language.kinks import kinked
from stc.language.name_table import DATA_SET, TABLE, NameTable
from stc.language.numbers import KINKED, arity_message
from stc.language.positions import Positions
from stc.language.words import FUNCTION_ADVICE, OPERATORS, RESERVED, TABLE_ADVICE
from stc.problem import (
    CellRef,
    ConstantRef,
    DefinitionPiece,
    DefinitionRef,
    IndexRef,
    ParameterRef,
    TimeRef,
    VariableRef,
)
from stc.symbolic.differentiate import total_derivative
from stc.symbolic.expr import (
    FUNCTIONS,
    ONE,
    ZERO,
    Expr,
    add,
    call,
    div,
    evaluate,
    looked_up,
    mul,
    neg,
    num,
    pow_,
    sub,
    substitute,
    sum_of,
    sym,
    symbols,
)
from stc.time_derivatives import one_sided, rate, rate_with

if TYPE_CHECKING:
    from stc.language.data import Data
    from stc.language.model.paths import Paths
    from stc.language.model.scope import ModelScope

#: Looks like a function, unless a spec declares something of that name.
MOMENTUM = "momentum"

#: Calls that name things of a model.
WORDS_OF_MODELS = ("distance", "point")

#: Time derivatives of a higher order are taken for a slip.
MAX_ORDER = 20

#: Sums of more terms than this are added as a balanced tree.
LONG_SUM = 8

UNKNOWN = sym(ConstantRef("?"))
"""Placeholder for an expression with an error; the builder is then ``poisoned``."""

INDEX = sym(IndexRef())
TIME = sym(TimeRef())
PI = num(math.pi)


class ExpressionBuilder:
    """Builds expressions from syntax; adds every mistake and continues with a placeholder.

    ``macros`` are the definitions known by one value, ``pieces`` those under range headers, ``step`` is
    ``h``; the processing of definitions fills them in.  ``poisoned`` is set if an expression contains a placeholder
    after a mistake: further checks of that expression would only repeat it.
    """

    def __init__(
        self, table: NameTable, constants: Constants, positions: Positions, diagnostics: Diagnostics
    ) -> None:
        self.table = table
        self.constants = constants
        self.positions = positions
        self.diagnostics = diagnostics
        self.macros: dict[str, Expr] = {}
        self.pieces: dict[str, list[DefinitionPiece]] = {}
        self.step: Expr = ONE
        self.poisoned = False
        self.first_use: dict[tuple[str, int], tuple[int, int]] = {}
        self.integral_definitions: set[str] = set()
        self.momenta: dict[str, Expr] | None = None
        self._leaves: dict[str, Expr] = {"pi": PI, "t": TIME, "i": INDEX}
        self.derivatives: dict[Expr, Expr] = {}
        self._rates: dict[Expr, Expr] = {}
        self._rate: Callable[[object], Expr] = rate
        self.paths: Paths | None = None
        self.model_is_missing = False
        self.data: Data | None = None
        self.model_hint = ""  # what to write for the word `model` in an expression
        self.kinks: dict[Expr, syntax.Call] = {}  # what has one, and the call that it is from
        self.rows = ""  # the data set on whose rows a statement stands
        self._build: dict[type, Callable[[Any], Expr]] = {
            syntax.Number: self._number,
            syntax.Name: self._name,
            syntax.Negate: self._negate,
            syntax.Sum: self._sum,
            syntax.Product: self._product,
            syntax.Power: self._power,
            syntax.Call: self._call,
            syntax.Prime: self._prime,
            syntax.Index: self._index,
            syntax.Vector: self._vector,
            syntax.Member: self._member,
        }

    def build(self, node: syntax.Expression) -> Expr:
        """The expression; if a part is invalid, a mistake is added and ``poisoned`` set."""
        return self._build[type(node)](node)

    def fail(self, node: syntax.Node, message: str, hint: str = "") -> Expr:
        """Add a mistake and return the placeholder."""
        self.diagnostics.error(message, node.start, node.end, hint)
        self.poisoned = True
        return UNKNOWN

    def use_model(self, model: ModelScope) -> None:
        """Let paths name the elements of a model, and differentiate its quaternions by angular velocities."""
        from stc.language.model.paths import Paths

        self.paths = Paths(model, self.derivatives)
        self._rate = rate_with(model.rotations)

    def rename_as_pieces(self, name: str, pieces: list[DefinitionPiece]) -> None:
        """Treat a definition as ranged instead of a macro."""
        del self.macros[name]
        self.pieces[name] = pieces
        self._leaves.pop(name, None)

    # ----------------------------------------------------------------- leaves

    def _number(self, node: syntax.Number) -> Expr:
        return num(node.value)

    def _name(self, node: syntax.Name) -> Expr:
        name = node.name
        leaf = self._leaves.get(name)
        if leaf is not None:
            return leaf
        entry = self.table.entries.get(name)
        if entry is None:
            if name == "h":
                return self.step
            if name == "n" and "n" in self.constants.values:
                return sym(ConstantRef("n"))
            return self._undeclared(node)
        entry.used = True
        if entry.kind == "constant":
            leaf = sym(ConstantRef(name))
        elif entry.kind == "variable":
            leaf = sym(VariableRef(name))
        elif entry.kind == "parameter":
            leaf = sym(ParameterRef(name))
        elif name in self.macros:
            leaf = self.macros[name]
        elif name in self.pieces:
            leaf = sym(DefinitionRef(name))
        elif entry.kind in (DATA_SET, TABLE):
            return self._bare_data(node, entry.kind)
        elif name in self.integral_definitions:
            message = (
                f"the definition `{name}` holds an integral; it may only stand as a term of the objective"
            )
            return self.fail(node, message)
        else:  # a definition that could not be understood; that has been noted
            self.poisoned = True
            return UNKNOWN
        self._leaves[name] = leaf
        return leaf

    def _undeclared(self, node: syntax.Name) -> Expr:
        name = node.name
        before, self.poisoned = self.poisoned, True
        if name == "inf":
            hint = "leave a bound out where there is none"
            return self.fail(node, "`inf` may only stand alone, as a bound", hint)
        if name in FUNCTIONS or name in OPERATORS:
            return self.fail(node, f"the function `{name}` has no arguments", f"write `{name}(...)`")
        of_model = self.model_is_missing and name in ("effort", "power")
        if "." in name or of_model or (self.paths is not None and self.paths.is_word(name)):
            self.poisoned = before
            return self._path(node)
        if name not in self.constants.reported and name not in self.constants.damaged and name != "n":
            self.constants.reported.add(name)
            known = [*self.table.entries, *RESERVED, "n", "h"]
            hint = (
                (name == "model" and self.model_hint)
                or (
                    self.diagnostics.source.repeats(name, node.start)
                    and f"within the repetition write `{{{name}}}`"
                )
                or derivative_meant(name, self.table.of_kind("variable"))
                or (name == "dt" and "the time from one frame to the next is `h`; a derivative is `x'`")
                or did_you_mean(name, known)
                or "declare it under `constants:`, `variables:` or `parameters:`"
            )
            return self.fail(node, f"`{name}` is not declared", hint)
        return UNKNOWN

    def _bare_data(self, node: syntax.Name, kind: str) -> Expr:
        """The mistake of using the name of a data set or table as an expression."""
        if kind == TABLE:
            return self.fail(node, f"the table `{node.name}` has no arguments", f"write `{node.name}(...)`")
        hint = f"name one of its columns, as in `{node.name}.x`, or make a table of them under `data:`"
        return self.fail(node, f"`{node.name}` is a data set, not a number", hint)

    def _reference(self, node: syntax.Name) -> Expr:
        """A column of a data set, as a function of time; in a statement on its rows, as the number in each row."""
        assert self.data is not None
        if self.rows and node.name.partition(".")[0] == self.rows:
            return self._cell(node)
        found = self.data.reference(node)
        if found is None:
            self.poisoned = True
            return UNKNOWN
        return looked_up(found[0], TIME)

    def _cell(self, node: syntax.Name) -> Expr:
        assert self.data is not None
        found = self.data.column(node)
        if found is None:
            self.poisoned = True
            return UNKNOWN
        data, name, values = found
        if values.shape != (data.rows,):
            from stc.data_sets import sizes

            hint = "each row has one number in every column that a statement on rows reads"
            message = f"`{node.name}` has {sizes(values)} numbers, and `{data.name}` {data.rows} rows"
            return self.fail(node, message, hint)
        return sym(CellRef(data.name, name))

    def _looked_up(self, node: syntax.Call) -> Expr:
        """A table with its arguments, or with a prime for each derivative by its only argument."""
        name = node.function.rstrip("'")
        order = len(node.function) - len(name)
        self.table.entries[name].used = True
        arguments = [self.build(argument) for argument in node.arguments]
        ref = None if self.data is None else self.data.tables.get(name)
        if ref is None:  # it could not be read, which has been noted
            self.poisoned = True
            return UNKNOWN
        wanted = len(ref.orders)
        if len(arguments) != wanted:
            plural = "s" if wanted > 1 else ""
            message = f"the table `{name}` takes {wanted} argument{plural}, not {len(arguments)}"
            return self.fail(node, message)
        if order and wanted > 1:
            hint = f"the derivative by time is written `{name}(...)'`"
            return self.fail(node, f"the table `{name}` has a slope for each of its arguments", hint)
        for _ in range(order):
            slope = ref.derivative(0)
            if slope is None:  # of a straight line
                return num(0.0)
            ref = slope
        return looked_up(ref, *arguments)

    def _path(self, node: syntax.Name) -> Expr:
        """An element of the model, or a column of data."""
        if self.table.kind(node.name.partition(".")[0]) == DATA_SET:
            return self._reference(node)
        found = self._of_model(node, node.name, lambda paths: paths.resolve(node.name))
        if not self.poisoned:
            self._leaves[node.name] = found
        return found

    def _of_model(self, node: syntax.Expression, text: str, resolve: Callable[[Paths], Expr]) -> Expr:
        """The model's expression for a path or a call; mistakes are added."""
        if self.paths is None and (self.model_is_missing or text.partition(".")[0] in self.constants.damaged):
            self.poisoned = True  # that the model or the data cannot be read has been told
            return UNKNOWN
        if self.paths is None:
            sets = () if self.data is None else self.data.sets
            hint = did_you_mean(text.partition(".")[0], sets) or (
                'name the model under `model:`, as in `model: "robot.xml";`'
            )
            if text.startswith("model."):
                hint = self.model_hint
            return self.fail(node, f"`{text}` is a path of a model, and the spec has none", hint)
        from stc.language.model.paths import PathError

        try:
            return resolve(self.paths)
        except PathError as error:
            return self.fail(node, error.message, error.hint)

    def _member(self, node: syntax.Member) -> Expr:
        """A field of `point(body.NAME, x, y, z)`."""
        call = node.operand
        if call.function != "point":
            hint = "of a point in a body there are: `point(body.NAME, x, y, z).vx`"
            return self.fail(node, f"`{call.function}(...)` has no fields", hint)
        if self.paths is None:
            return self._of_model(node, "point(...)", lambda _: UNKNOWN)
        at = [self.build(part) for part in call.arguments[1:]]
        return (
            UNKNOWN
            if self.poisoned
            else self._of_model(node, "point(...)", lambda paths: paths.of_point(call, at, node.fields))
        )

    def _vector(self, node: syntax.Vector) -> Expr:
        hint = "state each component by itself; a vector moves a pose, as in `keyframe.stand + (0.5, 0, 0)`"
        return self.fail(node, "an expression is a number, not a vector", hint)

    # ------------------------------------------------------------- arithmetic

    def _negate(self, node: syntax.Negate) -> Expr:
        return neg(self.build(node.operand))

    def _sum(self, node: syntax.Sum) -> Expr:
        build = self._build
        if len(node.terms) > LONG_SUM:
            terms = [(sign, build[type(term)](term)) for sign, term in node.terms]
            return sum_of([e if sign == "+" else neg(e) for sign, e in terms])
        first = node.terms[0][1]
        result = build[type(first)](first)
        for sign, term in node.terms[1:]:
            e = build[type(term)](term)
            result = add(result, e) if sign == "+" else sub(result, e)
        return result

    def _product(self, node: syntax.Product) -> Expr:
        build = self._build
        first = node.factors[0][1]
        result = build[type(first)](first)
        for operator, factor in node.factors[1:]:
            e = build[type(factor)](factor)
            if operator == "/" and e is ZERO and not self.poisoned:
                return self.fail(factor, "division by zero")
            result = mul(result, e) if operator == "*" else div(result, e)
        return result

    def _power(self, node: syntax.Power) -> Expr:
        base, exponent = self.build(node.base), self.build(node.exponent)
        if exponent.op == "num" or self.poisoned:
            return pow_(base, exponent)
        keys = symbols(exponent)
        if all(isinstance(k, ConstantRef) for k in keys) and not all(
            isinstance(k, ConstantRef) for k in symbols(base)
        ):
            # x^k with a constant k: its derivatives take their form from the number
            numbers = {k: self.positions.structural_value(k.name) for k in keys}
            if None in numbers.values():
                self.poisoned = True
                return UNKNOWN
            value = evaluate(exponent, numbers)
            if not math.isfinite(value):
                return self.fail(node.exponent, f"the exponent is {value:g}")
            whole = round(value)
            return pow_(base, num(whole if abs(value - whole) < 1e-12 else value))
        return pow_(base, exponent)

    def _call(self, node: syntax.Call) -> Expr:
        function = node.function
        if function in ("before", "after"):
            return self._one_sided(node)
        if function == MOMENTUM and self.table.kind(MOMENTUM) is None:
            return self._momentum(node)
        if self.table.kind(function.rstrip("'")) == TABLE:
            return self._looked_up(node)
        if function.endswith("'"):
            hint = f"write `{function}*(...)` to multiply"
            what = (
                f"`{function}(...)` would be the slope of a table, and `{function.rstrip(chr(39))}` is none"
            )
            return self.fail(node, what, hint)
        if function in TABLE_ADVICE and self.table.kind(function) is None:
            return self.fail(node, f"`{function}` cannot stand in an expression", TABLE_ADVICE[function])
        if function in WORDS_OF_MODELS and self.table.kind(function) is None:
            return self._of_model(node, f"{function}(...)", lambda paths: paths.call(node))
        arguments = [self.build(argument) for argument in node.arguments]
        if function in KINKED and self.table.kind(function) is None:
            return kinked(self, node, arguments)
        if function in FUNCTIONS:
            if len(arguments) != FUNCTIONS[function]:
                return self.fail(node, arity_message(function, len(arguments)))
            return call(function, *arguments)
        if function == "integral":
            hint = (
                "there it may have a factor of constants and parameters; "
                "for an integral within a constraint make a variable of it: `w' = e;`"
            )
            return self.fail(node, "`integral` may only stand as a term of the objective", hint)
        kind = self.table.kind(function)
        if kind is not None or function in ("t", "i", "pi", "n", "h"):
            hint = f"write `{function}*(...)` to multiply"
            if kind in ("variable", "definition"):
                hint += f", `{function}[k]` for the value at frame k"
            what = f"`{function}` is a {kind}, not a function" if kind else f"`{function}` is not a function"
            return self.fail(node, what, hint)
        if function in self.constants.damaged:  # what is wrong with it has been told
            self.poisoned = True
            return UNKNOWN
        source = self.diagnostics.source
        texts = [source.text[argument.start : argument.end] for argument in node.arguments]
        hint = (
            function_hint(function, texts)
            or FUNCTION_ADVICE.get(function)
            or did_you_mean(function, [*FUNCTIONS, *OPERATORS])
        )
        return self.fail(
            syntax.Name(node.start, node.start + len(function), function),
            f"there is no function `{function}`",
            hint or f"functions are {', '.join(FUNCTIONS)}",
        )

    def _momentum(self, node: syntax.Call) -> Expr:
        """``momentum(q)``: the derivative of the Lagrangian by q'."""
        arguments = node.arguments
        if len(arguments) != 1 or not isinstance(arguments[0], syntax.Name):
            return self.fail(node, "`momentum` takes the name of one coordinate, as in `momentum(x)`")
        name = arguments[0].name
        if self.paths is not None or self.model_is_missing:
            hint = "write `momentum.x` of the whole, `angular.x`, or `momentum.NAME.x` of a body and what hangs on it"
            return self.fail(node, "a spec with a model has no Lagrangian, and so no `momentum(q)`", hint)
        if self.momenta is None:
            hint = "use it under `constraints:` or `objective:`, where the Lagrangian is known"
            return self.fail(node, "`momentum` is not known yet within a definition or Lagrangian", hint)
        if name not in self.momenta:
            hint = did_you_mean(name, list(self.momenta)) or "it is the derivative of the Lagrangian by `q'`"
            return self.fail(arguments[0], f"no Lagrangian has `{name}'` in it", hint)
        return self.momenta[name]

    # ------------------------------------------------- sides, primes, indices

    def _one_sided(self, node: syntax.Call) -> Expr:
        side = node.function
        if len(node.arguments) != 1:
            for argument in node.arguments:
                self.build(argument)
            return self.fail(node, f"`{side}` takes 1 argument, not {len(node.arguments)}")
        e = self.build(node.arguments[0])
        if any(getattr(key, "side", "") for key in symbols(e)):
            hint = "an expression is read on one side of a jump"
            return self.fail(node, "`before` and `after` cannot stand within each other", hint)
        return one_sided(e, side)

    def derivative(self, e: Expr, order: int) -> Expr:
        """The total time derivative, cached in ``derivatives``."""
        for _ in range(order):
            found = self.derivatives.get(e)
            if found is None:
                found = self.derivatives[e] = self.rate(e)
            e = found
        return e

    def rate(self, e: Expr) -> Expr:
        """The first time derivative, for internal use."""
        return total_derivative(e, self._rate, self._rates)

    def _prime(self, node: syntax.Prime) -> Expr:
        operand, order = node.operand, node.order
        if isinstance(operand, syntax.Name) and self.table.kind(operand.name) == "variable":
            name = operand.name
            if self.paths is not None and self.paths.is_orientation(name):
                if order > 1:
                    hint = "write angular accelerations, as in `joint.NAME.wx'`"
                    return self.fail(node, "a quaternion has no second derivative of its own", hint)
                return self.derivative(sym(VariableRef(name)), order)
            self.table.entries[name].used = True
            if order > MAX_ORDER:
                return self.fail(node, f"time derivatives go up to order {MAX_ORDER}")
            self.first_use.setdefault((name, order), (node.start, node.end))
            return sym(VariableRef(name, order))
        e = self.build(operand)
        if self.poisoned:
            return UNKNOWN
        if any(isinstance(key, CellRef) for key in symbols(e)):
            hint = "between its rows nothing has been measured"
            return self.fail(node, "the numbers of a row have no time derivative", hint)
        highest = max((k.order for k in symbols(e) if isinstance(k, VariableRef | DefinitionRef)), default=0)
        if highest + order > MAX_ORDER:
            return self.fail(node, f"time derivatives go up to order {MAX_ORDER}")
        if self.holds_index(e):
            shown = "the definition uses the index `i`, which" if isinstance(operand, syntax.Name) else "`i`"
            if isinstance(operand, syntax.Name) and operand.name == "i":
                shown = "the index `i`"
            hint = "write it in terms of the time `t`"
            return self.fail(node, f"{shown} has no time derivative", hint)
        fixed = [k for k in symbols(e) if isinstance(k, VariableRef) and k.scale == 0]
        if fixed and e.op != "sym":
            frame = fixed[0].shift
            message = f"`{fixed[0]}` within a primed expression gives its derivative at frame {frame}, not 0"
            hint = "a prime and an index commute; where the value is meant as a number, prime the rest alone"
            self.diagnostics.warning(message, node.start, node.end, hint)
        return self.derivative(e, order)

    def holds_index(self, e: Expr) -> bool:
        """Whether ``i`` occurs in an expression or in a piece of a definition that it uses."""
        seen: set[str] = set()
        waiting = [e]
        while waiting:
            for key in symbols(waiting.pop()):
                if isinstance(key, IndexRef):
                    return True
                if isinstance(key, DefinitionRef) and key.name not in seen:
                    seen.add(key.name)
                    waiting.extend(piece.body for piece in self.pieces.get(key.name, ()))
        return False

    def _index(self, node: syntax.Index) -> Expr:
        e = self.build(node.operand)
        position = self.positions.index(node.index)
        if position is None:
            self.poisoned = True
        if self.poisoned or position is None:
            return UNKNOWN
        if all(isinstance(key, ConstantRef | ParameterRef) for key in symbols(e)):
            hint = "only variables and what is made of them have a value at every frame"
            return self.fail(node, "this is the same at every frame; it takes no index", hint)
        return self._moved(node, e, *position)

    def _moved(self, node: syntax.Node, e: Expr, scale: Fraction | int, shift: Fraction | int) -> Expr:
        """The value of ``e`` at frame ``scale*i + shift``."""
        mapping: dict[object, Expr] = {}
        for key in symbols(e):
            if isinstance(key, VariableRef):
                at = _tidy(scale * key.scale), _tidy(shift * key.scale + key.shift)
                hint = f"its frames are 0 to {self.constants.n}"
                if at[0] == 0 and not (at[1].denominator == 1 and 0 <= at[1] <= (self.constants.n or 0)):
                    return self.fail(node, f"`{key.name}` is read at frame {at[1]}, outside the motion", hint)
                # Such numbers of frames would not fit into the integers of arrays.
                if not all(-MOST_FRAMES <= number <= MOST_FRAMES for number in at):
                    return self.fail(node, f"`{key.name}` is read outside the motion", hint)
                mapping[key] = sym(replace(key, scale=at[0], shift=at[1]))
            elif isinstance(key, IndexRef):
                mapping[key] = add(mul(num(float(scale)), INDEX), num(float(shift)))
            elif isinstance(key, TimeRef):
                if any(not isinstance(k, ConstantRef | ParameterRef) for k in symbols(self.step)):
                    hint = "make a variable of it: `clock' = 1;`"
                    return self.fail(
                        node, "the time at another frame is known only where all steps are equal", hint
                    )
                mapping[key] = mul(self.step, add(mul(num(float(scale)), INDEX), num(float(shift))))
            elif isinstance(key, DefinitionRef):
                if (scale, shift) == (1, 0):
                    continue
                if scale != 0:
                    hint = "index the variables in its formulas, or make a variable that equals it"
                    message = f"`{key.name}` stands under range headers; a relative index cannot read it"
                    return self.fail(node, message, hint)
                run = runs(self.pieces[key.name], int(shift), int(shift))[0]
                if run.piece is None:
                    return self.fail(node, f"`{key.name}` has no definition on frame {shift}")
                value = self.derivative(run.piece.body, key.order)
                value = one_sided(value, key.side) if key.side else value
                mapping[key] = self._moved(node, value, scale, shift)
        return substitute(e, mapping) if mapping else e


def _tidy(value: Fraction | int) -> Fraction | int:
    """A fraction as int if it is a whole number, otherwise unchanged."""
    return value.numerator if value.denominator == 1 else value


__all__ = ["INDEX", "PI", "TIME", "UNKNOWN", "ExpressionBuilder"]
