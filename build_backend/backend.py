"""The build backend: setuptools, with a C compiler from PyPI where the machine has none that works."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403  (its hooks are this backend's, but for the two below)

#: Pinned, since it decides what the installed library is.
COMPILER = "ziglang==0.13.0"


def _compiling() -> Any:
    path = Path(__file__).parent.parent / "stc" / "core" / "compiling.py"
    spec = importlib.util.spec_from_file_location("compiling", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compiler() -> list[str]:
    compiling = _compiling()
    return [COMPILER] if compiling.wanted_platform() or not compiling.own_compiler() else []


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_compiler()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler()]
