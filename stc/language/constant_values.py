"""The values of all constants of a spec, without elaborating the rest of it."""

from __future__ import annotations

from collections.abc import Mapping

from stc.errors import SpecError
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.name_table import NameTable
from stc.language.names import collect_names


class ConstantValues:
    """The constants of a spec, evaluated for one set of given values after another."""

    def __init__(self, tree: syntax.SpecTree) -> None:
        self._tree = tree
        self._table: NameTable | None = None

    def __call__(self, overrides: Mapping[str, float]) -> dict[str, float]:
        """The value of every constant: given by the caller, from the file, or computed from others.

        Raises:
            SpecError: a constant has no value.
            UsageError: an override names no constant.
        """
        tree = self._tree
        diagnostics = Diagnostics(tree.source)
        table = self._table or collect_names(tree, diagnostics, overrides)
        constants = Constants(table, overrides, diagnostics, tree.damaged)
        if diagnostics.error_count:
            raise SpecError(diagnostics.errors())
        if table.model is None:  # the names of a model may depend on what is given
            self._table = table
        return {name: value for name, value in constants.values.items() if value is not None}
