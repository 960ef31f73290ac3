"""How long it takes from dragging a handle until the new motion is on the screen.

    python -m bench.steering                          # the lamp's landing place and head, the quadruped's landing place
    python -m bench.steering --spec luxo_jump --handle place:72:1 --seconds 20

A page of ``stc steer`` is opened in Chromium without a screen, which must be on the PATH, and a handle is dragged
back and forth by events of a mouse, 60 in a second.  Told are, in milliseconds, the median and the 90th percentile of
the time from the newest event that a motion was solved for until that motion has come to the page, and until it has
been drawn (by the processor: there is no graphics card without a screen), how many motions came per second, and how
much of a processor's time the solver's process needed for each of them.  On a machine that has other work too, the
last one is the figure to go by.  Every motion that is shown is a solution, with the solver's usual tolerance.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from stc.pipeline import read_source
from stc.steering.server import Server
from stc.steering.session import Session

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from viewer.browser import CHROMIUM, Browser

#: What is dragged where nothing is named: spec, handle, and the fastest it is moved, in m/s.
USUAL = (
    ("luxo_jump", "place:72:1", 0.1),
    ("luxo_jump", "pose:120:4", 0.1),
    ("quadruped_hop", "place:the whole pose at [n]", 0.1),
    ("quadruped_hop", "foot:FL at [n]", 0.05),
)

#: How far a handle is dragged to either side, in m, and how often a mouse tells where it is, in Hz.
REACH, RATE = 0.05, 60.0


@dataclass(frozen=True, slots=True)
class Dragged:
    """What came of dragging one handle; times in seconds, (k,) one for each motion."""

    received: Any
    drawn: Any
    motions: int
    seconds: float
    processor: float


def drag(spec: str, handle: str, speed: float, seconds: float) -> Dragged:
    """Drag a handle of a spec back and forth in a browser."""
    servers: list[Server] = []
    session = Session(read_source(spec), told=lambda: servers[0].told() if servers else None)
    servers.append(Server(session))
    try:
        with TemporaryDirectory() as profile, Browser(Path(profile)) as browser:
            return _dragged(browser, _served(servers[0]), handle, speed, seconds)
    finally:
        servers[0].stop()
        session.close()


def _served(server: Server) -> str:
    """The address of a page that is served on a thread of its own."""
    found: list[str] = []
    ready = threading.Event()

    def tell(address: str) -> None:
        found.append(address)
        ready.set()

    threading.Thread(target=lambda: asyncio.run(server.run(0, tell)), daemon=True).start()
    if not ready.wait(60.0):
        raise SystemExit("the page was not served within a minute")
    return found[0]


def _dragged(browser: Browser, address: str, handle: str, speed: float, seconds: float) -> Dragged:
    def ask(script: str) -> Any:
        answer = browser.call("Runtime.evaluate", expression=script, returnByValue=True)
        return answer["result"].get("value")

    browser.call("Page.navigate", url=address)
    _until(lambda: ask("window.steering && window.steering.motions > 0"), "the page showed no motion")
    ask("document.getElementById('play').click()")
    key = json.dumps(handle)
    frames = ask(
        "JSON.stringify([...document.querySelectorAll('#keyframes button')].map((b) => b.dataset.frame))"
    )
    for frame in json.loads(frames):
        ask(f"document.querySelector('#keyframes button[data-frame=\"{frame}\"]').click()")
        time.sleep(0.3)
        if ask(
            f"[...document.querySelectorAll('.handle:not([hidden])')].some((b) => b.dataset.key === {key})"
        ):
            break
    else:
        raise SystemExit(f"there is no handle {handle}")
    place = (
        f"(() => {{ const b = [...document.querySelectorAll('.handle')].find((b) => b.dataset.key === {key})"
        ".getBoundingClientRect(); return JSON.stringify([b.x + b.width / 2, b.y + b.height / 2]); })()"
    )
    x, y = json.loads(ask(place))
    pixels = ask("window.steering.pixels()")
    mouse: Callable[..., Any] = lambda kind, at, held: browser.call(
        "Input.dispatchMouseEvent", type=kind, x=at, y=y, button="left", buttons=held, clickCount=1
    )
    mouse("mousePressed", x, 1)
    ask("window.steering.latencies.length = window.steering.received.length = window.steering.motions = 0")
    begin, worked, last = time.perf_counter(), _worked(), 0.0
    while (now := time.perf_counter() - begin) < seconds:
        mouse("mouseMoved", x + pixels * REACH * np.sin(speed / REACH * now), 1)
        last += 1.0 / RATE
        time.sleep(max(0.0, last - (time.perf_counter() - begin)))
    found = json.loads(ask("JSON.stringify(window.steering)"))
    passed, processor = time.perf_counter() - begin, _worked() - worked
    mouse("mouseReleased", x, 0)
    if found["errors"]:
        raise SystemExit(f"the page went wrong: {found['errors'][0]}")
    received, drawn = (1e-3 * np.array(found[name]) for name in ("received", "latencies"))
    return Dragged(received, drawn, found["motions"], passed, processor)


def _worked() -> float:
    """Seconds of a processor that all threads but this one, which moves the mouse, have had."""
    return time.process_time() - time.thread_time()


def _until(holds: Callable[[], Any], otherwise: str, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            raise SystemExit(otherwise)
        time.sleep(0.1)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spec")
    parser.add_argument("--handle", help="its key, as the page has it")
    parser.add_argument("--speed", type=float, default=0.1, help="the fastest that the mouse moves, in m/s")
    parser.add_argument("--seconds", type=float, default=15.0, help="for which each handle is dragged")
    options = parser.parse_args()
    if not CHROMIUM:
        raise SystemExit("there is no Chromium on the PATH")
    chosen = [(options.spec, options.handle, options.speed)] if options.spec else USUAL
    print("                                             received        drawn     motions  processor")
    print("spec           handle                       median  90 %  median  90 %   per s   per motion")
    for spec, handle, speed in chosen:
        found = drag(spec, handle, speed, options.seconds)
        if not len(found.drawn):
            print(f"{spec:14s} {handle:28s} no motion in {options.seconds:g} s")
            continue
        times = [
            1e3 * float(np.quantile(part, q)) for part in (found.received, found.drawn) for q in (0.5, 0.9)
        ]
        row = " ".join(f"{value:6.0f}" for value in times)
        each = 1e3 * found.processor / max(1, found.motions)
        print(
            f"{spec:14s} {handle:28s} {row} {found.motions / found.seconds:7.1f} {each:9.0f} ms", flush=True
        )


if __name__ == "__main__":
    main()
