"""The content of a solution file, independent of its format; :mod:`stc.solution_file` describes the layout."""

from __future__ import annotations

from typing import Any

import numpy as np

from stc.errors import SolutionError
from stc.records import dataclass, field
from stc.trajectory import FloatArray

#: Version of the layout.  A reader refuses files with another one.
FORMAT = 2


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """The content of a solution file, before the problem is built again from its text.

    Attributes:
        facts: everything but arrays.
        members: arrays by the names in :mod:`stc.solution_file`.
        used: the names of the members that were read; an unaltered file has no others.
    """

    facts: dict[str, Any]
    members: dict[str, np.ndarray]
    used: set[str] = field(default_factory=set)

    def vector(self, name: str) -> FloatArray:
        """A member as a list of numbers.

        Raises:
            SolutionError: it is not there, or no list.
        """
        if name not in self.members:
            raise SolutionError(f"the file is damaged: {name} is missing")
        self.used.add(name)
        values = np.asarray(self.members[name], dtype=np.float64)
        if values.ndim != 1:
            raise SolutionError(f"the file was altered: {name} is no list of numbers")
        return values


def check_facts(facts: Any) -> dict[str, Any]:
    """The facts of a file, if they are those of a solution that this version reads.

    Raises:
        SolutionError: they are not.
    """
    if not isinstance(facts, dict) or facts.get("kind") != "stc solution":
        raise SolutionError("this is not a solution file")
    if not isinstance(facts.get("format"), int):
        raise SolutionError("the file does not state its format version")
    if facts["format"] != FORMAT:
        raise SolutionError(
            f"the file has format {facts['format']}, written by stc {facts.get('stc_version', '?')}; this version "
            f"reads format {FORMAT}: {'install a newer stc' if facts['format'] > FORMAT else 'solve its spec again'}"
        )
    if facts.get("trials", [""]) != [""]:
        raise SolutionError(
            "the file holds several motions, which this version does not read: install a newer stc"
        )
    return facts
