"""An OpenGL context without a screen.

MuJoCo's own renderer uses the backend that was chosen when ``mujoco`` was first imported, which needs a screen unless
``MUJOCO_GL`` selects another.  Here the choice is made when a picture is requested.

Two measures protect the process.  MuJoCo's resources (``mujoco.MjrContext``) are only created while a context is
current: without one MuJoCo raises an exception the first time and aborts the process the second time.  A backend that
failed is not tried again, since the libraries behind it keep their state from when they were loaded.
"""

from __future__ import annotations

import ctypes
import importlib
import os
import platform
import warnings
from typing import TYPE_CHECKING, Any

from stc.validate.pictures import PictureError

if TYPE_CHECKING:
    import mujoco

#: The libraries that a backend loads; of those in one tuple, one is enough.
_LIBRARIES = {
    "egl": (("libEGL.so.1",), ("libOpenGL.so.0", "libGL.so.1")),
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6"),),
}

_HINT = "Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri libopengl0, then start Python again; no screen is needed"

#: What has been found out in this process: for backends that were tried in vain, the message that says so.
_in_vain: dict[tuple[str, ...], str] = {}


def make_context(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """A current OpenGL context to render into, and MuJoCo's resources for a model in it.

    ``MUJOCO_GL`` decides where it is set; else, on Linux, the backends without a screen come first.

    Args:
        model: what is to be rendered.
        width: of the largest image, in pixels.
        height: of the largest image.

    Raises:
        PictureError: there is no OpenGL, and the message says what to install: the same one each time in a process.
            Or OpenGL has no room for this model or these images.
    """
    import mujoco

    backends = _backends()
    if backends not in _in_vain:
        problems = []
        for backend in backends:
            try:
                context = _current_context(backend, width, height)
            except Exception as error:  # each backend fails in its own way: displays, drivers, devices
                problems.append(f"{backend}: {' '.join(str(error).split()) or type(error).__name__}")
                continue
            try:
                return context, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
            except Exception as error:
                context.free()
                why = " ".join(str(error).split())
                raise PictureError(
                    f"OpenGL ({backend}) cannot render this model at {width}x{height}: {why}"
                ) from error
        _in_vain[backends] = (
            f"rendering needs OpenGL, which is not available ({'; '.join(problems)})\n  {_HINT}"
        )
    raise PictureError(_in_vain[backends])


def _current_context(backend: str, width: int, height: int) -> Any:
    """A context of this backend, which is the current one.

    Raises:
        Exception: of any kind, if there is none.
    """
    missing = [names for names in _LIBRARIES.get(backend, ()) if not any(map(_loads, names))]
    if missing:
        # Found out before MuJoCo's module of the backend is imported: it settles on the backend for good.
        raise PictureError(" and ".join(names[0] for names in missing) + " cannot be loaded")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        context = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
        context.make_current()
        if not _is_current(backend):
            raise PictureError(
                "no window can be opened" if backend == "glfw" else "no context becomes current"
            )
    return context


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _is_current(backend: str) -> bool:
    """Whether the thread has a current context, according to the backend."""
    if backend == "glfw":
        return bool(importlib.import_module("glfw").get_current_context())
    if backend in _LIBRARIES:
        return bool(importlib.import_module("OpenGL.platform").GetCurrentContext())
    return True  # the others raise an exception where they fail


def _backends() -> tuple[str, ...]:
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in ("disable", "disabled", "off", "false", "0"):
        raise PictureError("rendering is switched off: MUJOCO_GL says so")
    if asked in ("egl", "osmesa", "glfw", "cgl"):
        return (asked,)
    if platform.system() == "Linux":
        return ("egl", "osmesa", "glfw")
    return ("cgl", "glfw") if platform.system() == "Darwin" else ("glfw",)
