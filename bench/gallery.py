"""Solve, validate and film every bundled motion, and write the gallery: docs/gallery.md with its films.

    python -m bench.gallery                       all of them; half an hour, since films are rendered in software
    python -m bench.gallery luxo_jump luxo_moon   some; the page keeps the others

A film shows the replay on which the verdict rests, at a small size.
"""

from __future__ import annotations

import argparse
import io
import re
from pathlib import Path

from stc import specs
from stc.certification import certify
from stc.pipeline import load
from stc.validate.certificate import Certificate
from stc.validate.certificate.pictures import Pictures, render

ROOT = Path(__file__).parent.parent
PAGE, FILMS = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"

#: Width and height of a film in pixels, how many pictures it has at most, and how well they are kept.
SIZE, MOST, QUALITY = (288, 180), 30, 50
#: Bytes that a film may have.
LARGEST = 200_000

_HEAD = """# Gallery

This page shows all bundled motions. The films show the replay in MuJoCo on which the verdict rests: without feedback if
small errors hardly grow, otherwise with feedback. `stc run NAME` solves and validates a motion, and its option
`--report FILE.html` writes its certificate. `make gallery` writes this page.
"""
_SECTION = re.compile(r"^## (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


def film(pictures: Pictures) -> bytes:
    """A small animated WebP of a replay."""
    frames = pictures.frames
    stream = io.BytesIO()
    frames[0].save(
        stream,
        "WEBP",
        save_all=True,
        append_images=frames[1:],
        duration=round(1000 * pictures.seconds_a_frame),
        loop=0,
        quality=QUALITY,
        method=4,
    )
    return stream.getvalue()


def section(name: str, certificate: Certificate) -> str:
    """A motion's part of the page."""
    solution = certificate.solution
    verdict = "passed" if certificate.passed else "failed"
    return (
        f"{specs.title(name)}\n\n![{name}](gallery/{name}.webp)\n\n"
        f"**{verdict}**: {certificate.headline}.\n\n"
        f"[specs/{name}.stc](../specs/{name}.stc); {solution.method}, n = {solution.n}, "
        f"{solution.duration:.4g} s, objective {solution.objective:.6g}.\n\n"
    )


def main() -> None:
    """Make the films that are asked for and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME")
    names = parser.parse_args().names or list(specs.names())
    FILMS.mkdir(exist_ok=True)
    for name in names:
        certificate = certify(load(name).solve(), equations=False)
        content = film(render(certificate.replays, SIZE, MOST))
        if len(content) > LARGEST:
            raise SystemExit(f"the film of {name} has {len(content)} bytes; at most {LARGEST} are kept")
        (FILMS / f"{name}.webp").write_bytes(content)
        write(name, section(name, certificate))
        print(f"{name}: {len(content)} bytes, {certificate.headline}", flush=True)


def write(name: str, text: str) -> None:
    """Put a motion's part into the page, in the place of the old one."""
    known = dict(_SECTION.findall(PAGE.read_text(encoding="utf-8"))) if PAGE.is_file() else {}
    known[name] = f"\n{text}"
    parts = [f"## {key}\n{known[key].rstrip()}\n" for key in specs.names() if key in known]
    missing = [key for key in specs.names() if key not in known]
    if missing:
        parts.insert(0, f"Not filmed yet: {', '.join(missing)}.\n")
    PAGE.write_text("\n".join([_HEAD, *parts]), encoding="utf-8")


if __name__ == "__main__":
    main()
