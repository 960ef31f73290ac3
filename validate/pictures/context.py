"""An OpenGL context without a screen.

MuJoCo's own renderer takes whatever backend was chosen when ``mujoco`` was first imported, which is one that wants
a screen unless ``MUJOCO_GL`` says otherwise.  Here the choice is made when a picture is asked for.
"""

from __future__ import annotations

import importlib
import os
import platform
import warnings
from typing import TYPE_CHECKING, Any

from stc.validate.pictures import PictureError

if TYPE_CHECKING:
    import mujoco

_HINT = (
    "without a screen it takes Mesa's EGL (Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri) or, with "
    "MUJOCO_GL=osmesa, its software renderer (libosmesa6)"
)


def make_context(model: mujoco.MjModel, width: int, height: int) -> tuple[Any, mujoco.MjrContext]:
    """A current OpenGL context to render into, and MuJoCo's resources for a model in it.

    ``MUJOCO_GL`` decides where it is set; else, on Linux, the backends without a screen come first.

    Raises:
        PictureError: there is none; the message says what to install.
    """
    import mujoco

    problems = []
    for backend in _backends():
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                context = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
                context.make_current()
                return context, mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        except Exception as error:  # each backend fails in its own way: missing libraries, displays, drivers
            problems.append(f"{backend}: {' '.join(str(error).split()) or type(error).__name__}")
    raise PictureError(f"no OpenGL to render with ({'; '.join(problems)})\n  {_HINT}")


def _backends() -> list[str]:
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in ("disable", "disabled", "off", "false", "0"):
        raise PictureError("rendering is switched off: MUJOCO_GL says so")
    if asked in ("egl", "osmesa", "glfw", "cgl"):
        return [asked]
    if platform.system() == "Linux":
        return ["egl", "osmesa", "glfw"]
    return ["cgl", "glfw"] if platform.system() == "Darwin" else ["glfw"]
