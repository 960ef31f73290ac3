"""Serves a session to browsers on this machine: a page, and a websocket for changes one way and motions the other.

Only the newest place of what is dragged is worked on: a message that comes while another one waits takes its place.
Whoever knows the address may steer; it holds a token that is made for each run, and requests are guarded as those of
``stc view --web`` are (:mod:`stc.viewer.guard`).
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from stc.errors import StcError
from stc.steering.drawn import motion_of, scene_of
from stc.steering.judge import Judge
from stc.steering.session import GRACE, Session
from stc.viewer.addresses import LOOPBACK, require_address
from stc.viewer.guard import Guard

#: The first of the ports that are tried where none is asked for, and how many.
FIRST_PORT, PORTS = 8090, 20

#: Longest time, in seconds, for which one thread keeps the interpreter while another one waits for it.
_SWITCH = 2e-4

#: Seconds after the last change until the motion is judged.
_IDLE = 0.8

#: Changes of which the page is told which motion is theirs.
_REMEMBERED = 256


class Server:
    """Serves one session to any number of browsers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._token = secrets.token_urlsafe(16)
        self._clients: set[ServerConnection] = set()
        self._news = asyncio.Event()  # for who shows
        self._ready = asyncio.Event()  # for who asks
        self._steered = asyncio.Event()
        self._end = asyncio.Event()
        self._newest: dict[str, Any] | None = None
        self._asked: dict[Any, int] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._judge = Judge()
        self._note = ""

    def told(self) -> None:
        """Take note, from any thread, that a change has been worked on."""
        self._call(self._wake)

    def stop(self) -> None:
        """End :meth:`run`, from any thread."""
        self._call(self._end.set)

    def _call(self, what: Callable[[], None]) -> None:
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(what)

    def _wake(self) -> None:
        self._news.set()
        self._ready.set()

    async def run(self, port: int | None, ready: Callable[[str], None]) -> None:
        """Serve until cancelled, or stopped by :meth:`stop`.

        Args:
            port: to listen on; None takes the first free one from :data:`FIRST_PORT` on.
            ready: told the address of the page.

        Raises:
            UsageError: the port cannot be listened on.
        """
        if port is not None:
            require_address(LOOPBACK, port)
        self._loop = asyncio.get_running_loop()
        sys.setswitchinterval(_SWITCH)
        guarded = Guard(LOOPBACK)
        with _listening(port) as bound:
            server = guarded.serve(
                self._connected,
                sock=bound,
                process_request=self._answer,
                process_response=lambda connection, request, response: None,
                compression=None,
            )
            async with server:
                ready(f"http://{LOOPBACK}:{bound.getsockname()[1]}/?token={self._token}")
                work = [
                    asyncio.ensure_future(part) for part in (self._publish(), self._steer(), self._end.wait())
                ]
                try:
                    done, _ = await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
                finally:
                    self._judge.stop()
                    for task in work:
                        task.cancel()
                for task in done:
                    task.result()  # raises what went wrong in it

    # ------------------------------------------------------------------- requests

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """The page; None for what is to become a websocket."""
        address = urlsplit(request.path)
        given = parse_qs(address.query).get("token", [""])[0]
        if address.path not in ("/", "/steer"):
            return connection.respond(404, "There is nothing here.\n")
        if not secrets.compare_digest(given.encode(), self._token.encode()):
            return connection.respond(
                403, "This address lacks the token of the run: open the one that `stc steer` printed.\n"
            )
        if address.path == "/steer":
            return None
        body = page().encode()
        headers = Headers(
            {
                "Content-Type": "text/html; charset=utf-8",
                "Content-Length": str(len(body)),
                "Cache-Control": "no-store",
                "Referrer-Policy": "no-referrer",
            }
        )
        return Response(200, "OK", headers, body)

    async def _connected(self, client: ServerConnection) -> None:
        """One browser, from its first message to its last."""
        self._clients.add(client)
        try:
            await client.send(json.dumps(scene_of(self._session)))
            await client.send(self._motion())
            await client.send(json.dumps(self._state()))
            async for message in client:
                await self._heard(client, message)
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            self._session.release()

    async def _heard(self, client: ServerConnection, message: str | bytes) -> None:
        try:
            told = json.loads(message)
            kind = told["type"]
        except (ValueError, TypeError, KeyError):
            return
        if kind in ("drag", "turn"):
            self._newest = told
            self._steered.set()
            return
        await self._ordered(client, kind)

    async def _ordered(self, client: ServerConnection, kind: str) -> None:
        """Carry out a request that a newer one does not replace: undo, redo, release, showing changes, writing."""
        session = self._session
        self._note = ""
        if kind == "release":
            while (
                self._newest is not None and not self._end.is_set()
            ):  # what was asked for last belongs to the gesture
                await asyncio.sleep(0.005)
            session.release()
        elif kind in ("undo", "redo"):
            self._newest = None
            if session.undo() if kind == "undo" else session.redo():
                self._news.set()
        elif kind == "changes":
            await client.send(json.dumps({"type": "changes", "text": session.changes()}))
        elif kind == "write":
            try:
                path = await asyncio.to_thread(session.write)
                answer = {"type": "written", "text": f"written to {path}"}
            except (StcError, OSError) as error:
                answer = {"type": "refused", "text": str(error)}
            await client.send(json.dumps(answer))
        await self._tell(json.dumps(self._state()))

    # ------------------------------------------------------------------- work

    async def _steer(self) -> None:
        """Ask for the newest change, and for the next one once that has been handed over."""
        session = self._session
        while True:
            await self._steered.wait()
            self._steered.clear()
            # What is asked for during a solve is worked out once that has ended: something newer may be wanted by then.
            self._ready.clear()
            if session.busy:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._ready.wait(), GRACE)
            told, number = self._newest, 0
            if told is None:
                continue
            self._judge.stop()
            self._note = ""
            try:
                number = int(told.get("number", 0))
                if told["type"] == "drag":
                    await asyncio.to_thread(session.drag, str(told["handle"]), list(told["target"]))
                else:
                    session.turn({str(told["name"]): float(told["value"])})
            except (StcError, ValueError, TypeError, KeyError) as error:
                self._note = str(error)
            self._asked[_key(session.wanted)] = number
            if len(self._asked) > _REMEMBERED:
                del self._asked[next(iter(self._asked))]
            if self._newest is told:
                self._newest = None
            await self._tell(json.dumps(self._state()))

    async def _publish(self) -> None:
        """Tell all browsers of each new motion, and judge it once nothing has changed for a while."""
        shown = self._session.generation
        while True:
            try:
                await asyncio.wait_for(self._news.wait(), _IDLE)
            except TimeoutError:
                self._judge.look(self._session, self.told)
                continue
            self._news.clear()
            self._go_on()
            if self._session.generation != shown:
                shown = self._session.generation
                self._judge.stop()
                await self._tell(self._motion())
            await self._tell(json.dumps(self._state()))

    def _go_on(self) -> None:
        """Have what is dragged come nearer to its place, unless a newer one waits to be asked for."""
        if self._newest is None and not self._session.busy:
            number = self._asked.get(_key(self._session.solution.overrides), 0)
            self._session.follow()
            self._asked.setdefault(_key(self._session.wanted), number)

    def _motion(self) -> bytes:
        return motion_of(self._session, lambda motion: {"number": self._asked.get(_key(motion.overrides), 0)})

    def _state(self) -> dict[str, Any]:
        session = self._session
        return {
            "type": "state",
            "busy": session.busy,
            "message": self._note or session.message,
            "undo": session.can_undo,
            "redo": session.can_redo,
            "verdict": self._judge.verdict(session.solution),
        }

    async def _tell(self, message: str | bytes) -> None:
        for client in tuple(self._clients):
            try:
                await client.send(message)
            except (ConnectionClosed, ConnectionError):
                self._clients.discard(client)


def _key(values: Any) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(values.items()))


def _listening(port: int | None) -> socket.socket:
    """A socket that is bound to a port of the loopback interface."""
    last: OSError | None = None
    for number in [port] if port is not None else [*range(FIRST_PORT, FIRST_PORT + PORTS), 0]:
        made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind((LOOPBACK, number))
            return made
        except OSError as error:
            made.close()
            last = error
    assert last is not None
    raise last


def page() -> str:
    """The page, whole: it asks for nothing else."""
    folder = files("stc.steering") / "page"
    style, script = ((folder / name).read_text(encoding="utf-8") for name in ("steer.css", "steer.js"))
    text = (folder / "steer.html").read_text(encoding="utf-8")
    return text.replace("/* style */", style).replace("/* script */", script)
