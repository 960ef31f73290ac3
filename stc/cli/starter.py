"""The spec that ``stc new`` writes: short, commented, and ready to solve and validate."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from stc.cli.options import ready_to_write
from stc.errors import UsageError

_TEXT = """\
# {name}: a particle is thrown onto a ledge with the least force.
#
#     stc run {word}                     solve it, then let MuJoCo replay the forces
#     stc run {word} --set g=1.62        the same on the moon
#     stc show {word} --stage problem    what it says, spelled out

constants:
  n = 40,                 # frames are 0, 1, ..., n
  T = 1.5,                # seconds in all
  h = T/n,                # seconds from one frame to the next
  m = 1,                  # kg
  g = 9.8,                # m/s^2
  width = 1.5,            # the ledge: how far away,
  height = 0.8,           # and how high, in m
  strength = 25;          # largest force, N

variables:
  x, y,                   # position in m: one unknown per frame each
  fx, fy;                 # force in N

constraints:
  [0, n]:                 # on every frame: Newton's law. An expression alone means "= 0".
    m*x'' - fx;
    m*y'' = fy - m*g;
  [0]:                    # on the first frame: at the origin, at rest
    x; y; x'; y';
  [n/2]:                  # half way: above the ledge already
    y >= height + 0.2;
  [n]:                    # on the last frame: on the ledge, at rest
    x = width; y = height; x'; y';
  [0, n]:
    fx^2 + fy^2 <= strength^2;

objective:
  [0, n]: integral(fx^2 + fy^2);

method: hermite-simpson;  # or central, trapezoidal

# How MuJoCo replays it: numbers go over, never the equations above, so that it is an independent judge.
# A model is looked up beside this file, then among the bundled ones.
replay:
  model = "particle.xml";
  joint x = x;            # where each joint starts; its path is compared with this
  joint z = y;
  actuator fx = fx;       # what drives each motor
  actuator fz = fy;
  set body.particle.mass = m;
  set option.gravity.z = -g;
"""


def write(
    name: str, model: str | None = None, copied: str | None = None, seconds: float | None = None
) -> Path:
    """Write the starter spec, or a copy of a bundled one, as ``NAME.stc``.

    A name may be a path, whose folders are created.

    Args:
        name: name of the spec.
        model: a model file for the spec, in place of the particle.
        copied: the name of a bundled spec; the data files that it names are copied too.
        seconds: processor time for each page that is tried for a model.

    Raises:
        UsageError: a file exists, the name is none for a spec, or there is no such bundled spec.
        OSError: it cannot be written.
    """
    path = Path(name)
    if path.suffix != ".stc":
        path = path.with_name(path.name + ".stc") if path.name else path
    if path.stem in ("", ".stc") or name.endswith(("/", os.sep)) or "\0" in name:
        raise UsageError(f"`{name}` is not a name for a spec")
    word = shlex.quote(str(path))
    text = _TEXT.format(name=path.stem, word=word)
    files: list[Path] = []
    if copied is not None:
        if model is not None:
            raise UsageError("`--from` copies a spec with its model: `--model` does not go with it")
        text, files = _bundled(copied)
    if seconds is not None and model is None:
        raise UsageError("`--time-limit` is for the pages that `--model` tries")
    _none_there([path, *(path.parent / file.name for file in files)])
    if model is not None:
        from stc.cli.model_starter import starter

        text = starter(model, path, seconds)
    ready_to_write(path, "stc new", tell=False)
    written = {path: text, **{path.parent / file.name: file.read_text(encoding="utf-8") for file in files}}
    for target, content in written.items():
        try:
            with target.open("x", encoding="utf-8") as file:
                file.write(content)
        except FileExistsError:
            raise UsageError(f"`{target}` exists already; it was not replaced") from None
    return path


def _none_there(targets: list[Path]) -> None:
    """Refuse to write over files, before any time is spent on what is to stand in them."""
    for target in targets:
        if target.exists():
            raise UsageError(f"`{target}` exists already; nothing was written")


def _bundled(name: str) -> tuple[str, list[Path]]:
    """The text of a bundled spec, and the data files beside it that it names.

    Raises:
        UsageError: there is no such spec.
    """
    from stc import specs

    source = specs.locate(name)
    if source is None:
        raise UsageError(f"there is no bundled spec `{name}`", "`stc list` names them")
    text = source.read_text(encoding="utf-8")
    return text, [file for file in sorted(source.parent.glob("*.csv")) if f'"{file.name}"' in text]
