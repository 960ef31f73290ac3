"""The version of stc: everything that writes files names it."""

__version__ = "0.1.0"
