"""The certificate as one HTML page that loads nothing else and can be read on a phone, in light and dark mode."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from stc.validate.certificate import blame, table
from stc.validate.certificate.curves import Line, Panel, panels
from stc.validate.certificate.listing import TextLine, listing
from stc.validate.certificate.pictures import Pictures, encoded, render
from stc.validate.certificate.plots import draw
from stc.validate.contact_forces import ContactForces
from stc.validate.metrics import Metric
from stc.validate.pictures import PictureError

if TYPE_CHECKING:
    from stc.validate.certificate.certificate import Certificate

_WORDS = {"pass": "pass", "fail": "fail", "info": "–"}

_GROUPS = {
    "joint": "Joints",
    "output": "Compared outputs",
    "actuator": "Actuators",
    "apply": "Applied forces",
    "contact": "Contact forces",
}

_CONTACT_KEY = (
    "<p class='key'><span class='solved'>solved</span><span class='replayed'>MuJoCo's contacts, forces alone</span>"
    "<span class='cone'>edge of the friction cone</span></p>"
)


#: The bars of the table have a logarithmic scale: so many powers of ten below the limit, they are empty.
_DECADES = 6


def page(certificate: Certificate, *, pictures: bool = True) -> str:
    """The whole page.

    Args:
        certificate: the certificate.
        pictures: whether to render the filmstrip and the video; if that fails, the page gives the reason.
    """
    here = Path(__file__).parent
    report = certificate.report
    verdict = "passed" if certificate.passed else "failed"
    parts = [
        _head(certificate, verdict),
        _pictures(certificate) if pictures else "",
        _tables(certificate),
        _plots(certificate),
        _spec(listing(certificate.solution, certificate.statements)),
        _foot(certificate),
    ]
    return "".join(
        [
            "<!doctype html>\n<html lang='en'>\n<head>\n<meta charset='utf-8'>\n",
            "<meta name='viewport' content='width=device-width, initial-scale=1'>\n",
            "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'; img-src data: blob:; "
            "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n",
            "<meta name='color-scheme' content='light dark'>\n",
            f"<title>{escape(report.spec)}: {verdict}</title>\n",
            f"<style>\n{(here / 'page.css').read_text(encoding='utf-8')}</style>\n</head>\n",
            f"<body>\n<main>\n{''.join(parts)}</main>\n",
            f"<script>\n{(here / 'page.js').read_text(encoding='utf-8')}</script>\n</body>\n</html>\n",
        ]
    )


def _head(certificate: Certificate, verdict: str) -> str:
    report = certificate.report
    lines = [] if certificate.passed else blame.others(certificate.metrics, certificate.findings)
    others = f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>" if lines else ""
    steps = "".join(f"<p class='next'>Next: {escape(step)}.</p>" for step in certificate.next_steps)
    notes = "".join(f"<p class='note'>{escape(note)}</p>" for note in certificate.notes)
    return (
        "<header>\n<p class='kind'>Certificate of a motion</p>\n"
        f"<h1>{escape(report.spec)}</h1>\n"
        f"<div class='verdict {verdict}'><p><strong>{verdict.capitalize()}.</strong> "
        f"{escape(certificate.headline)}</p>{others}{steps}</div>\n{notes}"
        f"{_facts(certificate.facts())}</header>\n"
    )


def _facts(facts: Iterable[tuple[str, str]]) -> str:
    cells = "".join(f"<div><dt>{escape(label)}</dt><dd>{escape(text)}</dd></div>" for label, text in facts)
    return f"<dl class='facts'>{cells}</dl>\n"


# ---------------------------------------------------------------------------------------------- measurements


def _tables(certificate: Certificate) -> str:
    cards = "".join(_table(section) for section in table.sections(certificate.metrics))
    return (
        "<section aria-labelledby='measured'>\n<h2 id='measured'>Measurements</h2>\n"
        f"{_scale()}<div class='cards'>{cards}</div>\n</section>\n"
    )


def _scale() -> str:
    """The explanation of the bars below the limits, with their axis."""
    labels = [f"10<sup>−{power}</sup>" if power else "the limit" for power in range(_DECADES, -1, -1)]
    places = "".join(
        f"<span style='left:{100.0 * step / _DECADES:.4g}%'>{label}</span>"
        for step, label in enumerate(labels)
    )
    return (
        "<div class='hint'><p>The bar under a limit tells on a logarithmic scale how much of the limit is reached: "
        "from mark to mark ten times as much, full at the limit, empty where it is "
        f"10<sup>−{_DECADES}</sup> of the limit or less.</p>"
        f"<div class='scale' aria-hidden='true'><b class='bar'></b>{places}</div></div>\n"
    )


def _table(section: table.Section) -> str:
    bodies = []
    for name, metrics in section.by_name().items():
        rows = "".join(_row(metric) for metric in metrics)
        bodies.append(f"<tbody><tr><th colspan='4' scope='rowgroup'>{escape(name)}</th></tr>{rows}</tbody>")
    return (
        f"<div class='card'><table><caption>{escape(section.title)}</caption>"
        "<thead><tr><th scope='col'>of</th><th scope='col'>value</th><th scope='col'>limit</th>"
        f"<th scope='col'>verdict</th></tr></thead>{''.join(bodies)}</table></div>\n"
    )


def _row(metric: Metric) -> str:
    share = table.margin(metric)
    bar = ""
    if share is not None:
        width = (
            100.0
            if math.isinf(share) or share >= 1.0
            else max(0.0, 100.0 * (1.0 + math.log10(share or 1e-99) / _DECADES))
        )
        bar = f"<span class='bar' aria-hidden='true'><i style='width:{width:.0f}%'></i></span>"
    sign = "≥&#8239;" if metric.at_least else "≤&#8239;"
    limit = _exponents(table.quantity(metric, metric.limit), sign) if metric.limit is not None else ""
    return (
        f"<tr class='{metric.verdict}'><th scope='row'>{escape(metric.subject)}</th>"
        f"<td>{_exponents(table.quantity(metric, metric.value))}</td><td>{limit}{bar}</td>"
        f"<td>{_WORDS[metric.verdict]}</td></tr>"
    )


def _exponents(text: str, before: str = "") -> str:
    """A quantity as HTML that does not break, with powers of ten as superscripts; units that are words may break."""
    number, _, unit = text.partition(" ")
    mantissa, e, exponent = number.partition("e")
    shown = f"{mantissa}&#8239;·&#8239;10<sup>{int(exponent)}</sup>" if e and exponent else escape(number)
    shown = before + shown.replace("<sup>-", "<sup>−")
    if len(unit) > 5:
        return f"<span class='n'>{shown}</span> <span class='unit'>{escape(unit)}</span>"
    after = f"&#8239;{escape(unit)}" if unit else ""
    return f"<span class='n'>{shown}{after}</span>"


# --------------------------------------------------------------------------------------------------- pictures


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _pictures(certificate: Certificate) -> str:
    heading = "<section aria-labelledby='replay'>\n<h2 id='replay'>Replay</h2>\n"
    try:
        found = render(certificate.replays)
    except PictureError as error:
        return f"{heading}<p class='note'>No pictures: {escape(' '.join(str(error).split()))}</p></section>\n"
    return f"{heading}{_player(certificate, found)}{_strip(found)}</section>\n"


def _player(certificate: Certificate, found: Pictures) -> str:
    width, height = found.frames[0].size
    last = len(found.frames) - 1
    slowness = found.slowness
    pace = f"{slowness:.3g} times slower than life" if slowness > 1.05 else "in real time"
    ghost = ", translucent and orange the solved motion" if found.ghost else ""
    caption = f"MuJoCo's replay ({found.replay}), {pace}; blue its path{ghost}."
    alt = escape(f"{certificate.report.spec} as MuJoCo replays it")
    return (
        "<figure class='player'>\n<picture>"
        f"<source media='(prefers-reduced-motion: reduce)' srcset='{_data('image/webp', encoded(found.frames[0]))}'>"
        f"<img id='film' width='{width}' height='{height}' alt='{alt}' "
        f"src='{_data('image/webp', found.animation())}'></picture>\n"
        f"<canvas id='screen' width='{width}' height='{height}' role='img' aria-label='{alt}' hidden></canvas>\n"
        f"<div class='controls' hidden data-start='{found.time[0]:.9g}' data-end='{found.time[-1]:.9g}' "
        f"data-pace='{found.seconds_a_frame:.6g}'>"
        "<button type='button' id='play' aria-pressed='false'>Play</button>"
        f"<input type='range' id='scrub' min='0' max='{last}' value='0' step='1' aria-label='time in the motion'>"
        "<output id='now' for='scrub'></output></div>\n"
        f"<figcaption>{escape(caption)}</figcaption></figure>\n"
    )


def _strip(found: Pictures) -> str:
    items = "".join(
        f"<li><img loading='lazy' alt='at {found.time[k]:.3g} s' width='240' height='150' "
        f"src='{_data('image/webp', encoded(found.frames[k].resize((240, 150))))}'>"
        f"<span>{found.time[k]:.3g} s</span></li>"
        for k in found.strip()
    )
    return f"<ol class='strip' aria-label='filmstrip'>{items}</ol>\n"


# ------------------------------------------------------------------------------------------------------ plots


def _plots(certificate: Certificate) -> str:
    found = panels(certificate.replays)
    if certificate.replays.ground:
        found = [panel for panel in found if panel.group != "contact"] + _ground(certificate.replays.ground)
    if not found:
        return ""
    by_group: dict[str, list[str]] = {}
    for plot in draw(found):
        title = f"<figcaption>{_title(plot.panel)}</figcaption>"
        by_group.setdefault(plot.panel.group, []).append(f"<figure>{title}{plot.svg}</figure>")
    tracked = certificate.replays.tracked is not None
    key = "<p class='key'><span class='solved'>solved</span><span class='replayed'>replayed, forces alone</span>"
    key += "<span class='tracked'>replayed with feedback</span></p>" if tracked else "</p>"
    parts = []
    for group, figures in by_group.items():
        legend = {
            "joint": key,
            "output": key,
            "contact": _CONTACT_KEY if certificate.replays.ground else "",
        }.get(group, "")
        parts.append(f"<h3>{_GROUPS[group]}</h3>{legend}<div class='plots'>{''.join(figures)}</div>")
    return f"<section aria-labelledby='plots'>\n<h2 id='plots'>Over time</h2>\n{''.join(parts)}</section>\n"


def _ground(forces: Sequence[ContactForces]) -> list[Panel]:
    """Every component of every contact force, solved and replayed, in the friction cone."""
    found = []
    for one in forces:
        for part, solved in one.solved.items():
            lines = [Line("solved", one.time, solved), Line("replayed", one.time, one.found[part])]
            if part in ("fx", "fy") and np.isfinite(one.friction).any() and "fz" in one.solved:
                cone = np.nan_to_num(one.friction) * one.solved["fz"]
                lines += [Line("cone", one.time, cone), Line("cone", one.time, -cone)]
            found.append(Panel("contact", f"{one.body} {part}", "N" if part[0] == "f" else "N m", lines, []))
    return found


def _title(panel: Panel) -> str:
    unit = f", {panel.unit}" if panel.unit else ""
    return f"{escape(panel.name)}<small>{escape(unit)}</small>"


# ------------------------------------------------------------------------------------------------------- spec


def _spec(lines: list[TextLine]) -> str:
    largest = max((abs(mark.value) for line in lines for mark in line.marks), default=0.0)
    rows = []
    for line in lines:
        marks = "".join(
            _mark(mark.value, mark.time, mark.active, mark.nodes, largest, mark.text) for mark in line.marks
        )
        rows.append(
            f"<li id='line{line.number}'><code>{escape(line.text) or '&#8203;'}</code>"
            f"{f'<div class=marks>{marks}</div>' if marks else ''}</li>"
        )
    return (
        "<section aria-labelledby='spec'>\n<h2 id='spec'>The spec</h2>\n"
        "<p class='hint'>Beside a statement: the largest of its multipliers, which is how much the objective would "
        "change per unit that the statement gives way, when that is, and at how many of its nodes it is active.</p>\n"
        f"<ol class='listing'>{''.join(rows)}</ol>\n</section>\n"
    )


def _mark(value: float, time: float, active: int, nodes: int, largest: float, text: str) -> str:
    if not active:
        return f"<span class='idle'><b>{escape(text)}</b> never active</span>"
    weight = abs(value) / largest if largest > 0.0 else 0.0
    return (
        f"<span style='--weight:{weight:.3f}'><b>{escape(text)}</b> {_exponents(table.number(value))} "
        f"at {time:.3g}&#8239;s, active at {active} of {nodes}</span>"
    )


def _foot(certificate: Certificate) -> str:
    report = certificate.report
    rows = [
        ("spec sha256", report.spec_sha256),
        ("model sha256", report.model_sha256),
        *((f"set {path}", f"{value:.17g}") for path, value in report.fields.items()),
    ]
    cells = "".join(f"<tr><th scope='row'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in rows)
    return (
        "<section aria-labelledby='made'>\n<details><summary id='made'>Hashes, and what the spec set in the model"
        f"</summary><table class='plain'>{cells}</table></details>\n"
        f"<p class='hint'>Validated in {report.seconds:.2g}&#8239;s. "
        "All limits are in validate/limits.py.</p></section>\n"
    )
