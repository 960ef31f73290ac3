"""The values of constants: from the file, from the caller, and from each other."""

from __future__ import annotations

import math
from collections.abc import Mapping

from stc.errors import UsageError
from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean, shortened
from stc.language.name_table import DATA_SET, NameTable
from stc.language.names import dependency_order
from stc.language.numbers import NOISE, NotANumber, Unknown, affine
from stc.language.words import FUNCTION_ADVICE, RESERVED

#: The largest ``n`` that is not taken for a slip.
MOST_FRAMES = 1e8


#: How a mistake begins that a name which has no fixed value is.
CANNOT_USE = "a constant cannot use"


class Constants:
    """The value of every constant (None after a mistake), and the constants from which it was computed."""

    def __init__(
        self,
        table: NameTable,
        overrides: Mapping[str, float],
        diagnostics: Diagnostics,
        damaged: frozenset[str],
    ) -> None:
        self.table = table
        self.diagnostics = diagnostics
        self.damaged = damaged
        self.reported: set[str] = set()  # undeclared names that have been noted: once each is enough
        self.values: dict[str, float | None] = {}
        self.needs: dict[str, list[str]] = {}
        self._check_overrides(overrides)
        self._evaluate(overrides)
        self.n = self._last_frame()

    def _check_overrides(self, overrides: Mapping[str, float]) -> None:
        origins = self.diagnostics.source.origins
        counts = {} if origins is None else origins.counts
        for name in counts:
            self.table.entries[name].used = True
        # `n` and `h` mean something in every file, so they can be given even where the file is silent
        for name, value in overrides.items():
            if name in counts and value != counts[name]:
                raise UsageError(
                    f"`{name}` cannot be set from outside: it counts repetitions of the spec, where it is "
                    f"{counts[name]}",
                    f"change `{name} = {counts[name]}` in the text of the spec",
                )
            kind = self.table.kind(name)
            if kind is None and name not in ("n", "h") and name not in self.damaged:
                known = self.table.of_kind("constant")
                hint = did_you_mean(name, known) or (
                    "its constants are " + ", ".join(f"`{k}`" for k in known) if known else "it declares none"
                )
                raise UsageError(f"the spec has no constant `{name}`", hint)
            if kind not in (None, "constant"):
                raise UsageError(f"`{name}` is a {kind} of the spec; only constants can be set from outside")
            try:
                number = float(value)
            except (TypeError, ValueError):
                raise UsageError(f"the constant `{name}` needs a number, not {value!r}") from None
            if math.isnan(number):
                raise UsageError(f"the constant `{name}` needs a number, not nan")

    def _evaluate(self, overrides: Mapping[str, float]) -> None:
        for name in ("n", "h"):
            if name in overrides and self.table.kind(name) is None:
                self.values[name] = float(overrides[name])
        constants = self.table.of_kind("constant")
        for name in constants:
            inside = [] if name in overrides else self.table.names_in(name)
            self.needs[name] = [k for k in inside if self.table.kind(k) == "constant"]
            for k in inside:
                if k in self.table.entries:
                    self.table.entries[k].used = True
        order, cycles = dependency_order(constants, self.needs.__getitem__)
        circular: set[str] = set()
        for cycle in cycles:
            circular.update(cycle)
            entry = self.table.entries[cycle[0]]
            message = f"the constant `{cycle[0]}` is defined by itself"
            hint = " needs ".join(shortened([f"`{name}`" for name in cycle]))
            self.diagnostics.error(message, entry.start, entry.end, hint)
        for name in order:
            self.values[name] = self._value(name, overrides, circular)

    def _value(self, name: str, overrides: Mapping[str, float], circular: set[str]) -> float | None:
        entry = self.table.entries[name]
        if name in overrides:
            return float(overrides[name])
        if name in circular:
            return None
        if entry.value is None:
            hint = f"give it one here (`{name} = ...`) or from outside with `--set {name}=value`"
            self.diagnostics.error(f"the constant `{name}` has no value", entry.start, entry.end, hint)
            return None
        try:
            return affine(entry.value, self.resolve)[1]
        except NotANumber as problem:
            self.diagnostics.error(problem.message, problem.node.start, problem.node.end, problem.hint)
        except Unknown:
            pass
        return None

    def value_of(self, expression: syntax.Expression) -> float | None:
        """The value of an expression of constants; None if it contains anything else or has no value."""
        try:
            return affine(expression, self.resolve)[1]
        except (NotANumber, Unknown):
            return None

    def resolve(self, node: syntax.Name) -> tuple[float, float]:
        """The value of a name within the value of a constant."""
        name = node.name
        kind = self.table.kind(name)
        if kind == "constant":
            value = self.values.get(name)
            if value is None:
                raise Unknown
            return 0.0, value
        if name == "pi":
            return 0.0, math.pi
        if name == "inf":
            return 0.0, math.inf
        if name in ("n", "h") and kind is None and name in self.values:
            return 0.0, self.values[name] or 0.0
        if name == "h" and kind is None:
            return 0.0, 1.0
        if kind is not None:
            hint = (
                "define the name under `definitions:` instead"
                if kind != "definition"
                else "make it a constant too"
            )
            raise NotANumber(node, f"{CANNOT_USE} the {kind} `{name}`", hint)
        if name in ("t", "i"):
            hint = "define the name under `definitions:` instead"
            raise NotANumber(node, f"{CANNOT_USE} `{name}`, {RESERVED[name]}", hint)
        raise self.undeclared(node)

    def undeclared(self, node: syntax.Name, meant: str = "") -> NotANumber | Unknown:
        """The exception for an undeclared name; ``meant`` is the probable intention, if it is known."""
        name = node.name
        if name in self.damaged or name in self.reported or name == "?":
            return Unknown()
        self.reported.add(name)
        if name == "n":
            message = "`n`, the number of the last frame, has no value"
            return NotANumber(
                node, message, "declare it under `constants:` or set it from outside with `--set n=value`"
            )
        if "." in name and self.table.kind(name.partition(".")[0]) == DATA_SET:
            message = f"`{name}` is a column of data, and only numbers and constants can stand here"
            return NotANumber(node, message, "use it in a statement, or in a definition of `definitions:`")
        hint = (
            meant
            or did_you_mean(name, self.table.of_kind("constant"))
            or FUNCTION_ADVICE.get(name, "")
            or "declare it under `constants:`"
        )
        return NotANumber(node, f"`{name}` is not declared", hint)

    def _last_frame(self) -> int | None:
        """The value of ``n``, or None after adding a mistake."""
        entry = self.table.entries.get("n")
        start, end = (entry.start, entry.end) if entry is not None else (0, 0)
        value = self.values.get("n")
        if value is None and entry is None and not self.damaged and self._is_without_motion():
            value = 0.0
        if value is None:
            if entry is None and "n" not in self.damaged:
                hint = (
                    "declare it under `constants:`, as in `n = 60`, or set it from outside with `--set n=60`"
                )
                self.diagnostics.error("`n`, the number of the last frame, is not declared", start, end, hint)
            return None
        if math.isinf(value) or abs(value - round(value)) > NOISE or round(value) < 0:
            message = f"`n`, the number of the last frame, is {value:.12g}"
            self.diagnostics.error(message, start, end, "it has to be a whole number, 0 or more")
            return None
        if value > MOST_FRAMES:
            message = f"`n`, the number of the last frame, is {value:g}"
            self.diagnostics.error(
                message, start, end, f"more than {MOST_FRAMES:g} frames do not fit in memory"
            )
            return None
        self.values["n"] = float(round(value))
        return round(value)

    def _is_without_motion(self) -> bool:
        """Whether parameters are the only unknowns, so that there is a single frame."""
        return bool(self.table.of_kind("parameter")) and not self.table.of_kind("variable")

    def made_from(self, name: str) -> set[str]:
        """The constant and all constants that determine its value."""
        found: set[str] = set()
        waiting = [name]
        while waiting:
            at = waiting.pop()
            if at not in found:
                found.add(at)
                waiting.extend(self.needs.get(at, ()))
        return found
