"""Inputs on the command line: specs, and numbers in the notation of the spec language."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from stc.errors import UsageError

if TYPE_CHECKING:
    from stc.language.syntax import Name
    from stc.pipeline import Model


def load(spec: str, constants: Mapping[str, float]) -> Model:
    """The model of a path or bundled name, with the constants of the user."""
    from stc.bundled import find_spec
    from stc.pipeline import Model, read_source

    return Model(read_source(find_spec(spec)), constants)


def number(text: str, where: str) -> float:
    """The value of an expression of numbers in the spec language: ``1/30``, ``2*pi``, ``-inf``.

    Raises:
        UsageError: it is not such an expression, or has no value; ``where`` is named in the message.
    """
    from stc.errors import Source, SpecError
    from stc.language.numbers import NotANumber, affine
    from stc.language.parser import parse_expression

    known = {"pi": math.pi, "inf": math.inf}

    def resolve(name: Name) -> tuple[float, float]:
        if name.name not in known:
            raise NotANumber(
                name,
                f"`{name.name}` is not a number",
                "only numbers, `pi`, `inf` and functions are allowed here",
            )
        return 0.0, known[name.name]

    try:
        return affine(parse_expression(Source(where, text)), resolve)[1]
    except SpecError as error:
        raise UsageError(f"{where}: {error.diagnostics[0].message}", error.diagnostics[0].hint) from None
    except NotANumber as error:
        raise UsageError(f"{where}: {error.message}", error.hint) from None


#: A constant's name, or the path of a number of the model: words with dots between them, others in quotes.
_NAME = re.compile(r'[^\W\d]\w*(\.(\w+|"[^"]+"))*')


def names_a_constant(text: str) -> bool:
    """Whether a text can be the name of a constant, as ``g`` or ``body.trunk.mass``."""
    return _NAME.fullmatch(text) is not None
