"""Measurements: ``python -m bench`` runs the comparison with other tools and writes docs/benchmarks.md's tables."""
