"""The certificate as a page: complete, self-contained, readable by machines and people."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import stc
from stc.certification import certify
from stc.cli.main import run
from stc.validate.certificate import Certificate
from stc.validate.certificate.page import _row
from stc.validate.certificate.pictures import render
from stc.validate.metrics import Metric

VOID = {"meta", "img", "input", "source", "br", "link"}


class Page(HTMLParser):
    """The elements of a page; complains about tags that are not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"script", "style"} & set(self.open):
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def reach() -> Certificate:
    return certify(stc.load("arm_reach").solve(), equations=True)


@pytest.fixture(scope="module")
def page(reach: Certificate, tmp_path_factory: pytest.TempPathFactory) -> str:
    return reach.write(tmp_path_factory.mktemp("page") / "a" / "reach.html", pictures=False).read_text()


def test_every_measurement_has_its_row(reach: Certificate, page: str) -> None:
    found = Page(page)
    rows = [
        attributes for attributes in found.all("tr") if attributes.get("class") in ("pass", "fail", "info")
    ]
    assert [row["class"] for row in rows].count("fail") == 0
    assert len(rows) == len(reach.metrics)
    for metric in reach.metrics:
        assert metric.name in found.text
        assert metric.subject in found.text
    for label, text in reach.facts():
        assert label in found.text
        assert text in found.text
    assert "Passed." in found.text
    assert reach.report.spec_sha256 in found.text


def test_the_whole_spec_is_there_line_by_line(reach: Certificate, page: str) -> None:
    lines = [line for line in reach.solution.source.splitlines() if line.strip()]
    text = " ".join(Page(page).text.split())
    for line in lines:
        assert " ".join(line.split()) in text
    assert len(re.findall(r"<li id='line\d+'>", page)) == len(reach.solution.source.splitlines())


def test_nothing_is_loaded_from_elsewhere(page: str) -> None:
    found = Page(page)
    for tag, attributes in found.elements:
        for name in ("src", "srcset", "href", "action", "data", "xlink:href"):
            target = attributes.get(name) or ""
            assert target == "" or target.startswith(("#", "data:")), (tag, target)
    assert not re.search(r"url\((?!#)|@import|fetch\(|XMLHttpRequest|import\(", page)
    assert "http://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", page)
    assert "https://" not in page
    (policy,) = (m["content"] for m in found.all("meta") if m.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'")


def test_it_is_well_formed_and_accessible(page: str) -> None:
    found = Page(page)
    identifiers = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    assert found.all("html")[0]["lang"] == "en"
    assert [m for m in found.all("meta") if m.get("name") == "viewport"]
    for section in found.all("section"):
        assert section["aria-labelledby"] in identifiers
    assert len(found.all("caption")) == len([t for t in found.all("table") if t.get("class") != "plain"])
    assert all(cell.get("scope") in ("col", "row", "rowgroup") for cell in found.all("th"))
    plots = [svg for svg in found.all("svg") if svg.get("class") == "plot"]
    assert all(svg.get("role") == "img" and svg.get("aria-label") for svg in plots)
    assert "prefers-color-scheme: dark" in page
    assert "prefers-reduced-motion" in page


def test_plots_show_every_joint_output_and_actuator_in_the_colours_of_the_page(
    reach: Certificate, page: str
) -> None:
    setup = reach.replays.setup
    labels = [svg["aria-label"] for svg in Page(page).all("svg") if svg.get("class") == "plot"]
    assert labels == [
        *(f"joint {tie.name} over time" for tie in setup.ties),
        *(f"output {output.line.name} over time" for output in setup.outputs),
        *(f"actuator {name} over time" for name in setup.controls.names),
    ]
    drawn = "".join(re.findall(r"<svg.*?</svg>", page, re.DOTALL))
    assert set(re.findall(r"#[0-9a-f]{6}\b", drawn)) <= {"#000000", "#ffffff"}
    assert "var(--solved)" in drawn
    assert "var(--replayed)" in drawn
    assert len(page) < 400_000


def test_a_failing_page_points_at_the_cause(tmp_path: Path) -> None:
    source = stc.load("arm_reach").text
    wrong = stc.load(source.replace("- m2*g*z2", "- 1.2*m2*g*z2"))
    page = certify(wrong.solve()).write(tmp_path / "w.html", pictures=False)
    text = Page(page.read_text()).text
    assert re.search(r"Failed\. joint (shoulder|elbow): gravity: spec", text)


def test_the_command_writes_it_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "off")
    assert run(["run", "particle_waypoints", "--set", "n=20", "--set", "T=0.5", "--report", "p.html"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("certificate: p.html")
    assert "No pictures: " in Page((tmp_path / "p.html").read_text()).text
    assert run(["validate", "particle_waypoints.npz", "--report", "q.html", "--json"]) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert record["report"] == "q.html"
    assert record["validation"]["headline"]
    assert run(["validate", "particle_waypoints.npz", "--report", "q.txt"]) == 2


def film(text: str) -> bytes:
    """The animation that a page embeds."""
    (found,) = re.findall(r"<img id='film'[^>]*src='data:image/webp;base64,([^']*)'", text)
    return base64.b64decode(found)


def chunks(content: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], 12
    while at < len(content):
        size = int.from_bytes(content[at + 4 : at + 8], "little")
        found.append((content[at : at + 4], content[at + 8 : at + 8 + size]))
        at += 8 + size + size % 2
    return found


@pytest.mark.nightly
@pytest.mark.needs("opengl")
def test_the_film_can_be_taken_apart_into_whole_frames(reach: Certificate, tmp_path: Path) -> None:
    pictures = render(reach.replays)
    content = film(reach.write(tmp_path / "a.html").read_text())
    frames = [payload for kind, payload in chunks(content) if kind == b"ANMF"]
    assert len(frames) == len(pictures.frames)
    for payload, picture in zip(frames, pictures.frames):
        width, height = (int.from_bytes(payload[k : k + 3], "little") + 1 for k in (6, 9))
        assert (width, height) == picture.size
        assert payload[:6] == bytes(6)
        body = payload[16:]
        still = Image.open(io.BytesIO(b"RIFF" + (len(body) + 4).to_bytes(4, "little") + b"WEBP" + body))
        difference = np.abs(np.asarray(still.convert("RGB"), float) - np.asarray(picture, float))
        assert difference.mean() < 6.0
    moved = np.abs(np.asarray(pictures.frames[0], float) - np.asarray(pictures.frames[-1], float))
    assert moved.max() > 60.0


def test_bars_have_a_logarithmic_scale_that_is_told(page: str) -> None:
    found = Page(page)
    assert "logarithmic scale" in found.text and "10−6 of the limit or less" in found.text
    (scale,) = re.findall(r"<div class='scale'.*?</div>", page)
    labels = re.findall(r"left:([\d.]+)%'>(.*?)</span>", scale)
    assert [float(left) for left, _ in labels] == pytest.approx(np.linspace(0.0, 100.0, 7), abs=0.1)
    assert [re.sub("<.*?>", "", text) for _, text in labels] == [f"10−{k}" for k in range(6, 0, -1)] + [
        "the limit"
    ]


@pytest.mark.parametrize(
    ("share", "width"),
    [(0.0, 0), (1e-7, 0), (1e-6, 0), (1e-4, 33), (1e-3, 50), (0.1, 83), (1.0, 100), (30.0, 100)],
)
def test_a_bar_is_a_mark_longer_for_ten_times_as_much(share: float, width: int) -> None:
    row = _row(Metric("name", "subject", 2.0 * share, "m", 2.0))
    assert f"<i style='width:{width}%'>" in row


CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)


@pytest.mark.nightly
@pytest.mark.parametrize("width", [375, 1280])
def test_a_browser_shows_it(reach: Certificate, tmp_path: Path, width: int) -> None:
    """Headless Chromium lays the page out without overflow, runs its script, and finds every figure drawn."""
    assert CHROMIUM, "this test needs Chromium on the PATH (Debian, Ubuntu: apt install chromium)"
    text = reach.write(tmp_path / "a.html").read_text()
    # What the page looks like from inside goes into its title; the frame is as wide as a phone.
    probe = """<script>addEventListener("load", () => {
      const page = document.getElementById("page").contentDocument;
      const scrub = page.getElementById("scrub");
      const look = (left) => {
        // Pictures are decoded in real time, while the clock of the page runs as fast as it can.
        if (left && scrub && page.getElementById("screen").hidden) return setTimeout(look, 50, left - 1);
        const wide = [...page.querySelectorAll("*")].filter((e) => e.getBoundingClientRect().right > WIDTH + 1);
        const drawn = [...page.querySelectorAll("svg.plot")].every((e) => e.getBoundingClientRect().height > 80);
        let cursor = null;
        if (scrub) {
          scrub.value = scrub.max;
          scrub.dispatchEvent(new Event("input"));
          const plot = page.querySelector("svg.plot");
          cursor = Number(plot.querySelector(".cursor").getAttribute("x1")) - Number(plot.dataset.x1);
        }
        document.title = JSON.stringify({ wide: wide.map((e) => e.className || e.tagName), drawn, cursor,
          paper: getComputedStyle(page.body).backgroundColor, now: scrub && page.getElementById("now").textContent });
      };
      look(10000);
    });</script>""".replace("WIDTH", str(width))
    frame = f"<iframe id='page' src='a.html' style='width:{width}px;height:900px;border:0'></iframe>"
    (tmp_path / "probe.html").write_text(f"<title>nothing</title>{frame}{probe}")
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--allow-file-access-from-files",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=600000",
        "--dump-dom",
        (tmp_path / "probe.html").as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    (title,) = re.findall(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    seen = json.loads(title.replace("&quot;", '"'))
    assert seen["wide"] == []
    assert seen["drawn"]
    assert seen["paper"] == "rgb(251, 251, 250)"
    if "id='film'" in text:
        assert seen["cursor"] == 0.0
        assert seen["now"] == "0.500 s"
