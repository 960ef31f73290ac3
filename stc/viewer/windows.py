"""Opens a window onto a player: Studio on the desktop, Studio in a browser, or MuJoCo's passive viewer.

This module also has the workarounds for MuJoCo 4.0's Studio.  In a browser it would listen on every interface: it is
bound to the loopback interface unless another address is given, and answers only its own page.  On the
desktop it draws off screen and hands the picture over, since drawing straight into the window is broken in 4.0.0
(``NativeViewer.sync`` names a render target that does not exist); and its renderer asks for a class that the standard
library has from Python 3.12 on.
"""

from __future__ import annotations

import abc
import collections.abc
import contextlib
import ctypes.util
import os
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.viewer.addresses import LOOPBACK, DisplayError, require_address
from stc.viewer.panel import Panel
from stc.viewer.player import Player

if TYPE_CHECKING:
    from mujoco.studio.viewer_handle import ViewerHandle

#: Draws off screen, then into the window; see above.
_DESKTOP = "opengl_headless"

_SIZE = (1280, 860)

#: Longest time, in seconds, for which one thread keeps the interpreter while another one waits for it.
_SWITCH = 2e-4


def studio_is_there() -> bool:
    """Whether the installed MuJoCo includes Studio, its viewer."""
    try:
        from mujoco.studio import launch_thread  # noqa: F401
    except ImportError:
        return False
    return True


def desktop_is_there() -> bool:
    """Whether Studio's own window can be imported."""
    try:
        with _buffer_class():
            from mujoco.studio import native_viewer  # noqa: F401
    except ImportError:
        return False
    return True


def restore_flags(flags: NDArray[np.uint8], keys: str) -> None:
    """Undo what MuJoCo's passive viewer does at keys that have another meaning here.

    Every letter switches an element of its pictures on or off there, and is passed on.

    Args:
        flags: of the viewer, ``opt.flags``; changed in place.
        keys: letters that have another meaning.
    """
    import mujoco

    for index, (_, initial, key) in enumerate(mujoco.mjVISSTRING):
        if key and key in keys:
            flags[index] = int(initial)


def require_display() -> None:
    """Check that a window can be opened; Studio would end the whole process otherwise.

    Raises:
        DisplayError: there is no display; the message names the alternative.
    """
    if not sys.platform.startswith("linux"):
        return
    hint = "`stc view --web` shows the motion in a browser instead"
    name = os.environ.get("DISPLAY", "")
    if not name:
        wayland = (
            " (there is Wayland, but MuJoCo's windows want X)" if "WAYLAND_DISPLAY" in os.environ else ""
        )
        raise DisplayError(f"there is no display to open a window on{wayland}; {hint}")
    library = ctypes.util.find_library("X11")
    if library is None:
        raise DisplayError(f"there is no X11 library to open a window with; {hint}")
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = x11.XOpenDisplay(None)
    if not display:
        raise DisplayError(f"the display {name} cannot be opened; {hint}")
    x11.XCloseDisplay(display)


def open_desktop(player: Player, panel: Panel, title: str) -> None:
    """Show a player in Studio's own window until that is closed.

    Raises:
        DisplayError: there is no display.
    """
    require_display()
    from mujoco.studio import launch_native, viewer_protocol

    from stc.viewer.studio import plugins

    with _buffer_class():
        from mujoco.studio import native_viewer  # noqa: F401
    config = viewer_protocol.ViewerConfig(title=title, width=_SIZE[0], height=_SIZE[1], gfx=_DESKTOP)
    chosen, _ = plugins(player, panel, flat=True)
    with launch_native.launch(config, plugins=chosen) as handle:
        _show(handle, player)


def open_web(
    player: Player,
    panel: Panel,
    title: str,
    host: str = LOOPBACK,
    port: int = 0,
    ready: Callable[[str], None] | None = None,
) -> None:
    """Serve a player to browsers until it is interrupted.

    Args:
        player: what is shown.
        panel: the panel.
        title: of the page.
        host: address to listen on.
        port: 0 takes the first free one from 8080 on.
        ready: called with the page's address once it is served.

    Raises:
        UsageError: the address cannot be listened on.
    """
    require_address(host, port)
    from stc.viewer.studio import plugins
    from stc.viewer.web import launch

    chosen, _ = plugins(player, panel, flat=False)
    with launch(title, host, port, chosen, ready) as handle:
        _show(handle, player)


def _show(handle: ViewerHandle, player: Player) -> None:
    """Run until the window is closed; the first Ctrl-C during a watched solve stops that only."""
    # A solve on another thread comes back to Python thousands of times a second: each time it would wait for as long
    # as the window's threads may keep the interpreter, which is 5 ms unless said otherwise.
    sys.setswitchinterval(_SWITCH)
    handle.set_model(player.scene.model)
    while handle.is_running():
        try:
            handle.sync()
        except KeyboardInterrupt:
            live = player.live
            if live is not None and live.running and not live.stopping:
                live.stop()
                continue
            return


@contextlib.contextmanager
def _buffer_class() -> Iterator[None]:
    """While Studio's renderer is imported: the class ``collections.abc.Buffer``, where Python has none yet.

    It stands for whatever has a buffer (PEP 688); arrays of NumPy are all that the viewer hands over.
    """
    if hasattr(collections.abc, "Buffer"):
        yield
        return

    class Buffer(abc.ABC):  # noqa: B024 (as in PEP 688, but known by registration)
        pass

    for kind in (bytes, bytearray, memoryview, np.ndarray):
        Buffer.register(kind)
    collections.abc.Buffer = Buffer  # type: ignore[attr-defined]
    try:
        yield
    finally:
        del collections.abc.Buffer  # type: ignore[attr-defined]
