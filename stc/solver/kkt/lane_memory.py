"""Vectors of eight lanes that are asked for before they are needed, or written past the caches."""

from __future__ import annotations

from stc.codegen.native import f64s, i64, native
from stc.codegen.native_vector import load8, prefetch8, store8, stream8

__all__ = ["ask_ahead", "ask_behind", "put_vectors"]


@native(inline=True)
def ask_ahead(distance: i64, vectors: i64, far: i64, at: i64, x: f64s) -> None:
    """Ask for what is so far ahead of some vectors of ``x``, which are ``far`` numbers apart."""
    if distance > 0:
        for k in range(vectors):
            prefetch8(x, at + distance + k * far)


@native(inline=True)
def ask_behind(distance: i64, vectors: i64, at: i64, x: f64s) -> None:
    """Ask for what is so far behind some vectors of ``x``, the last one first: processors foresee a steady descent."""
    if distance > 0:
        for k in range(vectors):
            prefetch8(x, at - distance + 8 * (vectors - 1 - k))


@native(inline=True)
def put_vectors(streamed: i64, vectors: i64, part: f64s, at: i64, x: f64s) -> None:
    """Copy some vectors of ``part`` to ``x`` from ``at`` on, past the caches when ``streamed``."""
    if streamed != 0:
        for k in range(vectors):
            stream8(x, at + 8 * k, load8(part, 8 * k))
    else:
        for k in range(vectors):
            store8(x, at + 8 * k, load8(part, 8 * k))
