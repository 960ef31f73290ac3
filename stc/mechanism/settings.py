"""Numbers of a model that a spec can set: their paths, their values, and the model with other values.

=============================================  ================================================================
path                                           what it is
=============================================  ================================================================
``option.gravity.x`` (``.y``, ``.z``)          gravity, m/s^2
``option.density`` (``viscosity``)             of the medium around the bodies, kg/m^3 (Pa s)
``body.NAME.mass``                             mass, kg
``body.NAME.inertia.x`` (``.y``, ``.z``)       principal moments of inertia, kg m^2
``body.NAME.com.x`` (``.y``, ``.z``)           centre of mass in the body's frame, m
``body.NAME.pos.x`` (``.y``, ``.z``)           place in the parent's frame, m
``body.NAME.gravcomp``                         share of the weight that is compensated
``joint.NAME.damping`` (``armature``,          those of all its degrees of freedom
``frictionloss``, ``stiffness``)
``joint.NAME.springref``                       where the spring of a hinge or slide is at rest, m or rad
``joint.NAME.lower``, ``joint.NAME.upper``     range, m or rad; it limits the joint from then on
``site.NAME.pos.x`` (``.y``, ``.z``), ``geom``  place in the body's frame, m
``geom.NAME.friction.slide`` (``.spin``,       friction coefficients
``.roll``)
``actuator.NAME.gear``                         its gear, if that is one number
=============================================  ================================================================

A mass does not scale an inertia.  Some positions cannot be set, because MuJoCo derives other numbers from them: those
of bodies in a model with a connect of bodies, whose anchor is that in the file, or with a weld of bodies that holds
them as the file draws them; those of bodies and sites in a model with an equality between spatial tendons.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from stc.mechanism.mechanism import Mechanism, Options
from stc.mechanism.numbers import Path

_AXES = ("x", "y", "z")
_MEDIUM = ("density", "viscosity")
_FRICTIONS = ("slide", "spin", "roll")
#: Where a range ends on a side that is not limited, m or rad.
_NO_END = 1e6

#: Per kind: where its things are, and per field the attribute, with the names of its entries if it has several.
_FIELDS: Mapping[str, tuple[str, Mapping[str, tuple[str, tuple[str, ...]]]]] = {
    "body": (
        "bodies",
        {
            "mass": ("mass", ()),
            "inertia": ("inertia", _AXES),
            "com": ("com", _AXES),
            "pos": ("pos", _AXES),
            "gravcomp": ("gravcomp", ()),
        },
    ),
    "joint": (
        "joints",
        {name: (name, ()) for name in ("damping", "armature", "frictionloss", "stiffness")},
    ),
    "site": ("sites", {"pos": ("pos", _AXES)}),
    "geom": ("geoms", {"pos": ("pos", _AXES), "friction": ("friction", _FRICTIONS)}),
}


def settable(mechanism: Mechanism) -> dict[Path, float]:
    """The paths of all numbers that can be set, and their values."""
    followed = _followed(mechanism)
    return {path: value for path, value in _all(mechanism).items() if (path[0], *path[2:3]) not in followed}


def _followed(mechanism: Mechanism) -> set[tuple[str, str]]:
    """Kinds and fields from which other numbers of the model are derived."""
    found = set()
    for equality in mechanism.equalities:
        # The last number of a weld says whether MuJoCo derives how its two bodies are to lie.
        derived = equality.kind == "connect" or (equality.kind == "weld" and equality.data[11])
        if derived and equality.between == "body":
            found.add(("body", "pos"))
        if equality.kind == "tendon":
            ends = [mechanism.tendons[index] for index in (equality.first, equality.second) if index >= 0]
            if any(tendon.kind == "spatial" for tendon in ends):
                found |= {("body", "pos"), ("site", "pos")}
    return found


def _all(mechanism: Mechanism) -> dict[Path, float]:
    found: dict[Path, float] = {
        ("option", "gravity", axis): value
        for axis, value in zip(_AXES, mechanism.options.gravity, strict=True)
    }
    found.update({("option", name): getattr(mechanism.options, name) for name in _MEDIUM})
    for kind, (attribute, fields) in _FIELDS.items():
        for thing in getattr(mechanism, attribute):
            if thing.name and thing.name != "world":
                found.update(_numbers(kind, thing, fields))
    for joint in mechanism.joints:
        if joint.kind in ("hinge", "slide"):
            found["joint", joint.name, "springref"] = joint.spring_reference[0]
            low, high = joint.bounds if joint.limited else (-_NO_END, _NO_END)
            found["joint", joint.name, "lower"], found["joint", joint.name, "upper"] = low, high
    for actuator in mechanism.actuators:
        if not any(actuator.gear[1:]):
            found["actuator", actuator.name, "gear"] = actuator.gear[0]
    return found


def _numbers(
    kind: str, thing: Any, fields: Mapping[str, tuple[str, tuple[str, ...]]]
) -> Iterator[tuple[Path, float]]:
    for name, (attribute, parts) in fields.items():
        value = getattr(thing, attribute)
        if not parts:
            yield (kind, thing.name, name), value
        for part, entry in zip(parts, value if parts else (), strict=True):
            yield (kind, thing.name, name, part), entry


def changed(mechanism: Mechanism, values: Mapping[Path, float]) -> Mechanism:
    """The model with other numbers.

    Raises:
        ValueError: a path that is none of :func:`settable`.
    """
    known = settable(mechanism)
    for path in values:
        if path not in known:
            raise ValueError(f"{'.'.join(path)} cannot be set")
    for path, value in values.items():
        mechanism = _set(mechanism, path, float(value))
    return mechanism


def _set(mechanism: Mechanism, path: Path, value: float) -> Mechanism:
    kind, name, *rest = path
    if kind == "option" and name in _MEDIUM:
        return replace(mechanism, options=_with_medium(mechanism.options, name, value))
    if kind == "option":
        gravity: Any = _with(mechanism.options.gravity, _AXES.index(rest[0]), value)
        return replace(mechanism, options=replace(mechanism.options, gravity=gravity))
    if kind == "actuator":
        return _replaced(mechanism, "actuators", name, lambda one: {"gear": _with(one.gear, 0, value)})
    if kind == "joint" and rest[0] == "springref":
        return _replaced(mechanism, "joints", name, lambda one: {"spring_reference": (value,)})
    if kind == "joint" and rest[0] in ("lower", "upper"):
        end = ("lower", "upper").index(rest[0])

        def limited(one: Any) -> dict[str, Any]:
            bounds = one.bounds if one.limited or any(one.bounds) else (-_NO_END, _NO_END)
            return {"limited": True, "bounds": _with(bounds, end, value)}

        return _replaced(mechanism, "joints", name, limited)
    things, fields = _FIELDS[kind]
    attribute, parts = fields[rest[0]]
    if not parts:
        return _replaced(mechanism, things, name, lambda one: {attribute: value})
    index = parts.index(rest[1])
    return _replaced(
        mechanism, things, name, lambda one: {attribute: _with(getattr(one, attribute), index, value)}
    )


def _with_medium(options: Options, name: str, value: float) -> Options:
    return replace(options, density=value) if name == "density" else replace(options, viscosity=value)


def _with(entries: Iterable[float], index: int, value: float) -> tuple[float, ...]:
    return tuple([value if position == index else entry for position, entry in enumerate(entries)])


def _replaced(
    mechanism: Mechanism, attribute: str, name: str, change: Callable[[Any], dict[str, Any]]
) -> Mechanism:
    """The model with one element changed."""
    things = getattr(mechanism, attribute)
    changed_ones = tuple([replace(one, **change(one)) if one.name == name else one for one in things])
    fields: dict[str, Any] = {attribute: changed_ones}
    return replace(mechanism, **fields)
