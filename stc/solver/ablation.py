"""Heuristics that can be switched off by name, to measure what each is worth: temporary.

``STC_ABLATE=name,name`` switches some off for a whole process.
"""

from __future__ import annotations

import os

__all__ = ["asked", "on"]

OFF = frozenset(filter(None, os.environ.get("STC_ABLATE", "").split(",")))
#: Those that were asked for since this was last emptied: what was not asked for cannot have made a difference.
asked: set[str] = set()


def on(name: str) -> bool:
    """Whether a heuristic is to do its work."""
    asked.add(name)
    return name not in OFF
