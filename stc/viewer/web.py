"""Studio in a browser, on a given address."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

from mujoco.studio import endpoints, launch_thread, plugin, viewer_handle, viewer_protocol, web_viewer
from mujoco.studio.web import web_server

from stc.viewer.addresses import DisplayError, is_loopback
from stc.viewer.guard import Guard

#: Seconds after which a page is announced although nothing listens yet.
MOST_WAITED = 10.0


def launch(
    title: str, host: str, port: int, plugins: list[plugin.Plugin], ready: Callable[[str], None] | None = None
) -> viewer_handle.ViewerHandle:
    """As :func:`mujoco.studio.launch_web.launch`, which listens on every interface and answers everybody.

    Args:
        title: of the page.
        host: address to listen on.
        port: 0 takes the first free one from 8080 on.
        plugins: of both sides.
        ready: called with the page's address once it is served.
    """
    config = viewer_protocol.ViewerConfig(title=title, gfx="web", http_port=port)
    of_window, of_simulation = plugin.split_plugins(plugins)

    def serve(endpoint: endpoints.ViewerEndpoint) -> None:
        guard = Guard(host)
        with _behind(guard):
            viewer = _viewer_on(host)(config, endpoint, plugins=of_window)
            viewer.await_listening()
            if not guard.serving.is_set():  # a later Studio may make its server otherwise
                viewer.close()
                raise DisplayError("MuJoCo's web viewer would answer strangers: it is not shown")
            if ready is not None:
                ready(viewer.address)
            viewer_protocol.run_viewer_loop(viewer)

    return launch_thread.launch_thread(serve, sim_plugins=of_simulation)


def _viewer_on(host: str) -> type[Any]:
    """Studio's web viewer with another address than its default."""

    class WebViewer(web_viewer.WebViewer):
        _host = property(lambda self: host, lambda self, value: None)

        def _start_server(self) -> None:
            # A later Studio may choose its address elsewhere: rather no page than one that anybody can open.
            bound = self._http_sock.getsockname()[0]
            if is_loopback(host) and not is_loopback(bound):
                raise DisplayError(
                    f"MuJoCo's web viewer is bound to {bound} and not to {host}: it is not shown"
                )
            super()._start_server()

        def await_listening(self) -> None:
            """Wait for Studio's server, in a thread of its own, to listen at the socket, which is only bound here."""
            end = time.monotonic() + MOST_WAITED
            while not self._http_sock.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                if time.monotonic() > end:
                    return
                time.sleep(0.01)

        @property
        def address(self) -> str:
            name = f"[{host}]" if ":" in host else host
            return f"http://{name}:{self._http_port}/"

    return WebViewer


@contextlib.contextmanager
def _behind(guard: Guard) -> Iterator[None]:
    """Let Studio create its server through a guard; it has no option for that."""
    plain = web_server.serve
    web_server.serve = guard.serve
    try:
        yield
    finally:
        web_server.serve = plain
