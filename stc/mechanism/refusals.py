"""Elements of a model that cannot be stated exactly as smooth equations, with their names and lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from stc.mechanism.mechanism import Actuator, Equality, Geom, Mechanism, Place, Tendon
from stc.records import dataclass

#: The words by which a spec can leave things out, and what each stands for.
KINDS = {
    "fluid": "forces of a surrounding medium",
    "muscles": "muscles",
    "actuators": "actuators of kinds that cannot be stated",
    "wrapping": "tendons that wrap around geoms",
    "flexes": "deformable bodies",
    "plugins": "plugins",
    "adhesion": "adhesion of geoms and adhesive actuators",
    "yielding": "springs that yield",
    "branches": "tendons with armature whose ends are on different branches",
    "delays": "controls that arrive late",
    "equalities": "equality constraints of kinds that cannot be stated",
    "conveyors": "surfaces that move by themselves",
}


@dataclass(frozen=True, slots=True)
class Refusal:
    """One element that cannot be stated.

    Attributes:
        kind: one of :data:`KINDS`, the word that leaves it out.
        element: its kind and name: ``actuator "left"``.
        reason: the reason, in words.
        place: its position in the model file, None if it is not known.
    """

    kind: str
    element: str
    reason: str
    place: Place | None

    def __str__(self) -> str:
        where = "" if self.place is None else f"{self.place}: "
        return f"{where}{self.element}: {self.reason}"


def refusals(mechanism: Mechanism) -> list[Refusal]:
    """All elements for which there are no exact equations of motion, in the order of :data:`KINDS`.

    Contact, limits and dry friction are not equations of motion and not checked here.
    """
    found = [
        *_of_actuators(mechanism.actuators),
        *_of_tendons(mechanism),
        *_of_joints(mechanism),
        *_of_equalities(mechanism),
        *(() if "contact" in mechanism.options.disabled else _of_geoms(mechanism.geoms)),
        *_others(mechanism),
    ]
    order = list(KINDS)
    return sorted(found, key=lambda refusal: order.index(refusal.kind))


def without(mechanism: Mechanism, kinds: Iterable[str]) -> Mechanism:
    """The model without all elements of some kinds of :data:`KINDS`; yielding springs become elastic.

    Raises:
        ValueError: an unknown word.
    """
    left = frozenset(kinds)
    unknown = sorted(left - KINDS.keys())
    if unknown:
        raise ValueError(f"nothing is called {', '.join(unknown)}; there are: {', '.join(KINDS)}")
    actuators = []
    for actuator in mechanism.actuators:
        reason = _reason(actuator)
        if reason is not None and reason[0] in left:
            actuator = (
                replace(actuator, delay=0.0) if reason[0] == "delays" else replace(actuator, enabled=False)
            )
        actuators.append(actuator)
    tendons = []
    for index, tendon in enumerate(mechanism.tendons):
        if "wrapping" in left and _wraps(tendon):
            tendon = replace(tendon, path=(), kind="fixed", stiffness=0.0, damping=0.0, armature=0.0)
            tendon = replace(tendon, stiffness_poly=(0.0, 0.0), damping_poly=(0.0, 0.0), limited=False)
        if "branches" in left and _branches(mechanism, index):
            tendon = replace(tendon, armature=0.0)
        tendons.append(replace(tendon, spring_yield=0.0) if "yielding" in left else tendon)
    joints, geoms, options = mechanism.joints, mechanism.geoms, mechanism.options
    if "yielding" in left:
        joints = tuple([replace(joint, spring_yield=0.0) for joint in joints])
    if "adhesion" in left:
        geoms = tuple([replace(geom, adhesion=0.0) for geom in geoms])
    if "conveyors" in left:
        geoms = tuple([replace(geom, surface_velocity=(0.0,) * 6) for geom in geoms])
    if "fluid" in left:
        options = replace(options, density=0.0, viscosity=0.0)
    equalities = [each for each in mechanism.equalities if _word_of(each) not in left]
    return replace(
        mechanism,
        joints=joints,
        geoms=geoms,
        actuators=tuple(actuators),
        tendons=tuple(tendons),
        equalities=tuple(equalities),
        options=options,
        others=tuple([other for other in mechanism.others if _OTHERS[other[0]][0] not in left]),
        left_out=mechanism.left_out | left,
    )


def _wraps(tendon: Tendon) -> bool:
    return any(step.kind in ("sphere", "cylinder") for step in tendon.path)


def _named(kind: str, name: str) -> str:
    return f'{kind} "{name}"' if name else kind


#: What is known to be stated of actuators.
_GAINS = {"fixed", "affine", "pid", "dcmotor"}
_BIASES = {"none", "affine", "dcmotor"}
_DYNAMICS = {"none", "integrator", "filter", "filterexact", "pid", "dcmotor"}
_EQUALITIES = {"connect", "weld", "joint", "tendon"}
#: Words and reasons for elements that have no counterpart.
_OTHERS = {
    "flex": ("flexes", "deformable bodies cannot be stated"),
    "plugin": ("plugins", "plugins cannot be stated"),
}
_TRANSMISSIONS = {"joint", "jointinparent", "tendon", "site", "slidercrank"}


def _of_actuators(actuators: Iterable[Actuator]) -> Iterator[Refusal]:
    for actuator in actuators:
        if not actuator.enabled:
            continue
        reason = _reason(actuator)
        if reason is not None:
            kind, sentence = reason
            yield Refusal(kind, _named("actuator", actuator.name), sentence, actuator.place)


def _reason(actuator: Actuator) -> tuple[str, str] | None:
    """Why an actuator cannot be stated, and its kind; None if it can."""
    if actuator.plugin:
        return "plugins", "its force is computed by a plugin"
    if actuator.transmission == "body":
        return "adhesion", "it pulls on whatever its body touches"
    if "muscle" in (actuator.gain, actuator.bias, actuator.dynamics):
        return "muscles", "muscles cannot be stated"
    unknown = [
        f"{what} of kind {kind}"
        for what, kind, known in (
            ("gain", actuator.gain, _GAINS),
            ("bias", actuator.bias, _BIASES),
            ("dynamics", actuator.dynamics, _DYNAMICS),
            ("transmission", actuator.transmission, _TRANSMISSIONS),
        )
        if kind not in known
    ]
    if unknown:
        return "actuators", f"it has {' and '.join(unknown)}, which cannot be stated"
    kinks = _kinks(actuator)
    if kinks:
        return "actuators", f"it has {' and '.join(kinks)}, which cannot be stated"
    if actuator.delay:
        return "delays", f"its control arrives {actuator.delay:g} s late"
    return None


def _kinks(actuator: Actuator) -> list[str]:
    """The parts of a controller or an electric motor that are not smooth."""
    dynamics, gain = actuator.dynamics_parameters, actuator.gain_parameters
    found: list[tuple[str, float]] = []
    if actuator.dynamics == "pid":
        found = [
            ("a limit of its integral", dynamics[0]),
            ("a limit of how fast it is commanded", dynamics[1]),
        ]
    if actuator.gain == "dcmotor":
        found = [
            ("a limit of its voltage", gain[7]),
            ("a limit of how fast its current changes", dynamics[1]),
            ("a temperature", dynamics[2]),
            ("friction of bristles", dynamics[5]),
            ("a limit of how fast it is commanded", dynamics[7]),
            ("a limit of its integral", dynamics[8]),
        ]
    return [what for what, size in found if size > 0.0]


def _of_tendons(mechanism: Mechanism) -> Iterator[Refusal]:
    for index, tendon in enumerate(mechanism.tendons):
        element = _named("tendon", tendon.name)
        if _wraps(tendon):
            sentence = "it wraps around a geom, and its length cannot be stated"
            yield Refusal("wrapping", element, sentence, tendon.place)
        if tendon.spring_yield:
            yield Refusal("yielding", element, "its spring yields, and remembers how far", tendon.place)
        if _branches(mechanism, index):
            sentence = "it has armature and ties different branches, between which MuJoCo has no inertia"
            yield Refusal("branches", element, sentence, tendon.place)


def _branches(mechanism: Mechanism, index: int) -> bool:
    """Whether a tendon has armature and acts on bodies of which neither is an ancestor of the other.

    MuJoCo's inertia matrix has no entries between branches of the tree, and leaves out what would stand there.
    """
    tendon = mechanism.tendons[index]
    drives = [
        each.armature for each in mechanism.actuators if (each.transmission, each.target) == ("tendon", index)
    ]
    if not tendon.armature and not any(drives):
        return False
    moved: set[int] = set()
    if tendon.kind == "fixed":
        moved = {mechanism.joints[step.index].body for step in tendon.path}
    for first, second in zip(tendon.path, tendon.path[1:]):
        if first.kind == second.kind == "site":
            ends = [_above(mechanism, mechanism.sites[step.index].body) for step in (first, second)]
            moved |= {body for body in ends[0] ^ ends[1] if mechanism.bodies[body].joints}
    return any(a not in _above(mechanism, b) and b not in _above(mechanism, a) for a in moved for b in moved)


def _above(mechanism: Mechanism, body: int) -> set[int]:
    """A body and all its ancestors."""
    found = {body}
    while body:
        body = mechanism.bodies[body].parent
        found.add(body)
    return found


def _of_joints(mechanism: Mechanism) -> Iterator[Refusal]:
    for joint in mechanism.joints:
        if joint.spring_yield:
            element = _named("joint", joint.name)
            yield Refusal("yielding", element, "its spring yields, and remembers how far", joint.place)


def _of_equalities(mechanism: Mechanism) -> Iterator[Refusal]:
    for equality in mechanism.equalities:
        word = _word_of(equality)
        if word == "equalities" and equality.active:
            sentence = f"an equality of kind {equality.kind} cannot be stated"
            yield Refusal(word, _named("equality", equality.name), sentence, equality.place)


def _word_of(equality: Equality) -> str:
    """The kind of an equality that cannot be stated, empty for others; flexes have their own kinds."""
    if equality.kind in _EQUALITIES:
        return ""
    return "flexes" if equality.kind.startswith("flex") else "equalities"


def _of_geoms(geoms: Iterable[Geom]) -> Iterator[Refusal]:
    for geom in geoms:
        element = _named("geom", geom.name)
        if geom.adhesion:
            yield Refusal("adhesion", element, "it sticks to what it touches", geom.place)
        if any(geom.surface_velocity):
            yield Refusal("conveyors", element, "its surface moves by itself", geom.place)


def _others(mechanism: Mechanism) -> Iterator[Refusal]:
    for kind, name, place in mechanism.others:
        word, sentence = _OTHERS[kind]
        yield Refusal(word, _named(kind, name), sentence, place)
