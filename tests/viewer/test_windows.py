"""Windows as they are opened: in a browser, on a screen, and what is said where that cannot be."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import pytest
from viewer.browser import CHROMIUM, Browser
from viewer.motions import push
from viewer.visits import get

from stc.errors import UsageError
from stc.viewer.addresses import DisplayError, is_loopback, require_address
from stc.viewer.windows import require_display

XVFB = shutil.which("Xvfb") or ""


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "push.npz"
    push().save(path)
    return path


class Viewing:
    """``stc view`` in a process of its own, which a test ends as Ctrl-C does."""

    def __init__(self, folder, *arguments, **environment):
        self.log = folder / "log.txt"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "stc", "view", *map(str, arguments)],
                stdout=log,
                stderr=log,
                cwd=folder,
                env={**os.environ, "HOME": str(folder), **environment},
                # Whoever started the tests in the background may have made all of them deaf to it.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )

    def wait_for(self, text, seconds=60.0):
        end = time.monotonic() + seconds
        while text not in self.log.read_text():
            assert self.process.poll() is None and time.monotonic() < end, self.log.read_text()
            time.sleep(0.1)
        return next(line for line in self.log.read_text().splitlines() if text in line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                raise


def listeners(port):
    """The addresses, in hexadecimal, on which this machine listens at a port."""
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            address, state = line.split()[1], line.split()[3]
            host, _, number = address.partition(":")
            if state == "0A" and int(number, 16) == port:
                found.add(host)
    return found


def test_without_a_display_the_message_names_the_way_around(monkeypatch):
    if not sys.platform.startswith("linux"):
        pytest.skip("displays are looked for on Linux only")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DisplayError, match=r"there is no display .* `stc view --web`"):
        require_display()
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(DisplayError, match=r"X11 library|display :4711 cannot be opened"):
        require_display()


def test_addresses_of_this_machine_alone_are_known():
    assert (
        is_loopback("127.0.0.1")
        and is_loopback("localhost")
        and is_loopback("::1")
        and is_loopback("127.8.8.8")
    )
    assert not any(is_loopback(host) for host in ("0.0.0.0", "::", "192.168.1.2", "example.org", ""))


def test_an_address_that_is_none_is_refused():
    require_address("127.0.0.1", 0)
    with pytest.raises(UsageError, match=r"--host 203\.0\.113\.1"):
        require_address("203.0.113.1", 0)  # set aside for documentation: nobody has it


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads Linux' table of sockets")
def test_the_page_is_served_to_this_machine_alone_and_to_no_other_sites_page(saved, tmp_path):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    with Viewing(tmp_path, saved, "--web") as viewing:
        address = viewing.wait_for("showing on http://127.0.0.1:").split()[2]
        port = int(address.rstrip("/").rpartition(":")[2])
        assert listeners(port) == {"0100007F"}
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://127.0.0.1:{port}/state?sid=a", origin="http://example.org")
        with connect(f"ws://127.0.0.1:{port}/state?sid=b", origin=address.rstrip("/")) as socket:
            assert "Access-Control-Allow-Origin" not in socket.response.headers
            assert socket.recv(timeout=20)
        status, headers, body = get(port, "/model")
        assert status == 200 and len(body) > 1000 and "Access-Control-Allow-Origin" not in headers
        for stranger in (
            {"Host": f"example.org:{port}"},
            {"Origin": "null"},
            {"Origin": "http://example.org"},
        ):
            assert get(port, "/model", **stranger)[0] == 403
        assert b"width=device-width" in get(port)[2]
    assert viewing.process.returncode == 0
    assert "without any authentication" not in viewing.log.read_text()


def resident(process):
    """Memory of a process, in bytes."""
    return int(Path(f"/proc/{process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.nightly
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads Linux' table of memory")
def test_floods_leave_the_page_and_bound_the_memory(saved, tmp_path):
    """Websockets that take nothing, connections that say nothing, and files that nobody reads, hundreds of each."""
    import socket

    from websockets.sync.client import connect

    handshake = (
        "GET /state?sid={} HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    file = b"GET /web_client.wasm HTTP/1.1\r\nHost: localhost\r\n\r\n"
    large = b"\x82\xff" + (2**25).to_bytes(8, "big") + bytes(4) + bytes(2**16)
    with Viewing(tmp_path, saved, "--web") as viewing, ExitStack() as stack:
        port = int(viewing.wait_for("showing on ").split()[2].rstrip("/").rpartition(":")[2])
        assert get(port, "/web_client.wasm")[0] == 200
        page = stack.enter_context(connect(f"ws://127.0.0.1:{port}/state?sid=page"))
        before = resident(viewing.process)
        for k in range(300):
            for asked in (b"", file, handshake.format(k).encode() + large):
                peer = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=20))
                with suppress(ConnectionError):
                    peer.sendall(asked)
        assert get(port)[0] == 200
        end = time.monotonic() + 60
        while not isinstance(page.recv(timeout=20), bytes):  # the motion itself, not who else is there
            assert time.monotonic() < end
        assert resident(viewing.process) - before < 5e8
    assert viewing.process.returncode == 0


@pytest.mark.slow
def test_another_address_is_warned_of(saved, tmp_path):
    with Viewing(tmp_path, saved, "--web", "--host", "0.0.0.0") as viewing:
        viewing.wait_for("showing on http://0.0.0.0:")
    assert "served on 0.0.0.0, without any authentication" in viewing.log.read_text()


@pytest.mark.nightly
@pytest.mark.skipif(not CHROMIUM, reason="there is no Chromium (Debian, Ubuntu: apt install chromium)")
def test_the_motion_is_seen_in_a_browser(saved, tmp_path):
    from PIL import Image

    with Viewing(tmp_path, saved, "--web") as viewing, Browser(tmp_path / "profile") as browser:
        browser.call("Page.navigate", url=viewing.wait_for("showing on ").split()[2])
        browser.wait_for_log("First remote draw frame applied", 300)
        browser.wait_for_log("Model loaded and scene initialized successfully", 30)
        end = time.monotonic() + 60
        while True:
            browser.screenshot(tmp_path / "page.png")
            picture = np.array(Image.open(tmp_path / "page.png").convert("RGB")).astype(int)
            red, blue = picture[..., 0], picture[..., 2]
            panel = picture[60:400, 10:330]
            # The panel is plain but for its writing; the solved path is blue and the simulated one orange.
            plain = np.mean(np.all(abs(panel - np.median(panel, axis=(0, 1))) < 12, axis=2))
            lines = np.sum((blue > 150) & (blue > red + 60)), np.sum((red > 150) & (red > blue + 80))
            if plain > 0.5 and min(lines) > 20:
                break
            assert time.monotonic() < end, f"panel {plain}, lines {lines}: see {tmp_path / 'page.png'}"
            time.sleep(1.0)
        assert not [line for line in browser.log if "rror" in line and "geom" in line]
    assert viewing.process.returncode == 0


@pytest.fixture
def display(tmp_path):
    """A display that can be opened: a virtual one of our own."""
    if not XVFB:
        pytest.skip("there is no Xvfb to open a window on (Debian, Ubuntu: apt install xvfb)")
    # The server takes a number that is free, and tells it once it can be reached: tests beside this one have others.
    reading, writing = os.pipe()
    server = subprocess.Popen(
        [
            XVFB,
            "-displayfd",
            str(writing),
            "-screen",
            "0",
            "1280x900x24",
            "+extension",
            "GLX",
            "-nolisten",
            "tcp",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        pass_fds=[writing],
    )
    os.close(writing)
    with os.fdopen(reading) as told:
        number = told.readline().strip()
    assert number, "Xvfb did not start"
    yield f":{number}"
    server.terminate()
    server.wait(20)


@pytest.mark.slow
def test_the_motion_is_seen_in_a_window(saved, tmp_path, display):
    from PIL import ImageGrab

    with Viewing(tmp_path, saved, DISPLAY=display) as viewing:
        end = time.monotonic() + 60
        while True:
            ImageGrab.grab(xdisplay=display).save(tmp_path / "window.png")
            picture = np.array(ImageGrab.grab(xdisplay=display).convert("RGB")).astype(int)
            red, green, blue = (picture[..., k] for k in range(3))
            # The arrow of the force is violet, the simulated path orange; the ball is of a darker orange.
            arrow = np.sum((abs(red - 166) < 40) & (green < 130) & (blue > 200))
            path = np.sum((red > 220) & (abs(green - 155) < 25) & (blue < 90))
            lines = arrow, path
            if min(lines) > 20:
                break
            assert viewing.process.poll() is None and time.monotonic() < end, viewing.log.read_text()
            time.sleep(0.5)
    assert viewing.process.returncode == 0


@pytest.mark.nightly
def test_a_watched_solve_is_saved_when_it_is_stopped(tmp_path, display):
    from stc.solution import read

    with Viewing(tmp_path, "luxo_jump", "--live", "-o", "best.npz", DISPLAY=display) as viewing:
        viewing.wait_for("feature level")
        time.sleep(0.5)
        viewing.process.send_signal(signal.SIGINT)
        end = time.monotonic() + 60
        while not (tmp_path / "best.npz").exists():
            assert viewing.process.poll() is None and time.monotonic() < end, viewing.log.read_text()
            time.sleep(0.1)
        found = read(tmp_path / "best.npz")
    assert found.status in ("interrupted", "optimal")
    assert viewing.process.returncode == (0 if found.status == "optimal" else 1)
    assert found.status in viewing.log.read_text()
