"""What the contact parameters of a model do for a hop: the table of docs/own_model.md.

python bench/floors.py           measure, and write the table
python bench/floors.py --print   the page stays as it is
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import stc
from stc.validate.verdict import validate

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.document import put

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE = DOCS / "own_model.md"

SOLREF, IMPRATIO, STEP = ' solref="0.0004 1"', ' impratio="10"', 'timestep="1e-4" integrator="RK4"'
FRICTION = 'friction="0.66"'

#: What is changed, in words, with the texts of the model or the spec that are replaced.
CHANGES: dict[str, Mapping[str, str]] = {
    "nothing": {},
    "no `solref`": {SOLREF: ""},
    '`solref="0.004 1"`': {SOLREF: ' solref="0.004 1"'},
    '`solref="0.004 1"` and `timestep="1e-3"`': {
        SOLREF: ' solref="0.004 1"',
        'timestep="1e-4"': 'timestep="1e-3"',
    },
    "no `impratio`": {IMPRATIO: ""},
    '`impratio="100" cone="elliptic"`': {IMPRATIO: ' impratio="100" cone="elliptic"'},
    '`friction="0.6"`': {FRICTION: 'friction="0.6"'},
    '`friction="1"`': {FRICTION: 'friction="1"'},
    "none of these lines, MuJoCo's defaults": {SOLREF: "", IMPRATIO: "", STEP: "", f" {FRICTION}": ""},
    "`landing = 20` in the spec instead of 200": {"landing = 200": "landing = 20"},
}


def changed(text: str, changes: Mapping[str, str]) -> str:
    """A text with every occurrence of some texts replaced."""
    for old, new in changes.items():
        text = text.replace(old, new)
    return text


def measured(what: str, changes: Mapping[str, str]) -> str:
    """The row of the table for one change, solved from its own guess and replayed."""
    spec, model = [(DOCS / f"two_legs.{kind}").read_text(encoding="utf-8") for kind in ("stc", "xml")]
    if unknown := [old for old in changes if old not in spec + model]:
        raise SystemExit(f"neither spec nor model has {unknown[0]}")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "two_legs.xml").write_text(changed(model, changes), encoding="utf-8")
        path = Path(folder, "two_legs.stc")
        path.write_text(changed(spec, changes), encoding="utf-8")
        report = validate(stc.load(str(path)).solve())
    share = max(metric.value for metric in report.metrics if metric.name == "feedback share")
    base = next(
        metric.value
        for metric in report.metrics
        if metric.name == "tracked error on the ground, RMS" and metric.subject == "base"
    )
    verdict = "passed" if report.passed else "failed"
    return f"| {what} | {100 * share:.2g} % | {100 * base:.2g} % | {verdict} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--print", action="store_true", dest="dry", help="leave docs/own_model.md as it is")
    options = parser.parse_args()
    lines = ["| changed | feedback | base | |", "| --- | --- | --- | --- |"]
    print("\n".join(lines))
    for what, changes in CHANGES.items():
        lines.append(measured(what, changes))
        print(lines[-1], flush=True)
    if not options.dry:
        table = "\n".join(lines)
        put("measured", table, PAGE)


if __name__ == "__main__":
    main()
