"""Paths with a star, such as ``joint.*``, each of which stands for all elements of a kind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from stc.language import syntax

if TYPE_CHECKING:
    from stc.language.model.scope import ModelScope

S = TypeVar("S", bound=syntax.Node)


def each_of(statement: S, scope: ModelScope) -> Iterator[S]:
    """The statements for each element that a path with a star stands for; the statement itself without a star."""
    stars = {name for name in _names_in(statement) if name.endswith(".*")}
    if not stars:
        yield statement
        return
    for star in sorted(stars):
        for name in scope.starred(star):
            yield _renamed(statement, star, name)


def is_starred(statement: syntax.Node) -> bool:
    """Whether a statement contains a path with a star."""
    return any(name.endswith(".*") for name in _names_in(statement))


def _names_in(node: object) -> Iterator[str]:
    if isinstance(node, syntax.Name):
        yield node.name
    elif isinstance(node, syntax.Node):
        for part in node.__dataclass_fields__:
            yield from _names_in(getattr(node, part))
    elif isinstance(node, list | tuple):
        for each in node:
            yield from _names_in(each)


def _renamed(node: Any, star: str, name: str) -> Any:
    """A copy of a piece of syntax with another name in a star's place."""
    if isinstance(node, list):
        return [_renamed(each, star, name) for each in node]
    if isinstance(node, tuple):
        return tuple([_renamed(each, star, name) for each in node])
    if isinstance(node, syntax.Name):
        return replace(node, name=name) if node.name == star else node
    if isinstance(node, syntax.Node):
        parts = {part: _renamed(getattr(node, part), star, name) for part in node.__dataclass_fields__}
        return replace(node, **parts)
    return node
