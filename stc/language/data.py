"""The declarations of `data:`: columns of numbers, tables as functions, and recorded motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stc.data_sets import TIME, DataError, DataSet, read_file, sizes
from stc.language import syntax
from stc.language.constants import CANNOT_USE, Constants
from stc.language.data_made import (
    MOST_CELLS,
    NEAR_HINT,
    bridged,
    checked,
    found_beside,
    grid,
    keyframes,
    plain_path,
    presence,
    split_path,
    stretches,
    too_near,
)
from stc.language.diagnostics import Diagnostics, did_you_mean, shortened
from stc.language.name_table import DATA_SET, NameTable
from stc.language.numbers import NotANumber, Unknown, affine
from stc.language.turned import TURNS, remark, unwrapped
from stc.symbolic.tables import KINDS, OUTSIDE, Table, TableRef, interpolated

__all__ = ["Data"]

FloatArray = NDArray[np.float64]

#: So far beyond a stretch of a recorded motion, as a share of the recording, rounding of a time is forgiven.
_FORGIVEN = 1e-9


class Data:
    """The data of a spec, read and checked; mistakes are added.

    Attributes:
        sets: columns of numbers by name.
        tables: functions by name.
        structural: the constants from which numbers in the spec were computed.
    """

    def __init__(
        self, tree: syntax.SpecTree, table: NameTable, constants: Constants, diagnostics: Diagnostics
    ) -> None:
        self.tree = tree
        self.names = table
        self.constants = constants
        self.diagnostics = diagnostics
        self.sets: dict[str, DataSet] = {}
        self.tables: dict[str, TableRef] = {}
        self.structural: set[str] = set()
        self._references: dict[tuple[str, str], tuple[TableRef, TableRef, bool] | None] = {}
        self._damaged: set[str] = set()
        self._leaping: set[tuple[str, str]] = set()
        tables: list[syntax.TableDefinition] = []
        for block in tree.blocks("data"):
            for statement in block.statements:
                if isinstance(statement, syntax.DataFile | syntax.DataKeyframes | syntax.DataRows):
                    self._take(statement)
                elif isinstance(statement, syntax.TableDefinition):
                    tables.append(statement)
        for definition in tables:
            self._define(definition)

    # ---- columns ---------------------------------------------------------------------------------------------------

    def _take(self, statement: syntax.DataFile | syntax.DataKeyframes | syntax.DataRows) -> None:
        name = statement.name.name
        if name in self.sets or self.names.kind(name) != DATA_SET:
            return  # it is declared twice, which has been noted
        try:
            if isinstance(statement, syntax.DataFile):
                found = self._file(statement)
            elif isinstance(statement, syntax.DataKeyframes):
                found = self._keyframes(statement)
            else:
                found = self._rows(statement)
        except DataError as error:
            self.diagnostics.error(error.message, statement.start, statement.end, error.hint)
            found = None
        if found is None:
            self._damaged.add(name)
        else:
            self.sets[name] = found

    def _file(self, statement: syntax.DataFile) -> DataSet | None:
        key = "data", statement.name.name
        known = self.tree.models.get(key)
        if not isinstance(known, DataSet):
            source = self.tree.source
            content = found_beside(statement.path, source.path, source.carried)
            known = self.tree.models[key] = read_file(statement.name.name, statement.path, content)
        columns = dict(known.columns)
        structural: set[str] = set()
        for path, written in statement.unwrapped:
            name, turn = plain_path(path.name), TURNS[0][0]
            if name not in columns:
                self.diagnostics.error(*_no_column(known, name, path))
                return None
            if written is not None:
                value = self._number(written)
                if value is None:
                    return None
                if not value > 0.0:
                    message = f"a whole turn is {value:g}"
                    self.diagnostics.error(message, written.start, written.end, "write 360, or 2*pi")
                    return None
                turn = value
                structural |= self._used([written])
            if columns[name].ndim == 1:
                columns[name] = unwrapped(columns[name], turn)
        return replace(known, columns=columns, structural=frozenset(structural))

    def _used(self, cells: Iterable[syntax.Expression]) -> frozenset[str]:
        """The constants from which some numbers were computed, which are recorded."""
        used = {name for cell in cells for name in syntax.names(cell) if name in self.constants.values}
        for name in used:
            if name in self.names.entries:
                self.names.entries[name].used = True
        structural = frozenset(each for name in used for each in self.constants.made_from(name))
        self.structural |= structural
        return structural

    def warn_of_leaps(self, data: str, column: str, start: int, end: int) -> None:
        """Warn once of a column that is tracked or measured and jumps by whole turns."""
        if (data, column) not in self._leaping:
            self._leaping.add((data, column))
            found = remark(self.sets[data], column)
            if found is not None:
                self.diagnostics.warning(found[0], start, end, found[1])

    def _keyframes(self, statement: syntax.DataKeyframes) -> DataSet | None:
        """The keyframes of the model: its coordinates, angular velocities and controls at their times."""
        if self.names.model is None:
            if not any(self.tree.blocks("model")):  # else what is wrong with it has been told
                hint = 'name it, as in `model: "robot.xml";`'
                raise DataError("keyframes are those of a model, and the spec has none", hint)
            return None
        return keyframes(statement.name.name, self.names.model)

    def _rows(self, statement: syntax.DataRows) -> DataSet | None:
        names: list[str] = []
        for column in statement.columns:
            name = plain_path(column.name)
            if name in names:
                self.diagnostics.error(f"there are two columns `{name}`", column.start, column.end)
                return None
            names.append(name)
        numbers = np.empty((len(statement.rows), len(names)))
        for k, row in enumerate(statement.rows):
            for j, cell in enumerate(row):
                value = self._number(cell)
                if value is None:
                    return None
                numbers[k, j] = value
        structural = self._used(cell for row in statement.rows for cell in row)
        columns = {name: numbers[:, j].copy() for j, name in enumerate(names)}
        return DataSet(statement.name.name, columns, structural=structural)

    def _number(self, cell: syntax.Expression) -> float | None:
        try:
            value = affine(cell, self.constants.resolve)[1]
        except NotANumber as problem:
            message, hint = problem.message, problem.hint
            if message.startswith(CANNOT_USE):
                message = f"a row of data cannot use{message.removeprefix(CANNOT_USE)}"
                hint = "rows are made of constants; what is unknown goes where they are used, as in `p*f(x)`"
            self.diagnostics.error(message, problem.node.start, problem.node.end, hint)
            return None
        except Unknown:
            return None
        if not np.isfinite(value):
            self.diagnostics.error("a row holds finite numbers", cell.start, cell.end)
            return None
        return value

    def column(self, path: syntax.Name) -> tuple[DataSet, str, FloatArray] | None:
        """The column that a path names; None after a mistake, which is added."""
        word, name = split_path(path.name)
        if word in self._damaged or word in self.tree.damaged:
            return None
        found = self.sets.get(word)
        if found is None:
            hint = did_you_mean(word, self.sets) or 'declare it under `data:`, as in `polar = "polar.csv";`'
            what = (
                f"`{word}` is not a data set" if self.names.kind(word) else f"there is no data set `{word}`"
            )
            self.diagnostics.error(what, path.start, path.end, hint)
            return None
        self.names.entries[word].used = True
        if name not in found.columns:
            self.diagnostics.error(*_no_column(found, name, path))
            return None
        return found, name, found.columns[name]

    # ---- tables ----------------------------------------------------------------------------------------------------

    def _define(self, statement: syntax.TableDefinition) -> None:
        name = statement.name.name
        if name in self.tables or self.names.kind(name) != "table":
            return
        self._damaged.add(name)
        options = self._options(statement)
        count = len(statement.columns)
        if count not in (2, 3):
            message = f"a table is made of two or three columns, not of {count}"
            hint = "its arguments come first, its values last: `table(polar.alpha, polar.cl)`"
            self.diagnostics.error(message, statement.start, statement.end, hint)
            return
        columns = [self.column(path) for path in statement.columns]
        if options is None or None in columns:
            return
        known = [column for column in columns if column is not None]
        kind, outside = options
        made = self._curve if count == 2 else self._surface
        try:
            table = made(statement, known, kind, outside)
        except DataError as error:
            self.diagnostics.error(error.message, statement.start, statement.end, error.hint)
            return
        if table is None:
            return
        if kind == "linear":
            hint = (
                "a solver wants smooth functions: leave `linear` out, or take `monotone` against overshooting"
            )
            message = f"the table `{name}` has kinks, and no second derivatives"
            self.diagnostics.warning(message, statement.start, statement.end, hint)
        self._damaged.discard(name)
        self.tables[name] = TableRef(name, table, (0,) * (count - 1))

    def _options(self, statement: syntax.TableDefinition) -> tuple[str, str] | None:
        kind, outside = "", ""
        sound = True
        for option, value in statement.options:
            word = option.name
            if word == "outside" and value is not None and value.name in OUTSIDE and not outside:
                outside = value.name
            elif word in KINDS and value is None and not kind:
                kind = word
            else:
                sound = False
                at = option if value is None or word != "outside" else value
                known = OUTSIDE if at is value else (*KINDS, "outside")
                what = "a table" if at is option else "outside of a table there is"
                message = (
                    f"`{at.name}` is not an option of a table" if at is option else f"{what} no `{at.name}`"
                )
                if word in KINDS and value is None:
                    message = f"a table is either `{kind}` or `{word}`"
                hint = f"write `outside = {word}`" if word in OUTSIDE and value is None else ""
                hint = (
                    hint
                    or did_you_mean(at.name, known)
                    or (
                        "options are `monotone`, `linear`, `outside = hold`, `outside = extend` and `outside = error`"
                    )
                )
                self.diagnostics.error(message, at.start, at.end, hint)
        return (kind or "cubic", outside or "extend") if sound else None

    def _curve(
        self,
        statement: syntax.TableDefinition,
        columns: Sequence[tuple[DataSet, str, FloatArray]],
        kind: str,
        outside: str,
    ) -> Table | None:
        (_, _, x), (_, _, y) = columns
        if not self._same_length(statement, columns):
            return None
        for path, column in zip(statement.columns, columns, strict=True):
            if not self._complete(path, column):
                return None
        if _falls(x):
            x, y = x[::-1], y[::-1]
        elif not self._rising(statement.columns[0], columns[0]):
            return None
        return checked(interpolated([x], y, kind, outside))

    def _same_length(
        self, statement: syntax.TableDefinition, columns: Sequence[tuple[DataSet, str, FloatArray]]
    ) -> bool:
        first = columns[0][2]
        for path, (_, _, values) in zip(statement.columns, columns, strict=True):
            if values.ndim != 1:
                hint = "only the values of a table of two arguments may be a matrix"
                self.diagnostics.error(f"`{path.name}` is a matrix, not a column", path.start, path.end, hint)
                return False
            if len(values) != len(first):
                message = f"`{path.name}` has {len(values)} numbers and `{statement.columns[0].name}` has {len(first)}"
                self.diagnostics.error(message, path.start, path.end)
                return False
        return True

    def _complete(self, path: syntax.Name, column: tuple[DataSet, str, FloatArray]) -> bool:
        data, _, values = column
        missing = np.argwhere(np.isnan(values))
        if len(missing):
            message = f"`{path.name}` has no number on {data.place(int(missing[0][0]))}"
            hint = "a table needs all of them: leave the row out, or fill the cell"
            self.diagnostics.error(message, path.start, path.end, hint)
        elif len(values) < 2:
            message = f"`{path.name}` has {len(values)} number, and a table needs two at least"
            self.diagnostics.error(message, path.start, path.end)
        else:
            return True
        return False

    def _rising(self, path: syntax.Name, column: tuple[DataSet, str, FloatArray]) -> bool:
        data, _, values = column
        falls = np.flatnonzero(~(np.diff(values) > 0.0))
        if not len(falls):
            near = too_near(values)
            if near is None:
                return True
            message = f"`{path.name}` rises too little on {data.place(near + 1)}"
            self.diagnostics.error(message, path.start, path.end, NEAR_HINT)
            return False
        k = int(falls[0])
        what = "the same twice" if values[k] == values[k + 1] else "less than before"
        message = f"`{path.name}` is {what} on {data.place(k + 1)}: {values[k + 1]:.9g} after {values[k]:.9g}"
        hint = "sort the rows by it, and use each of its values only once"
        self.diagnostics.error(message, path.start, path.end, hint)
        return False

    def _surface(
        self,
        statement: syntax.TableDefinition,
        columns: Sequence[tuple[DataSet, str, FloatArray]],
        kind: str,
        outside: str,
    ) -> Table | None:
        if kind == "monotone":
            hint = "leave `monotone` out, or take `linear`"
            raise DataError("a table of two arguments has no `monotone` form", hint)
        paths = statement.columns
        (first, _, x), (_, _, y), (_, _, values) = columns
        if values.ndim == 2:
            if not all(self._complete(p, c) for p, c in zip(paths, columns, strict=True)):
                return None
            for path, column in zip(paths[:2], columns[:2], strict=True):
                if not (_falls(column[2]) or self._rising(path, column)):
                    return None
            if values.shape != (len(x), len(y)):
                message = (
                    f"`{paths[2].name}` has the shape {values.shape}, and its arguments have "
                    f"{len(x)} and {len(y)} numbers"
                )
                hint = (
                    "it has a row for each number of the first argument, and a column for each of the second"
                )
                if values.shape == (len(y), len(x)):
                    hint += f": write `table({paths[1].name}, {paths[0].name}, {paths[2].name})`, and the arguments so"
                self.diagnostics.error(message, paths[2].start, paths[2].end, hint)
                return None
            if _falls(x):
                x, values = x[::-1], values[::-1]
            if _falls(y):
                y, values = y[::-1], values[:, ::-1]
        else:
            if not self._same_length(statement, columns):
                return None
            if not all(self._complete(p, c) for p, c in zip(paths, columns, strict=True)):
                return None
            x, y, values = grid(first, [path.name for path in paths], x, y, values)
        if (len(x) + 1) * (len(y) + 1) > MOST_CELLS:
            raise DataError(
                f"a grid of {len(x)} by {len(y)} is too large", f"a table may have {MOST_CELLS} cells at most"
            )
        return checked(interpolated([x, y], values, kind, outside))

    # ---- recorded motions ------------------------------------------------------------------------------------------

    def reference(self, path: syntax.Name) -> tuple[TableRef, TableRef, bool] | None:
        """A column as a function of time; None after a mistake, which is added.

        Returns:
            the function, with straight lines over gaps; a function that is 1 where the column has numbers and 0
            elsewhere; whether it has gaps between its first number and its last.
        """
        found = self.column(path)
        if found is None:
            return None
        data, name, values = found
        key = data.name, name
        if key not in self._references:
            try:
                self._references[key] = self._followed(path, data, name, values)
            except DataError as error:
                self.diagnostics.error(error.message, path.start, path.end, error.hint)
                self._references[key] = None
        return self._references[key]

    def _followed(
        self, path: syntax.Name, data: DataSet, name: str, values: FloatArray
    ) -> tuple[TableRef, TableRef, bool] | None:
        time = data.time
        if time is None:
            hint = "make a function of it under `data:`, as in " + _example(data, name)
            hint += f"; or give the data a column `{TIME}`, in seconds, and it is one of time"
            self.diagnostics.error(
                f"`{path.name}` is a column of numbers, not a function", path.start, path.end, hint
            )
            return None
        of_time = syntax.Name(path.start, path.end, f"{data.name}.{TIME}"), (data, TIME, time)
        if values.shape != time.shape or time.ndim != 1:
            message = f"`{path.name}` has {sizes(values)} numbers, and `{data.name}.{TIME}` {sizes(time)}"
            hint = "a function of time has one number for each time"
            self.diagnostics.error(message, path.start, path.end, hint)
            return None
        if not self._complete(*of_time) or not self._rising(*of_time):
            return None
        runs = stretches(np.isfinite(values), 1)
        if np.isfinite(values).sum() < 2:
            message = f"`{path.name}` has fewer than two numbers; a motion needs at least two"
            self.diagnostics.error(message, path.start, path.end)
            return None
        self.warn_of_leaps(data.name, name, path.start, path.end)
        whole = f"{data.name}.{name}"
        zero = (0,)
        curve = TableRef(whole, checked(bridged(time, values, runs)), zero, of_time=True)
        slack = min(_FORGIVEN * float(time[-1] - time[0]), float(np.diff(time).min()) / 4.0)
        weight = TableRef(f"known({whole})", presence(time, runs, slack), zero, of_time=True)
        return curve, weight, len(runs) > 1

    def weight_of(self, ref: TableRef) -> tuple[TableRef, bool]:
        """The function of time that is 1 where a column has numbers and 0 in its gaps, and whether there are gaps."""
        for found in self._references.values():
            if found is not None and found[0] == ref.base:
                return found[1], found[2]
        raise KeyError(ref.name)

    def guessed(self, node: syntax.GuessFrom, variables: Iterable[str]) -> list[tuple[str, TableRef]]:
        """The variables that have a column in a data set, of the same name or without `joint.`; mistakes are added."""
        name = node.name.name
        data = self.sets.get(name)
        if data is None:
            return []
        self.names.entries[name].used = True
        if data.time is None:
            message = f"`{name}` has no column `{TIME}`, which is needed here"
            hint = f"add a column `{TIME}`, in seconds"
            self.diagnostics.error(message, node.start, node.end, hint)
            return []
        found: list[tuple[str, TableRef]] = []
        for variable in variables:
            rest, whole = split_path(variable)[1], plain_path(variable)
            column = next((each for each in (whole, rest) if each and each in data.columns), None)
            if column is not None and column != TIME:
                path = f"{name}." + ".".join(f'"{part}"' for part in column.split("."))
                made = self.reference(syntax.Name(node.start, node.end, path))
                if made is not None:
                    found.append((variable, made[0]))
        if not found and not self.diagnostics.error_count:
            listed = ", ".join(shortened([f"`{each}`" for each in data.columns if each != TIME]))
            message = f"no variable has the name of a column of `{name}`"
            self.diagnostics.error(message, node.start, node.end, f"its columns are {listed}")
        return found


def _falls(places: FloatArray) -> bool:
    """Whether points are in decreasing order, each different from the next."""
    return bool((np.diff(places) < 0.0).all()) and too_near(places[::-1]) is None


def _no_column(data: DataSet, name: str, path: syntax.Name) -> tuple[str, int, int, str]:
    """The message for a column that does not exist."""
    listed = ", ".join(shortened([f"`{each}`" for each in data.columns]))
    hint = did_you_mean(name, data.columns) or f"its columns are {listed}"
    if not name:
        return f"`{data.name}` is a data set: name one of its columns", path.start, path.end, hint
    return f"`{data.where or data.name}` has no column `{name}`", path.start, path.end, hint


def _example(data: DataSet, name: str) -> str:
    other = next((each for each in data.columns if each != name), "x")
    return f"`f = table({data.name}.{other}, {data.name}.{name});`"
