"""The values of all constants of a spec, without elaborating the rest of it."""

from __future__ import annotations

from collections.abc import Mapping

from stc.errors import SpecError
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.names import collect_names


def constant_values(tree: syntax.SpecTree, overrides: Mapping[str, float]) -> dict[str, float]:
    """The value of every constant: given by the caller, from the file, or computed from others.

    Raises:
        SpecError: a constant has no value.
        UsageError: an override names no constant.
    """
    diagnostics = Diagnostics(tree.source)
    constants = Constants(collect_names(tree, diagnostics, overrides), overrides, diagnostics, tree.damaged)
    if diagnostics.error_count:
        raise SpecError(diagnostics.errors())
    return {name: value for name, value in constants.values.items() if value is not None}
