"""Access control of the viewer's web page, and limits on the resources of its clients.

The page has no password.  What keeps strangers out is the address that it listens on and, since a browser on this
machine runs pages of other sites as well, two headers that such pages cannot forge: ``Host`` is the name under which a
browser requested the page, ``Origin`` the page that sent the request.  Both are checked in every request, including a
websocket's handshake (RFC 6454).  A name that is not this machine's means that another site has its name resolved to
this machine ("DNS rebinding"); an origin that is not the page's own means another site's script.

Studio's server (MuJoCo 4.0) checks neither, allows any site to read its answers, and waits for slow or silent visitors
without a limit.  It calls :func:`websockets.asyncio.server.serve`; :class:`Guard` replaces it.
"""

from __future__ import annotations

import asyncio
import ipaddress
import re
import socket
import threading
from collections.abc import Awaitable, Callable
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from stc.viewer.addresses import is_loopback

#: Connections at most: those that have not said what they want, those whose answer is on its way, open websockets.
#: The oldest of the first two kinds gives way to a new one; a new websocket beyond the limit is turned away.
MOST_SILENT, MOST_ANSWERED, MOST_SOCKETS = 64, 16, 48

#: Seconds to say what is wanted, to take a message or to close a websocket, and to take a file.
_TO_ASK, _TO_TAKE, _TO_LOAD = 10.0, 10.0, 600.0

#: A message of the page's is at most this long, in bytes, and so many frames of it wait to be read.
_LONGEST, _WAITING_FRAMES = 2**18, 4

_AUTHORITY = re.compile(
    r"(?:\[(?P<six>[0-9a-f:.]+)\]|(?P<name>[a-z0-9_.-]+))(?::(?P<port>\d{1,5}))?", re.IGNORECASE
)

_DEFAULT_PORT = {"http": 80, "https": 443}

_VIEWPORT = b'<meta name="viewport" content="width=device-width, initial-scale=1" />'

_Inner = Callable[[ServerConnection, Request], "Response | None"]
_Outer = Callable[[ServerConnection, Request, Response], "Response | None"]


def _split(authority: str) -> tuple[str, int | None] | None:
    """Host in lower case, without brackets, and port of ``host[:port]``; None if it is none."""
    found = _AUTHORITY.fullmatch(authority)
    if found is None:
        return None
    port = None if found["port"] is None else int(found["port"])
    if port is not None and not 0 < port < 65536:
        return None
    if found["six"] is None:
        return found["name"].lower(), port
    try:
        return str(ipaddress.IPv6Address(found["six"])), port
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class Visitors:
    """The connections of a server, bounded in number.

    Attributes:
        silent: connections without a request so far, oldest first.
        answered: connections whose answer is being sent, oldest first.
        sockets: open websockets.
    """

    def __init__(self) -> None:
        self.silent: dict[ServerConnection, None] = {}
        self.answered: dict[ServerConnection, None] = {}
        self.sockets: dict[ServerConnection, None] = {}

    def enter(self, connection: ServerConnection) -> None:
        """Register a new connection."""
        self._add(self.silent, connection, MOST_SILENT)

    def answer(self, connection: ServerConnection) -> None:
        """Register that a connection has sent a request and is being answered."""
        self.silent.pop(connection, None)
        self._add(self.answered, connection, MOST_ANSWERED)

    def open(self, connection: ServerConnection) -> bool:
        """Register that a connection becomes a websocket; False if there are too many."""
        if len(self.sockets) >= MOST_SOCKETS:
            return False
        self.silent.pop(connection, None)
        self.sockets[connection] = None
        return True

    def leave(self, connection: ServerConnection) -> None:
        """Remove a connection."""
        for kind in (self.silent, self.answered, self.sockets):
            kind.pop(connection, None)

    @staticmethod
    def _add(kind: dict[ServerConnection, None], connection: ServerConnection, most: int) -> None:
        kind[connection] = None
        while len(kind) > most:
            oldest = next(iter(kind))
            del kind[oldest]
            oldest.transport.abort()


class _Connection(ServerConnection):
    """A connection that is closed if the client keeps the server waiting."""

    visitors: Visitors

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.visitors.enter(self)
        self._patience = self.loop.call_later(_TO_ASK, self._give_up)

    def connection_lost(self, exc: Exception | None) -> None:
        self._patience.cancel()
        self.visitors.leave(self)
        super().connection_lost(exc)

    def _give_up(self) -> None:
        if self.request is None:
            self.transport.abort()

    async def send(self, message: Any, *, text: bool | None = None) -> None:
        # Studio tells its visitors the news one after the other: one that takes nothing would keep all waiting.
        try:
            async with asyncio.timeout(_TO_TAKE):
                await super().send(message, text=text)
        except TimeoutError:
            self.transport.abort()
            raise ConnectionResetError("the visitor takes no messages") from None


class Guard:
    """A wrapper around Studio's server that checks requests.

    Attributes:
        serving: set once a server has been made that is guarded.
    """

    def __init__(self, host: str) -> None:
        """Prepare.

        Args:
            host: the address that the page is served on.
        """
        self._host = host.lower().strip("[]")
        self._own_names = {"localhost", self._host}
        if not is_loopback(host):
            self._own_names |= {socket.gethostname().lower(), socket.getfqdn().lower()}
        self.serving = threading.Event()

    def answers_to(self, name: str) -> bool:
        """Whether a host's name or address, in lower case, without brackets and port, is one for this page.

        On the loopback interface these are its addresses and ``localhost``.  Elsewhere they are any address, since
        only names can be resolved to another machine than they were before, and this machine's own names.
        """
        return name in self._own_names or (
            is_loopback(name) if is_loopback(self._host) else _is_address(name)
        )

    def refusal(self, headers: Headers) -> str | None:
        """Why a request with these headers is refused, as a sentence; None if it is answered."""
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        host = _split(hosts[0]) if len(hosts) == 1 else None
        if host is None or not self.answers_to(host[0]):
            return (
                "This page answers only to the names and addresses of the machine that it is served on, and the Host "
                "of the request is none of these. A proxy has to pass on a Host of this machine's."
            )
        if origins:
            scheme, _, authority = origins[0].partition("://")
            default = _DEFAULT_PORT.get(scheme)
            origin = _split(authority)
            own = (
                len(origins) == 1
                and default is not None
                and origin is not None
                and origin[0] == host[0]
                and (origin[1] or default) == (host[1] or default)
            )
            if not own:
                return "This page answers only its own scripts, and the Origin of the request is not its own."
        return None

    def serve(self, handler: Callable[[ServerConnection], Awaitable[None]], **options: Any) -> Server:
        """As :func:`websockets.asyncio.server.serve`, guarded.

        Args:
            handler: of open websockets.
            options: as that function has them; limits of time and size are set here.
        """
        self.serving.set()
        visitors = Visitors()

        class Connection(_Connection):
            pass

        Connection.visitors = visitors
        inner: _Inner = options.pop("process_request")
        outer: _Outer = options.pop("process_response")

        def process_request(connection: ServerConnection, request: Request) -> Response | None:
            answer = self._answer(connection, request, inner)
            if answer is None and not visitors.open(connection):
                answer = connection.respond(503, "There are too many visitors.\n")
            if answer is not None:
                connection.close_timeout = _TO_LOAD
                visitors.answer(connection)
            return answer

        def process_response(
            connection: ServerConnection, request: Request, response: Response
        ) -> Response | None:
            changed = outer(connection, request, response)
            _close_to_others((changed or response).headers)
            return changed

        limits = {"max_size": _LONGEST, "max_queue": _WAITING_FRAMES, "close_timeout": _TO_TAKE}
        return serve(
            handler,
            process_request=process_request,
            process_response=process_response,
            create_connection=Connection,
            **{**options, **limits},
        )

    def _answer(self, connection: ServerConnection, request: Request, inner: _Inner) -> Response | None:
        """The answer to a request; None if it is to become a websocket."""
        refused = self.refusal(request.headers)
        if refused is not None:
            return connection.respond(403, refused + "\n")
        path = request.path.partition("?")[0]
        if path == "/drop":  # the motion's own model stays: nothing need be held for one that is dropped
            return connection.respond(403, "This viewer takes no models.\n")
        if not (
            request.path.isascii() and request.path.isprintable()
        ):  # Studio writes parts of it to the terminal
            return connection.respond(400, "The path has characters that a path cannot have.\n")
        answer = inner(connection, request)
        if answer is not None and path in ("/", "/index.html"):
            answer.body = answer.body.replace(b"<head>", b"<head>\n    " + _VIEWPORT, 1)
            del answer.headers["Content-Length"]
            answer.headers["Content-Length"] = str(len(answer.body))
        return answer


def _close_to_others(headers: Headers) -> None:
    """Add headers that keep pages of other sites from reading an answer or embedding the page."""
    for name in ("Access-Control-Allow-Origin", "Cross-Origin-Resource-Policy"):
        if name in headers:
            del headers[name]
    headers["Cross-Origin-Resource-Policy"] = "same-origin"
    headers["Content-Security-Policy"] = "frame-ancestors 'none'"
