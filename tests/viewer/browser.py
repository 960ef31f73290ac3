"""Chromium without a screen, steered through its DevTools protocol."""

import base64
import json
import re
import shutil
import subprocess
import time
import urllib.request
from contextlib import ExitStack

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)

_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
    "--window-size=900,760",
)


class Browser:
    """A browser with one page; use it in a ``with`` statement."""

    def __init__(self, profile):
        self._profile = profile
        self._open = ExitStack()
        self._count = 0
        self.log = []

    def __enter__(self):
        with ExitStack() as stack:
            process = stack.enter_context(
                subprocess.Popen(
                    [CHROMIUM, *_FLAGS, f"--user-data-dir={self._profile}", "about:blank"],
                    stderr=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    text=True,
                )
            )
            stack.callback(process.terminate)
            line = next(line for line in process.stderr if "ws://" in line)
            port = re.search(r":(\d+)/", line)[1]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                pages = json.load(answer)
            address = next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page")
            from websockets.sync.client import connect

            self._socket = stack.enter_context(connect(address, max_size=None))
            self.call("Runtime.enable")
            self._open = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._open.close()

    def call(self, method, **parameters):
        """Carry out one command and return its result; what the page logs meanwhile goes to ``log``."""
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=120))
            if answer.get("id") == self._count:
                return answer["result"]
            if answer.get("method") == "Runtime.consoleAPICalled":
                self.log += [str(value.get("value", "")) for value in answer["params"]["args"]]

    def wait_for_log(self, text, seconds):
        """Wait until the page has logged a text."""
        end = time.monotonic() + seconds
        while not any(text in line for line in self.log):
            assert time.monotonic() < end, f"the page never said {text!r}; it said {self.log[-20:]}"
            time.sleep(0.3)
            self.call("Runtime.evaluate", expression="1")

    def screenshot(self, path):
        """Write a picture of the page."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
