"""Bundled specs and models with one mistake each, as people make them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from stc.models import locate as model_path
from stc.specs import locate as spec_path


@dataclass(frozen=True)
class Fault:
    """A spec's text and, where the mistake is in the model, the model's.

    Attributes:
        what: the mistake.
        spec: text of the spec.
        model: text of the model, or "" for the bundled one.
    """

    what: str
    spec: str
    model: str = ""


def text_of(name: str) -> str:
    path = spec_path(name)
    assert path is not None
    return path.read_text()


def faults(name: str) -> Iterator[Fault]:
    """Every mistake of one bundled spec."""
    text = text_of(name)
    yield from _constants(name, text)
    yield from _energies(name, text)
    yield from _forces(name, text)
    yield from _replay(name, text)
    yield from _models(name, text)


def _constants(name: str, text: str) -> Iterator[Fault]:
    """Masses, lengths, inertias and gravity that are not the model's: the spec does not tell it of them."""
    for line in re.finditer(r"^  set ([\w.]+) = -?(\w+);.*\n", text, re.MULTILINE):
        constant = line[2]
        changed, count = re.subn(
            rf"\b{constant} = ([\d.e+-]+)(?=[,;])", rf"{constant} = 1.05*\1", text, count=1
        )
        if count:
            yield Fault(f"{name}: {constant} 5 % too large", changed.replace(line[0], ""))


def _section(text: str, title: str) -> tuple[int, int]:
    found = re.search(rf"^{title}:.*?;\s*\n\s*\n", text, re.MULTILINE | re.DOTALL)
    return (found.start(), found.end()) if found else (0, 0)


def _energies(name: str, text: str) -> Iterator[Fault]:
    """Signs and missing terms of the Lagrangian."""
    start, end = _section(text, "lagrangian")
    for sign in re.finditer(r"(?<=[\s)\d])([+-])(?= \w)", text[start:end]):
        at = start + sign.start()
        line = text.count("\n", 0, at) + 1
        other = "-" if sign[1] == "+" else "+"
        yield Fault(f"{name}: sign {sign[1]} in line {line}", text[:at] + other + text[at + 1 :])
    for term in re.finditer(r"[+-] \w+\*g\*\w+|\+ I\d/2\*[\w'^()+ ]*\^2", text[start:end]):
        yield Fault(f"{name}: without {term[0]}", text[: start + term.start()] + text[start + term.end() :])


def _forces(name: str, text: str) -> Iterator[Fault]:
    """Generalised forces with another sign, another size, damping, or none."""
    start, end = _section(text, "forces")
    for entry in re.finditer(r"^  (\w+): (\w+);", text[start:end], re.MULTILINE):
        coordinate, force = entry[1], entry[2]
        for new in (f"-{force}", f"1.02*{force}", f"{force} - 0.05*{coordinate}'", f"0*{force}"):
            changed = entry[0].replace(f": {force};", f": {new};")
            yield Fault(
                f"{name}: {coordinate}: {new}",
                text[: start + entry.start()] + changed + text[start + entry.end() :],
            )


def _replay(name: str, text: str) -> Iterator[Fault]:
    """Joints and actuators of the replay exchanged."""
    for kind in ("joint", "actuator"):
        lines = re.findall(rf"^  {kind} (\w+) = (\w+);", text, re.MULTILINE)
        for (a, x), (b, y) in pairwise(lines):
            changed = text.replace(f"  {kind} {a} = {x};", f"  {kind} {a} = {y};")
            changed = changed.replace(f"  {kind} {b} = {y};", f"  {kind} {b} = {x};")
            yield Fault(f"{name}: {kind}s {a} and {b} exchanged", changed)
        for a, x in lines:
            changed = text.replace(f"  {kind} {a} = {x};", f"  {kind} {a} = -{x};")
            yield Fault(f"{name}: {kind} {a} with the wrong sign", changed)


def _models(name: str, text: str) -> Iterator[Fault]:
    """The model edited after the spec was written: damping, a spring, another gear, another axis."""
    found = re.search(r'model = "([\w.]+)"', text)
    assert found is not None
    path = model_path(found[1])
    assert path is not None
    model = path.read_text().replace('meshdir="meshes"', f'meshdir="{path.parent / "meshes"}"')
    for joint in re.findall(r'<joint name="(\w+)"', model):
        for edit in ('damping="0.05"', 'armature="0.01"', 'stiffness="2"'):
            changed = model.replace(f'<joint name="{joint}"', f'<joint name="{joint}" {edit}')
            yield Fault(f"{name}: {joint} has {edit}", text, changed)
    for actuator in re.findall(r'<motor name="(\w+)"[^>]*gear="1"', model):
        changed = re.sub(rf'(<motor name="{actuator}"[^>]*)gear="1"', r'\1gear="1.1"', model)
        yield Fault(f"{name}: gear of {actuator}", text, changed)
