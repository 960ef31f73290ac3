"""A mechanism as plain data: the numbers that MuJoCo compiles from a model file, in its order and units (m, kg, s,
rad).

Indices refer to the tuples of :class:`Mechanism`.  Body 0 is the world.  Quaternions have the real part first.  Every
number is exactly the one that MuJoCo uses.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from stc.records import dataclass

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Range = tuple[float, float]

#: Coordinates and degrees of freedom by kind of joint.
COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
FREEDOMS = {"hinge": 1, "slide": 1, "ball": 3, "free": 6}


@dataclass(frozen=True, slots=True)
class Place:
    """The position of an element in the model file or an included file; lines count from 1."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body.

    Attributes:
        name: as in the model; one without a name is called ``body`` and its index.
        parent: its parent body; 0 for the world, also for the world itself.
        pos, quat: its frame in its parent's, where its joints are at their reference.
        mass, com, inertia_quat, inertia: kg; the centre of mass in the body's frame; the principal axes there, and the
            moments about them, kg m^2.
        gravcomp: the share of its weight that is compensated.
        mocap: whether it is moved from outside.
        joints: its joints, in their order.
    """

    name: str
    parent: int
    pos: Triple
    quat: Quaternion
    mass: float
    com: Triple
    inertia_quat: Quaternion
    inertia: Triple
    gravcomp: float
    mocap: bool
    joints: tuple[int, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint, which lets its body move relative to its parent.

    Attributes:
        name: as in the model; one without a name is called by its body.
        kind: ``hinge``, ``slide``, ``ball`` or ``free``.
        qpos, dof: addresses of its first coordinate and of its first velocity.
        axis, anchor: direction and place in the body's frame.
        bounds: of the coordinate where ``limited`` (of a ball: the angle, from 0).
        margin: the distance from an end of the bounds at which the stop begins to push.
        reference: the coordinates in the pose that the file draws (``qpos0``).
        spring_reference: the coordinates at which its spring is at rest (``qpos_spring``).
        stiffness, stiffness_poly: N/m or N m/rad; the force at a deflection x is -x (k + p0 x + p1 x^2).
        spring_yield: the deflection from which the spring gives way for good; 0 for never.
        damping, damping_poly: of each degree of freedom; the force is -v (d + p0 abs(v) + p1 v^2).
        armature: inertia of the drive, kg or kg m^2, of each degree of freedom.
        frictionloss: the bound of dry friction, N or N m, of each degree of freedom.
        friction_damping, friction_softness: dry friction is -(a + damping v)/softness at an acceleration a and a
            velocity v, up to its bound, in 1/s and 1/kg or 1/(kg m^2) of each degree of freedom.
        force_limited, force_range: the bound of the actuators' sum.
        gravcomp_by_actuators: whether the compensation of weight counts as an actuator's force.
    """

    name: str
    kind: str
    body: int
    qpos: int
    dof: int
    axis: Triple
    anchor: Triple
    limited: bool
    bounds: Range
    margin: float
    reference: tuple[float, ...]
    spring_reference: tuple[float, ...]
    stiffness: float
    stiffness_poly: tuple[float, ...]
    spring_yield: float
    damping: float
    damping_poly: tuple[float, ...]
    armature: float
    frictionloss: float
    friction_damping: float
    friction_softness: tuple[float, ...]
    force_limited: bool
    force_range: Range
    gravcomp_by_actuators: bool
    place: Place | None = None

    @property
    def dofs(self) -> range:
        """The addresses of its velocities."""
        return range(self.dof, self.dof + FREEDOMS[self.kind])

    @property
    def coordinates(self) -> range:
        """The addresses of its coordinates."""
        return range(self.qpos, self.qpos + COORDINATES[self.kind])


@dataclass(frozen=True, slots=True)
class Geom:
    """A shape fixed in a body.

    Attributes:
        name: as in the model, possibly empty.
        kind: ``plane``, ``sphere``, ``capsule``, ``ellipsoid``, ``cylinder``, ``box``, ``mesh``, ``hfield`` or ``sdf``.
        size: MuJoCo's: radii and half lengths.
        friction: sliding, torsional and rolling.
        contype, conaffinity: two geoms may touch if a bit of one's type is in the other's affinity.
        fluid: the coefficients of the ellipsoid model of fluid forces, in MuJoCo's order; empty where that is off.
        adhesion: N; surface_velocity: linear and angular, of a conveyor's surface.
        solref: how stiff its contacts are: a time in s and a ratio of damping, or two negative numbers.
        corners: of a mesh that may touch something, those of its convex hull, in its own frame.
    """

    name: str
    body: int
    kind: str
    size: Triple
    pos: Triple
    quat: Quaternion
    friction: Triple
    contype: int
    conaffinity: int
    condim: int
    priority: int
    solmix: float
    margin: float
    gap: float
    fluid: tuple[float, ...]
    adhesion: float
    surface_velocity: tuple[float, ...]
    solref: tuple[float, float] = (0.02, 1.0)
    corners: tuple[Triple, ...] = ()
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Site:
    """A named frame fixed in a body."""

    name: str
    body: int
    kind: str
    size: Triple
    pos: Triple
    quat: Quaternion
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Step:
    """One element of a tendon's path.

    Attributes:
        kind: ``joint``, ``site``, ``pulley``, ``sphere`` or ``cylinder``.
        index: of the joint, site or geom.
        parameter: a joint's coefficient, a pulley's divisor, a geom's side site.
    """

    kind: str
    index: int
    parameter: float


@dataclass(frozen=True, slots=True)
class Tendon:
    """A length that depends on joints (``fixed``) or on places (``spatial``), and the forces along it.

    Attributes:
        reference: its length in the pose that the file draws.
        margin: the distance from an end of the bounds at which its limit begins to pull.
        spring_range: lengths between which its spring is at rest.
        stiffness, stiffness_poly, damping, damping_poly, spring_yield, armature, frictionloss: like a joint's.
        force_limited, force_range: the bound of its actuators' sum.
    """

    name: str
    kind: str
    path: tuple[Step, ...]
    reference: float
    limited: bool
    bounds: Range
    margin: float
    spring_range: Range
    stiffness: float
    stiffness_poly: tuple[float, ...]
    spring_yield: float
    damping: float
    damping_poly: tuple[float, ...]
    armature: float
    frictionloss: float
    force_limited: bool
    force_range: Range
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Actuator:
    """A force that a control commands: gain * input + bias along a transmission.

    Attributes:
        name: as in the model; an actuator without a name is called after its target.
        transmission: ``joint``, ``jointinparent``, ``tendon``, ``site``, ``body``, ``slidercrank`` or ``so3``.
        target, reference: its target, and a second site; -1 for none.
        gear: force and torque, or the first number alone, per unit of its force.
        gain, gain_parameters: ``fixed``, ``affine``, ...; bias, bias_parameters: ``none``, ``affine``, ...
        dynamics, dynamics_parameters: ``none``, or how its activation follows its control.
        controls, activations: addresses among all controls and all activations.
        inputs: the controls of a controller or an electric motor: ``pos``, ``vel``, ``ff``, ``voltage``.
        control_ranges: of each control, None for one that is not limited.
        force_limited, force_range: of its force; activation_limited, activation_range: of its activations.
        early: whether MuJoCo steps the activation before it takes the force, which matters at finite time steps only.
        armature, damping, damping_poly: of the drive, before the gear.
        enabled: False where the model's options switch its group off.
        plugin: whether a plugin computes its force.
    """

    name: str
    transmission: str
    target: int
    reference: int
    gear: tuple[float, ...]
    gain: str
    gain_parameters: tuple[float, ...]
    bias: str
    bias_parameters: tuple[float, ...]
    dynamics: str
    dynamics_parameters: tuple[float, ...]
    controls: range
    activations: range
    inputs: tuple[str, ...]
    control_ranges: tuple[Range | None, ...]
    force_limited: bool
    force_range: Range
    activation_limited: bool
    activation_range: Range
    early: bool
    delay: float
    armature: float
    damping: float
    damping_poly: tuple[float, ...]
    crank_length: float
    enabled: bool
    plugin: bool
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Equality:
    """An equality constraint.

    Attributes:
        kind: ``connect``, ``weld``, ``joint``, ``tendon`` or what MuJoCo calls another one.
        between: ``body``, ``site``, ``joint`` or ``tendon``: the kind of object that the two indices refer to.
        first, second: the two things; -1 for no second one.
        data: MuJoCo's numbers (``eq_data``).
        active: whether it holds at the start.
    """

    name: str
    kind: str
    between: str
    first: int
    second: int
    data: tuple[float, ...]
    active: bool
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A named state of the model."""

    name: str
    time: float
    qpos: tuple[float, ...]
    qvel: tuple[float, ...]
    activations: tuple[float, ...]
    controls: tuple[float, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Pair:
    """A pair of geoms with its own parameters of contact; ``friction`` is two sliding, one torsional, two rolling."""

    first: int
    second: int
    friction: tuple[float, ...]
    condim: int
    margin: float
    gap: float


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the whole model; ``disabled`` and ``enabled`` are MuJoCo's flags in lower case."""

    gravity: Triple
    wind: Triple
    density: float
    viscosity: float
    timestep: float
    integrator: str
    cone: str
    impratio: float
    disabled: frozenset[str]
    enabled: frozenset[str]
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class Mechanism:
    """A whole model, without the elements that its options switch off: see :mod:`stc.mechanism.switches`.

    Attributes:
        source: the file, or ``<text>``.
        n_coordinates, n_freedoms: lengths of ``qpos`` and ``qvel``.
        n_controls, n_activations: lengths of ``ctrl`` and ``act``.
        excluded: pairs of bodies that never touch.
        warnings: what MuJoCo said as it read the file, and what looks like a mistake in it.
        changes: what of a URDF is left out or changed to make a model of it, each in a sentence.
        left_out: kinds of things that are knowingly not in it; see :mod:`stc.mechanism.refusals`.
        others: elements that have no counterpart here, such as flexes and plugins: kind, name and place.
    """

    source: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    geoms: tuple[Geom, ...]
    sites: tuple[Site, ...]
    tendons: tuple[Tendon, ...]
    actuators: tuple[Actuator, ...]
    equalities: tuple[Equality, ...]
    keyframes: tuple[Keyframe, ...]
    pairs: tuple[Pair, ...]
    excluded: tuple[tuple[int, int], ...]
    options: Options
    n_coordinates: int
    n_freedoms: int
    n_controls: int
    n_activations: int
    others: tuple[tuple[str, str, Place | None], ...] = ()
    warnings: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    left_out: frozenset[str] = frozenset()

    @property
    def is_urdf(self) -> bool:
        """Whether it comes from a URDF, which states neither motors nor what it stands on."""
        return self.source.lower().endswith(".urdf")

    @property
    def start(self) -> tuple[float, ...]:
        """The coordinates in the pose of the file."""
        return tuple([value for joint in self.joints for value in joint.reference])

    def welded_to_mocap(self, equality: Equality) -> bool:
        """Whether a constraint welds a body to a mocap body, which stays where it is until a program moves it."""
        ends = (equality.first, equality.second)
        return (equality.kind, equality.between) == ("weld", "body") and any(
            self.bodies[body].mocap for body in ends
        )

    def below(self, body: int) -> list[int]:
        """A body and all its descendants, in ascending order."""
        found = {body}
        for index in range(body + 1, len(self.bodies)):
            if self.bodies[index].parent in found:
                found.add(index)
        return sorted(found)


_Named = TypeVar("_Named", Body, Joint, Geom, Site, Tendon, Actuator, Equality, Keyframe)


def index_of(things: Iterable[_Named], name: str) -> int | None:
    """The index of the element with a name, None if there is none."""
    return next((index for index, thing in enumerate(things) if thing.name == name), None)
