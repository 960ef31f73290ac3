"""The page's server: who is answered, that only the newest change is worked on, and what the page is told."""

import http.client
import json
import re
import struct
from contextlib import ExitStack
from urllib.parse import urlsplit

import numpy as np
import pytest
from steering.serving import served
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from stc.pipeline import read_source
from stc.steering.session import Session


@pytest.fixture(scope="module")
def page():
    told = []
    session = Session(read_source("particle_waypoints"), told=lambda: [tell() for tell in told])
    with served(session, told) as address:
        yield session, address
    session.close()


class Page:
    """What the page of a browser does, by hand."""

    def __init__(self, address):
        where = address.replace("http://", "ws://").replace("/?", "/steer?")
        self.open = ExitStack()
        self.socket = self.open.enter_context(connect(where, max_size=None))
        self.number = 0
        self.scene = self.next("scene")

    def tell(self, **message):
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, **message}))

    def next(self, kind, holds=lambda message: True):
        """The next message of a kind for which something holds."""
        while True:
            data = self.socket.recv(timeout=60.0)
            if isinstance(data, bytes):
                (length,) = struct.unpack_from("<I", data)
                message = json.loads(data[4 : 4 + length])
                numbers = np.frombuffer(data, "<f4", offset=4 + length)
                message["poses"] = numbers.reshape(message["instants"], -1, 7)
            else:
                message = json.loads(data)
            if message["type"] == kind and holds(message):
                return message

    def close(self):
        self.open.close()


@pytest.fixture
def browser(page):
    made = Page(page[1])
    yield made
    made.close()


def get(address, path, **headers):
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=30)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()
    finally:
        connection.close()


def test_only_who_knows_the_token_gets_the_page(page):
    place = urlsplit(page[1])
    status, headers, text = get(page[1], f"/?{place.query}")
    assert status == 200
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert not re.search(r"(src|href)=\"(?!data:)", text)  # asks for nothing else
    assert get(page[1], "/")[0] == 403
    assert "the one that `stc steer` printed" in get(page[1], "/?token=guessed")[2]
    assert get(page[1], "/model")[0] == 404
    assert get(page[1], f"/?{place.query}", Host="elsewhere.example")[0] == 403
    for where, headers in (
        ("/steer?token=guessed", {}),
        (f"/steer?{place.query}", {"Origin": "http://elsewhere.example"}),
    ):
        with (
            pytest.raises(InvalidStatus),
            connect(f"ws://{place.netloc}{where}", additional_headers=headers),
        ):
            pass


def test_the_motion_that_is_told_is_the_solution(page, browser):
    session = page[0]
    told = browser.next("motion")
    times = np.linspace(told["start"], told["end"], told["instants"])
    at = session.solution.at(times)
    body = session.shown().compiled.body("particle").id
    assert np.allclose(told["poses"][:, body, 0], at["x"], atol=1e-6)
    assert np.allclose(told["poses"][:, body, 2], at["y"], atol=1e-6)
    assert told["values"]["x1"] == 0.5
    assert [slider["name"] for slider in browser.scene["sliders"]][-1] == "n"  # structural ones come last


def test_a_drag_ends_where_it_was_dragged_last_and_can_be_undone(page, browser):
    session = page[0]
    handle = next(k for k, h in enumerate(browser.scene["handles"]) if set(h["names"]) == {"x1", "y1"})
    key = browser.scene["handles"][handle]["key"]
    here = browser.next("motion")["handles"][handle]
    for k in range(60):
        browser.tell(type="drag", handle=key, target=[here[0] + 0.002 * k, 0.0, here[2]])
    # What is far away is reached in several motions.
    last = browser.next("motion", lambda told: told["solved"] and told["values"]["x1"] > 0.6179)
    assert last["number"] == 60
    assert last["handles"][handle] == pytest.approx([0.618, 0.0, 0.8], abs=1e-4)
    assert session.generation < 60  # most were dropped for something newer
    browser.tell(type="release")
    browser.next("state", lambda told: told["undo"] and not told["busy"])
    browser.tell(type="changes")
    assert "+  x1 = 0.618" in browser.next("changes")["text"]
    browser.tell(type="undo")
    assert browser.next("motion")["values"]["x1"] == 0.5
    assert browser.next("state", lambda told: told["redo"])["message"] == ""


def test_nonsense_is_answered_with_a_message_or_not_at_all(page, browser):
    browser.next("motion")
    browser.socket.send("no message")
    browser.tell(type="drag", handle="nothing", target=[0, 0, 0])
    assert "no such handle" in browser.next("state", lambda told: told["message"])["message"]
    browser.tell(type="turn", name="h", value=1)
    assert "`h` is computed" in browser.next("state", lambda told: "computed" in told["message"])["message"]
    browser.tell(type="turn", name="x1", value="much")
    browser.next("state", lambda told: "much" in told["message"])
    browser.tell(type="release")
    assert browser.next("state", lambda told: not told["message"])


def test_it_is_judged_once_nobody_steers(page, browser):
    assert browser.next("state", lambda told: told["verdict"] not in ("", "judging"))["verdict"] == "passed"


def test_a_browser_that_goes_away_leaves_the_session(page):
    first = Page(page[1])
    first.next("motion")
    first.tell(type="turn", name="y2", value=0.6)
    first.next("motion", lambda told: told["values"]["y2"] == 0.6 and told["solved"])
    first.close()
    second = Page(page[1])
    assert second.next("motion")["values"]["y2"] == 0.6
    second.tell(type="undo")
    assert second.next("motion")["values"]["y2"] == 0.5
    second.close()
