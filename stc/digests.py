"""Hashes from Python's own code: :mod:`hashlib` would load OpenSSL for them, 4 ms of every start.

The functions are those of :mod:`hashlib`, which stands in where the modules behind it are missing or have moved.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["blake2b", "sha256"]


def _find(name: str, *modules: str) -> Any:
    for module in modules:
        try:
            return getattr(import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"this Python has no {name}")


blake2b = _find("blake2b", "_blake2", "hashlib")
sha256 = _find("sha256", "_sha2", "_sha256", "hashlib")
