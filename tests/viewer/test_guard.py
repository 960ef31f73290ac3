"""Strangers at the door of the viewer's page: other sites' scripts, rebound names, floods."""

import asyncio
import socket
import threading
from contextlib import ExitStack

import pytest
from viewer.visits import get, gone, send_often
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Response
from websockets.sync.client import connect

from stc.viewer import guard as doors
from stc.viewer.guard import Guard

#: Size of the file that the small server hands out.
BODY = 2**21

OWN = [
    ("127.0.0.1:8080", None),
    ("127.0.0.1", None),
    ("127.8.8.8:1", None),
    ("LocalHost:9000", None),
    ("[::1]:8080", None),
    ("[0:0:0:0:0:0:0:1]:8080", None),
    ("127.0.0.1:8080", "http://127.0.0.1:8080"),
    ("localhost:9000", "http://LOCALHOST:9000"),
    ("[::1]:8080", "http://[::1]:8080"),
    ("localhost", "http://localhost"),
    ("localhost", "http://localhost:80"),
    ("localhost", "https://localhost"),
    ("localhost:443", "https://localhost"),
]

STRANGE_HOSTS = [
    "",
    "example.org",
    "example.org:8080",
    "127.0.0.1.nip.io:8080",
    "localhost.example.org",
    "example.org#localhost",
    "localhost@example.org",
    "example.org/localhost",
    "localhost:8080,example.org",
    "localhost:",
    "localhost:0",
    "localhost:99999",
    "localhost:eighty",
    "0.0.0.0:8080",
    "192.168.1.2:8080",
    "::1",
    "[::1",
    "[::2]:8080",
    "[localhost]:8080",
    "[fe80::1%25eth0]:8080",
    "[::1].example.org",
    " localhost",
]

STRANGE_ORIGINS = [
    "",
    "null",
    "file://",
    "http://example.org",
    "http://example.org:8080",
    "https://127.0.0.1:8080.example.org",
    "http://127.0.0.1:8080@example.org",
    "http://127.0.0.1:3000",
    "http://127.0.0.1",
    "http://localhost:8080",
    "http://[::1]:8080",
    "https://127.0.0.1",
    "ftp://127.0.0.1:8080",
    "chrome-extension://127.0.0.1:8080",
    "127.0.0.1:8080",
    "http://127.0.0.1:8080/",
]


def headers(host=None, origin=None):
    return Headers(
        [(name, value) for name, value in (("Host", host), ("Origin", origin)) if value is not None]
    )


@pytest.mark.parametrize(("host", "origin"), OWN)
def test_the_page_and_its_scripts_are_answered(host, origin):
    assert Guard("127.0.0.1").refusal(headers(host, origin)) is None


@pytest.mark.parametrize("host", STRANGE_HOSTS)
def test_names_that_are_not_this_machines_are_refused(host):
    assert "Host" in Guard("127.0.0.1").refusal(headers(host))
    assert "Host" in Guard("127.0.0.1").refusal(headers(host, f"http://{host}"))


@pytest.mark.parametrize("origin", STRANGE_ORIGINS)
def test_other_sites_scripts_are_refused(origin):
    assert "Origin" in Guard("127.0.0.1").refusal(headers("127.0.0.1:8080", origin))


def test_a_header_that_is_missing_or_stands_twice():
    guard = Guard("localhost")
    assert guard.refusal(headers(None)) and guard.refusal(headers(None, "http://localhost"))
    assert guard.refusal(Headers([("Host", "localhost"), ("Host", "localhost")]))
    assert guard.refusal(
        Headers([("Host", "localhost"), ("Origin", "http://localhost"), ("Origin", "http://localhost")])
    )


@pytest.mark.parametrize("bound", ["0.0.0.0", "::", "192.168.1.2"])
def test_elsewhere_addresses_and_own_names_are_answered(bound):
    guard = Guard(bound)
    for host in ("192.168.1.2:8080", "[2001:db8::1]:8080", "localhost:8080", socket.gethostname()):
        assert guard.refusal(headers(host, f"http://{host}")) is None
    for host in ("example.org:8080", "192.168.1.2.nip.io"):
        assert guard.refusal(headers(host, f"http://{host}"))
    assert guard.refusal(headers("192.168.1.2:8080", "http://example.org"))


class Small:
    """A server as Studio makes one: a file of two megabytes, and websockets that send what they get."""

    def __enter__(self):
        started = threading.Event()
        self.sock = socket.create_server(("127.0.0.1", 0))
        self.port = self.sock.getsockname()[1]

        def process_request(connection, request):
            if "Upgrade" in request.headers:
                return None
            open_to_all = Headers({"Access-Control-Allow-Origin": "*", "Content-Length": str(BODY)})
            return Response(200, "OK", open_to_all, b"<head>" + bytes(BODY - 6))

        def process_response(connection, request, response):
            if response.status_code == 101:
                response.headers["Access-Control-Allow-Origin"] = "*"
                response.headers["Cross-Origin-Resource-Policy"] = "cross-origin"

        async def echo(connection):
            try:
                async for message in connection:
                    await connection.send(message)
            except (ConnectionClosed, ConnectionError):
                pass

        async def run():
            self.loop, self.end = asyncio.get_running_loop(), asyncio.Event()
            server = await Guard("127.0.0.1").serve(
                echo,
                sock=self.sock,
                process_request=process_request,
                process_response=process_response,
                compression=None,
                ping_interval=None,
                max_size=2**26,
            )
            started.set()
            await self.end.wait()
            server.close()
            await server.wait_closed()

        self.thread = threading.Thread(target=lambda: asyncio.run(run()))
        self.thread.start()
        assert started.wait(20)
        return self

    def __exit__(self, *_):
        self.loop.call_soon_threadsafe(self.end.set)
        self.thread.join(60)
        assert not self.thread.is_alive()

    def get(self, path="/", **more):
        return get(self.port, path, **more)

    def raw(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)


@pytest.fixture
def small():
    with Small() as server:
        yield server


def test_answers_say_that_they_are_for_this_page_alone(small):
    for path in ("/model", "/"):
        status, found, body = small.get(path)
        assert status == 200 and "Access-Control-Allow-Origin" not in found
        assert found["Cross-Origin-Resource-Policy"] == "same-origin"
        assert found["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert (b"width=device-width" in body) == (path == "/")
    with connect(f"ws://127.0.0.1:{small.port}/state") as peer:
        assert "Access-Control-Allow-Origin" not in peer.response.headers
        assert peer.response.headers.get_all("Cross-Origin-Resource-Policy") == ["same-origin"]
        peer.send("word")
        assert peer.recv(timeout=20) == "word"


def test_strangers_get_nothing_whatever_they_ask_for(small):
    for more in ({"Host": "example.org"}, {"Origin": "null"}, {"Origin": "http://example.org"}):
        status, found, body = small.get("/model", **more)
        assert status == 403 and len(body) < 400 and "Access-Control-Allow-Origin" not in found
    for origin in ("null", "http://example.org"):
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://127.0.0.1:{small.port}/state", origin=origin)
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://example.org:{small.port}/state", sock=small.raw())
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://127.0.0.1:{small.port}/drop")
    for lines in (b"", b"Host: localhost\r\nHost: example.org\r\n"):
        with small.raw() as peer:
            peer.sendall(b"GET /model HTTP/1.1\r\n" + lines + b"\r\n")
            assert peer.recv(100).startswith(b"HTTP/1.1 403 ")
    with small.raw() as peer:
        peer.sendall(b"GET /state?sid=\x1b[2J HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert not peer.recv(100).startswith(b"HTTP/1.1 200 ")


def test_a_flood_of_silent_connections_gives_way_to_the_page(small):
    with ExitStack() as stack:
        first = stack.enter_context(small.raw())
        for _ in range(3 * doors.MOST_SILENT):
            stack.enter_context(small.raw())
        assert small.get()[0] == 200
        assert gone(first)


def test_silence_is_waited_for_no_longer_than_said(small, monkeypatch):
    monkeypatch.setattr(doors, "_TO_ASK", 0.2)
    with small.raw() as peer:
        peer.sendall(b"GET / HTTP/1.1\r\nHost: local")
        assert gone(peer)


def test_visitors_who_do_not_read_hold_few_answers(small):
    with ExitStack() as stack:
        for _ in range(2 * doors.MOST_ANSWERED):
            peer = stack.enter_context(small.raw())
            peer.sendall(b"GET /model HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert small.get()[0] == 200


def test_websockets_are_bounded_in_number_and_in_what_they_send(small):
    with ExitStack() as stack:
        open_ = [
            stack.enter_context(connect(f"ws://127.0.0.1:{small.port}/state", max_size=None))
            for _ in range(doors.MOST_SOCKETS)
        ]
        with pytest.raises(InvalidStatus, match="503"):
            connect(f"ws://127.0.0.1:{small.port}/state")
        assert small.get()[0] == 200
        open_[0].send(bytes(2**20))
        with pytest.raises(ConnectionClosed, match="1009"):
            open_[0].recv(timeout=20)
        open_[1].send("still here")
        assert open_[1].recv(timeout=20) == "still here"
        with connect(f"ws://127.0.0.1:{small.port}/state") as another:
            another.send("room again")
            assert another.recv(timeout=20) == "room again"


def test_a_visitor_who_takes_nothing_is_given_up(small, monkeypatch):
    monkeypatch.setattr(doors, "_TO_TAKE", 0.5)
    with small.raw() as peer:
        peer.sendall(
            b"GET /state HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        assert peer.recv(2**12).startswith(b"HTTP/1.1 101 ")
        # A masked frame of 100 kB, with the mask 0, again and again: its echoes are never read.
        frame = b"\x82\xff" + (100_000).to_bytes(8, "big") + bytes(4) + bytes(100_000)
        peer.settimeout(5.0)
        with pytest.raises(ConnectionError):  # the server hangs up, rather than reading on or waiting
            send_often(peer, frame, 2000)
    assert small.get()[0] == 200
