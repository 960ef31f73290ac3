"""How long it takes from dragging a handle until the new motion is on the screen.

    python -m bench.steering                          # the lamp's landing place and head, the quadruped's landing place
    python -m bench.steering --spec luxo_jump --handle place:72:1 --seconds 20
    python -m bench.steering --alone                  # without a browser: what a processor has to do for each motion

A page of ``stc steer`` is opened in Chromium without a screen, which must be on the PATH, and a handle is dragged
back and forth by events of a mouse, 60 in a second.  The table has, in ms, the median and the 90th percentile of
the time from the newest event that a motion is for until that motion has been drawn: first the iterate that is near to
it, whose badge says "solving", then the solution, with the solver's usual tolerance; and how many of both came in a
second.  It is drawn by the processor, for there is no graphics card without a screen.

On a machine with other work these times mean nothing.  With ``--alone`` the handle is moved by the same steps
as ten motions a second would see, one after another, and the processor's time is told until the first message for the
page is made, and until that of the solution is: what one would wait with a processor for the solver alone.
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

from bench.document import ROOT, machine, put
from stc.pipeline import read_source
from stc.steering.drawn import motion_of
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

    drawn: Any
    solved: Any
    motions: int
    seconds: float


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


def alone(spec: str, handle: str, speed: float, count: int) -> Any:
    """(count, 2) seconds of a processor until the first message for each motion, and until that of the solution."""
    told = threading.Event()
    session = Session(read_source(spec), told=told.set)
    here, found = session.points()[handle], []
    for k in range(count):
        begin, generation = time.process_time(), session.generation
        session.drag(handle, here + [REACH * np.sin(speed / REACH * 0.1 * (k + 1)), 0.0, 0.0])
        times = []
        for holds in (lambda: session.generation == generation and session.busy, lambda: session.busy):  # noqa: B023
            while holds():
                told.wait(0.1)
                told.clear()
            motion_of(session, lambda motion: {})
            times.append(time.process_time() - begin)
        found.append(times)
    session.close()
    return np.array(found)


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
    ask("window.steering.latencies.length = window.steering.solved.length = window.steering.motions = 0")
    begin, last = time.perf_counter(), 0.0
    while (now := time.perf_counter() - begin) < seconds:
        mouse("mouseMoved", x + pixels * REACH * np.sin(speed / REACH * now), 1)
        last += 1.0 / RATE
        time.sleep(max(0.0, last - (time.perf_counter() - begin)))
    found = json.loads(ask("JSON.stringify(window.steering)"))
    passed = time.perf_counter() - begin
    mouse("mouseReleased", x, 0)
    if found["errors"]:
        raise SystemExit(f"the page went wrong: {found['errors'][0]}")
    drawn, solved = (1e-3 * np.array(found[name]) for name in ("latencies", "solved"))
    return Dragged(drawn, solved, found["motions"], passed)


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
    parser.add_argument("--alone", action="store_true", help="without a browser")
    parser.add_argument(
        "--write", action="store_true", help="write what is measured alone into docs/steering.md"
    )
    options = parser.parse_args()
    chosen = [(options.spec, options.handle, options.speed)] if options.spec else USUAL
    if options.alone:
        print("processor's ms                               first shown    solved")
        print("spec           handle                       median  90 %  median  90 %")
        rows = []
        for spec, handle, speed in chosen:
            rows.append((spec, handle, *alone(spec, handle, speed, 40).T))
            print(_row(*rows[-1]), flush=True)
        if options.write:
            put("measured", _table(rows), ROOT / "docs" / "steering.md")
        return
    if not CHROMIUM:
        raise SystemExit("there is no Chromium on the PATH")
    print("ms                                           first drawn   solved, drawn  motions")
    print("spec           handle                       median  90 %  median  90 %    per s")
    for spec, handle, speed in chosen:
        found = drag(spec, handle, speed, options.seconds)
        if not len(found.solved):
            print(f"{spec:14s} {handle:28s} no solution in {options.seconds:g} s")
            continue
        print(
            f"{_row(spec, handle, found.drawn, found.solved)} {found.motions / found.seconds:8.1f}",
            flush=True,
        )


def _table(rows: list[tuple[str, str, Any, Any]]) -> str:
    lines = [
        "| dragged | first motion: median, 90 % | solution: median, 90 % |",
        "| --- | --- | --- |",
    ]
    for spec, handle, *parts in rows:
        times = [", ".join(f"{1e3 * np.quantile(part, q):.0f} ms" for q in (0.5, 0.9)) for part in parts]
        lines.append(f"| `{spec}`, `{handle}` | {times[0]} | {times[1]} |")
    return "\n".join([*lines, "", f"On {machine()}."])


def _row(spec: str, handle: str, first: Any, solved: Any) -> str:
    times = [1e3 * float(np.quantile(part, q)) for part in (first, solved) for q in (0.5, 0.9)]
    return f"{spec:14s} {handle:28s} " + " ".join(f"{value:6.0f}" for value in times)


if __name__ == "__main__":
    main()
