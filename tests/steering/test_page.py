"""The page in Chromium: handles are dragged by a mouse and by a finger, wide and on a telephone."""

import json
import time

import numpy as np
import pytest
from steering.serving import served
from viewer.browser import CHROMIUM, Browser

from stc.pipeline import read_source
from stc.steering.session import Session

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM, reason="there is no Chromium (Debian, Ubuntu: apt install chromium)"),
]

HEAD = "[...document.querySelectorAll('.handle:not([hidden])')].find((b) => b.dataset.key.startsWith('pose:60:4'))"


class Shown:
    """A page that shows a session."""

    def __init__(self, browser, address, width, height):
        self.browser = browser
        mobile = width < 500
        browser.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=mobile,
        )
        browser.call("Emulation.setTouchEmulationEnabled", enabled=mobile)
        browser.call("Page.navigate", url=address)
        self.wait("window.steering && window.steering.motions > 0")

    def ask(self, script):
        answer = self.browser.call("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, script, seconds=120.0):
        end = time.monotonic() + seconds
        while not self.ask(script):
            assert time.monotonic() < end, f"never: {script}; {self.ask('document.body.innerText')}"
            time.sleep(0.1)

    def middle(self, script):
        """The middle of an element, in pixels."""
        found = f"(() => {{ const b = ({script}).getBoundingClientRect(); "
        return np.array(
            json.loads(
                self.ask(found + "return JSON.stringify([b.x + b.width / 2, b.y + b.height / 2]); })()")
            )
        )

    def drag(self, begin, end, finger=False):
        """Drag from one place to another in 20 steps."""
        names = (
            ("touchStart", "touchMove", "touchEnd")
            if finger
            else ("mousePressed", "mouseMoved", "mouseReleased")
        )
        for k, place in enumerate([begin, *np.linspace(begin, end, 20), end]):
            name = names[0] if k == 0 else names[1] if k < 21 else names[2]
            x, y = map(float, place)
            if finger:
                points = [] if k == 21 else [{"x": x, "y": y}]
                self.browser.call("Input.dispatchTouchEvent", type=name, touchPoints=points)
            else:
                self.browser.call(
                    "Input.dispatchMouseEvent",
                    type=name,
                    x=x,
                    y=y,
                    button="left",
                    buttons=int(k < 21),
                    clickCount=1,
                )
            time.sleep(0.02)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)])
def test_a_drag_is_followed_undone_and_written(tmp_path, width, height):
    file = tmp_path / "bow.stc"
    text = read_source("luxo_poses").text
    told = []
    session = Session(read_source("luxo_poses"), target=file, told=lambda: [tell() for tell in told])
    first = session.solution
    with served(session, told) as address, Browser(tmp_path / "profile") as browser:
        page = Shown(browser, address, width, height)
        page.wait(f"Boolean({HEAD})")
        page.ask("document.getElementById('play').click()")
        key = page.ask(f"({HEAD}).dataset.key")
        begin, point = page.middle(HEAD), session.points()[key]
        page.drag(begin, begin + [25.0, 30.0], finger=width < 500)
        page.wait("document.getElementById('solved').textContent === 'solved' && window.steering.motions > 1")
        assert session.wait()
        moved = session.points()[key] - point
        assert moved[0] > 0.01  # to the right is forward
        assert moved[2] < -0.01
        page.wait("window.steering.latencies.length > 0")
        time.sleep(0.5)
        assert np.linalg.norm(page.middle(HEAD) - begin - [25.0, 30.0]) < 4.0  # it lies where it was let go
        assert page.ask("document.documentElement.scrollWidth") <= width
        browser.screenshot(tmp_path / "page.png")
        assert _reds(tmp_path / "page.png") > 200  # the lamp is red
        page.ask("document.getElementById('write').click()")
        page.wait("document.getElementById('dialog').open")
        assert "-  A3 = 1,  " in page.ask("document.getElementById('diff').textContent")
        page.ask("document.getElementById('confirm').click()")
        page.wait("document.getElementById('outcome').textContent.startsWith('written to')")
        assert file.read_text() == session.text() != text
        page.ask("document.getElementById('cancel').click()")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key="z", modifiers=2)
        page.wait("document.getElementById('undo').disabled")
        assert session.solution is first
        page.wait("document.querySelector('[id=\"n:A3\"]').value === '1'")
        assert page.ask("window.steering.errors.length") == 0
    session.close()


@pytest.mark.nightly
def test_a_slider_a_key_and_a_lost_connection(tmp_path):
    told = []
    session = Session(read_source("luxo_poses"), told=lambda: [tell() for tell in told])
    with Browser(tmp_path / "profile") as browser:
        with served(session, told) as address:
            page = Shown(browser, address, 1280, 800)
            page.ask(
                "(() => { const e = document.querySelector('[id=\"n:g\"]'); e.value = '8.5'; "
                "e.dispatchEvent(new Event('change')); })()"
            )
            page.wait("window.steering.motions > 1 && !document.getElementById('undo').disabled")
            assert session.wait()
            assert session.solution.constants["g"] == 8.5
            page.ask(f"({HEAD}).focus()")
            key = page.ask(f"({HEAD}).dataset.key")
            before, shown = session.points()[key], session.solution
            browser.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowUp")
            end = time.monotonic() + 60.0
            while session.solution is shown and time.monotonic() < end:
                time.sleep(0.05)
            assert session.wait()
            assert np.allclose(session.points()[key] - before, [0.0, 0.0, 0.01], atol=2e-3)
        page.wait("!document.getElementById('lost').hidden")
        assert "connection" in page.ask("document.getElementById('lost').textContent")
    session.close()


def _reds(path):
    from PIL import Image

    picture = np.array(Image.open(path).convert("RGB")).astype(int)
    return int(np.sum((picture[..., 0] > 120) & (picture[..., 1] < 70) & (picture[..., 2] < 70)))
