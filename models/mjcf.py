"""Writing MJCF: numbers in full precision, and the parts that all models share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree import ElementTree

from stc.models.solids import Inertia

Element = ElementTree.Element
Value = str | float | bool | Sequence[float]


def number(value: float) -> str:
    """The shortest text that reads back as the very same number; whole numbers without a point."""
    if value == 0.0:
        return "0"
    text = repr(float(value))
    return text.removesuffix(".0")


def element(tag: str, *children: Element, **attributes: Value) -> Element:
    """An XML element; attributes keep their order, a trailing ``_`` in a name (``class_``) is dropped."""
    made = Element(tag, {key.rstrip("_"): _text(value) for key, value in attributes.items()})
    made.extend(children)
    return made


def _text(value: Value) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Iterable):
        return " ".join(number(part) for part in value)
    return number(value)


def inertial(inertia: Inertia) -> Element:
    """``<inertial>`` in full precision: what is weighed, whatever the meshes' own rounding (STL is float32)."""
    return element("inertial", pos=inertia.centre, mass=inertia.mass, diaginertia=inertia.moments)


def seen(mesh: str, material: str, **attributes: Value) -> Element:
    """A geom for the eye alone: a mesh that nothing collides with and that weighs nothing."""
    return element("geom", class_="seen", mesh=mesh, material=material, **attributes)


def hinge(name: str, *, axis: Sequence[float], **attributes: Value) -> Element:
    return element("joint", name=name, type="hinge", axis=axis, **attributes)


def slide(name: str, *, axis: Sequence[float], **attributes: Value) -> Element:
    return element("joint", name=name, type="slide", axis=axis, **attributes)


def motors(*joints: str) -> Element:
    """A motor at each joint, of the joint's name: its control is its force or torque, unlimited."""
    return element("actuator", *(element("motor", name=joint, joint=joint, gear=1.0) for joint in joints))


def meshes(names: Iterable[str], thin: Iterable[str] = ()) -> list[Element]:
    """``<mesh>`` assets; those of ``thin`` sheets are told so, having no volume to speak of."""
    sheets = set(thin)
    return [
        element("mesh", name=name, file=f"{name}.stl", **({"inertia": "shell"} if name in sheets else {}))
        for name in names
    ]


def material(name: str, rgb: Sequence[float], specular: float, shininess: float, **more: Value) -> Element:
    return element("material", name=name, rgba=(*rgb, 1.0), specular=specular, shininess=shininess, **more)


def document(name: str, comment: str, *parts: Element) -> str:
    """A whole MJCF file."""
    root = element("mujoco", *parts, model=name)
    ElementTree.indent(root, space="  ")
    lines = "\n     ".join(comment.strip().splitlines())
    return f"<!-- {lines} -->\n{ElementTree.tostring(root, encoding='unicode')}\n"
