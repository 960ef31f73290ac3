"""The table of the names that a spec declares."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.language import syntax
from stc.records import dataclass, field

if TYPE_CHECKING:
    from stc.language.model.scope import ModelScope

#: What `data:` declares.
DATA_SET, TABLE = "data set", "table"


@dataclass(slots=True)
class Entry:
    """A declared name: its kind, the position of its first declaration, and whether it is used."""

    name: str
    kind: str
    start: int
    end: int
    value: syntax.Expression | None = None
    used: bool = False


@dataclass(slots=True)
class NameTable:
    """Every declared name, in the order of the text, and the model that declares some of them."""

    entries: dict[str, Entry] = field(default_factory=dict)
    model: ModelScope | None = None
    _inside: dict[str, list[str]] = field(default_factory=dict)

    def kind(self, name: str) -> str | None:
        """``constant``, ``variable``, ``parameter``, ``definition``, ``data set`` or ``table``; None when nothing
        declares it."""
        entry = self.entries.get(name)
        return None if entry is None else entry.kind

    def names_in(self, name: str) -> list[str]:
        """The names that occur in the declared value of a name, each once, in the order of the text."""
        found = self._inside.get(name)
        if found is None:
            value = self.entries[name].value
            found = self._inside[name] = [] if value is None else syntax.names(value)
        return found

    def of_kind(self, kind: str) -> list[str]:
        """All names of a kind, in the order of the text."""
        return [name for name, entry in self.entries.items() if entry.kind == kind]
