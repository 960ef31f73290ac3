"""Read a model file, MJCF or URDF, with MuJoCo's own reader and compiler into plain data.

The result contains numbers only, and no objects of MuJoCo.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stc.errors import StcError
from stc.mechanism.mechanism import (
    COORDINATES,
    FREEDOMS,
    Actuator,
    Body,
    Equality,
    Geom,
    Joint,
    Keyframe,
    Mechanism,
    Options,
    Pair,
    Place,
    Site,
    Step,
    Tendon,
)
from stc.mechanism.places import Places
from stc.mechanism.switches import in_effect
from stc.model_source import opened

if TYPE_CHECKING:
    import mujoco


class ModelFileError(StcError):
    """A model cannot be read; the message includes MuJoCo's own."""


def read_model(
    source: str | os.PathLike[str], text: str | None = None, additions: Sequence[str] = ()
) -> Mechanism:
    """Read a model.

    Parameters
    ----------
    source
        The path of an MJCF or URDF file.
    text
        The content, where it is not to be read from the file; ``source`` then only names it in messages.
    additions
        What is added to it, in words of :data:`stc.model_source.ADDITIONS`.

    Raises
    ------
    ModelFileError
        MuJoCo does not accept it, or it is not there.
    """
    try:
        read = opened(source, additions, text)
    except (ValueError, OSError) as error:
        why = f"MuJoCo does not accept {os.fsdecode(source)}: {' '.join(str(error).split())}"
        raise ModelFileError(why) from None
    name = os.fsdecode(source)
    content = text if text is not None else Path(name).read_text(encoding="utf-8", errors="replace")
    reader = _Reader(read.model, read.spec, Places(name, content))
    return in_effect(reader.mechanism(name, read.told, read.changes))


def _floats(values: Any) -> tuple[Any, ...]:
    return tuple([float(value) for value in values])


class _Reader:
    """Reads a compiled model, and the description with the lines of its elements."""

    def __init__(self, model: mujoco.MjModel, spec: Any, places: Places) -> None:
        self.m = model
        self.spec = spec
        self.places = places

    def mechanism(self, source: str, told: tuple[str, ...], changes: tuple[str, ...]) -> Mechanism:
        m = self.m
        self.body_names = self._names("BODY", m.nbody, lambda i: "world" if i == 0 else f"body{i}")
        self.joint_names = self._names("JOINT", m.njnt, lambda i: self.body_names[m.jnt_bodyid[i]])
        self.body_places: list[Place | None] = [None] * m.nbody
        self.body_places = self._places("bodies", "body", m.body_parentid)
        self.tendon_names = self._names("TENDON", m.ntendon, lambda i: f"tendon{i + 1}")
        return Mechanism(
            source=source,
            bodies=self._bodies(),
            joints=(joints := self._joints()),
            geoms=self._geoms(),
            sites=self._sites(),
            tendons=self._tendons(),
            actuators=self._actuators(),
            equalities=self._equalities(),
            keyframes=self._keyframes(),
            pairs=tuple(
                [
                    Pair(
                        first=int(m.pair_geom1[i]),
                        second=int(m.pair_geom2[i]),
                        friction=_floats(m.pair_friction[i]),
                        condim=int(m.pair_dim[i]),
                        margin=float(m.pair_margin[i]),
                        gap=float(m.pair_gap[i]),
                    )
                    for i in range(m.npair)
                ]
            ),
            excluded=tuple(
                [(int(signature) >> 16, int(signature) & 0xFFFF) for signature in m.exclude_signature]
            ),
            options=self._options(),
            n_coordinates=int(m.nq),
            n_freedoms=int(m.nv),
            n_controls=int(m.nu),
            n_activations=int(m.na),
            others=self._others(),
            warnings=(*told, *self._small_ranges(joints)),
            changes=changes,
        )

    def _in_body(self, same: int, body: int, pos: Any, quat: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """A frame in a body as MuJoCo takes it: one that its compiler found to be the body's own, or that of the
        body's inertia, to within rounding of the file's numbers, is that one.
        """
        frames = _same_frames()
        if same in (frames["BODY"], frames["BODYROT"]):
            return (0.0, 0.0, 0.0) if same == frames["BODY"] else _floats(pos), (1.0, 0.0, 0.0, 0.0)
        if same in (frames["INERTIA"], frames["INERTIAROT"]):
            m = self.m
            own = self._in_body(m.body_sameframe[body], body, m.body_ipos[body], m.body_iquat[body])
            return own[0] if same == frames["INERTIA"] else _floats(pos), own[1]
        return _floats(pos), _floats(quat)

    def _name(self, kind: str, index: int) -> str:
        import mujoco

        return mujoco.mj_id2name(self.m, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), index) or ""

    def _names(self, kind: str, count: int, called: Callable[[int], str]) -> list[str]:
        """Names of all elements of a kind; an element without one gets a default name, numbered if that is taken."""
        names = [self._name(kind, index) for index in range(count)]
        taken = set(names)
        for index, name in enumerate(names):
            if not name:
                wanted = called(index)
                free, number = wanted, 1
                while free in taken:
                    number += 1
                    free = f"{wanted}_{number}"
                names[index] = free
                taken.add(free)
        return names

    def _places(self, elements: str, tag: str, bodies: Sequence[int]) -> list[Place | None]:
        """The places of elements, of which each belongs to one of the bodies (0, the world, for those to none)."""
        found: list[Place | None] = [None] * len(bodies)
        for element in getattr(self.spec, elements):
            if 0 <= element.id < len(bodies):
                body = bodies[element.id]
                owner = self.body_places[body] if body else None
                found[element.id] = self.places.of(element.info, tag, element.name, owner)
        return found

    def _small_ranges(self, joints: Sequence[Joint]) -> Iterator[str]:
        """A doubt, if all ranges of hinges would be less than a turn in rad, and are stated in degrees."""
        ranges = [joint for joint in joints if joint.kind == "hinge" and joint.limited]
        if (
            ranges
            and self.spec.compiler.degree
            and all(max(map(abs, joint.bounds)) <= math.radians(2.0 * math.pi) for joint in ranges)
        ):
            low, high = map(math.degrees, ranges[0].bounds)
            yield (
                f"no hinge has a range beyond 6.28 degrees; that of {ranges[0].name} is {low:.3g} to {high:.3g}: if "
                'the file means rad, it needs `<compiler angle="radian"/>`'
            )

    def _bodies(self) -> tuple[Body, ...]:
        m = self.m
        places = self.body_places
        return tuple(
            [
                Body(
                    name=self.body_names[i],
                    parent=int(m.body_parentid[i]),
                    pos=_floats(m.body_pos[i]),
                    quat=_floats(m.body_quat[i]),
                    mass=float(m.body_mass[i]),
                    com=self._in_body(m.body_sameframe[i], i, m.body_ipos[i], m.body_iquat[i])[0],
                    inertia_quat=self._in_body(m.body_sameframe[i], i, m.body_ipos[i], m.body_iquat[i])[1],
                    inertia=_floats(m.body_inertia[i]),
                    gravcomp=float(m.body_gravcomp[i]),
                    mocap=int(m.body_mocapid[i]) >= 0,
                    joints=tuple(range(m.body_jntadr[i], m.body_jntadr[i] + m.body_jntnum[i]))
                    if m.body_jntnum[i]
                    else (),
                    place=places[i],
                )
                for i in range(m.nbody)
            ]
        )

    def _joints(self) -> tuple[Joint, ...]:
        m = self.m
        places = self._places("joints", "joint", m.jnt_bodyid)
        kinds = ("free", "ball", "slide", "hinge")
        joints = []
        for i in range(m.njnt):
            kind = kinds[m.jnt_type[i]]
            q, d = int(m.jnt_qposadr[i]), int(m.jnt_dofadr[i])
            coordinates = slice(q, q + COORDINATES[kind])
            damping, softness = self._softness(m.dof_solref[d], m.dof_solimp[d])
            freedoms = slice(d, d + FREEDOMS[kind])
            joints.append(
                Joint(
                    name=self.joint_names[i],
                    kind=kind,
                    body=int(m.jnt_bodyid[i]),
                    qpos=q,
                    dof=d,
                    axis=_floats(m.jnt_axis[i]),
                    anchor=_floats(m.jnt_pos[i]),
                    limited=bool(m.jnt_limited[i]),
                    bounds=_floats(m.jnt_range[i]),
                    margin=float(m.jnt_margin[i]),
                    reference=_floats(m.qpos0[coordinates]),
                    spring_reference=_floats(m.qpos_spring[coordinates]),
                    stiffness=float(m.jnt_stiffness[i]),
                    stiffness_poly=_floats(m.jnt_stiffnesspoly[i]),
                    spring_yield=float(m.jnt_springyield[i]),
                    damping=float(m.dof_damping[d]),
                    damping_poly=_floats(m.dof_dampingpoly[d]),
                    armature=float(m.dof_armature[d]),
                    frictionloss=float(m.dof_frictionloss[d]),
                    friction_damping=damping,
                    friction_softness=tuple([softness * float(w) for w in m.dof_invweight0[freedoms]]),
                    force_limited=bool(m.jnt_actfrclimited[i]),
                    force_range=_floats(m.jnt_actfrcrange[i]),
                    gravcomp_by_actuators=bool(m.jnt_actgravcomp[i]),
                    place=places[i],
                )
            )
        return tuple(joints)

    def _softness(self, solref: Sequence[float], solimp: Sequence[float]) -> tuple[float, float]:
        """The compliance of MuJoCo's dry friction: the damping of slip, 1/s, and the softness for an inertia of 1."""
        import mujoco

        least, most = [min(max(float(d), mujoco.mjMINIMP), mujoco.mjMAXIMP) for d in solimp[:2]]
        time, ratio = [float(part) for part in solref]
        if time <= 0.0:
            return -ratio / most, 1.0 / least - 1.0
        safe = not self.m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
        time = max(time, 2.0 * float(self.m.opt.timestep)) if safe else time
        return 2.0 / (most * time), 1.0 / least - 1.0

    def _geoms(self) -> tuple[Geom, ...]:
        m = self.m
        places = self._places("geoms", "geom", m.geom_bodyid)
        return tuple(
            [
                Geom(
                    name=self._name("GEOM", i),
                    body=int(m.geom_bodyid[i]),
                    kind=_member("mjtGeom", "mjGEOM_", m.geom_type[i]),
                    size=_floats(m.geom_size[i]),
                    pos=self._in_body(m.geom_sameframe[i], m.geom_bodyid[i], m.geom_pos[i], m.geom_quat[i])[
                        0
                    ],
                    quat=self._in_body(m.geom_sameframe[i], m.geom_bodyid[i], m.geom_pos[i], m.geom_quat[i])[
                        1
                    ],
                    friction=_floats(m.geom_friction[i]),
                    contype=int(m.geom_contype[i]),
                    conaffinity=int(m.geom_conaffinity[i]),
                    condim=int(m.geom_condim[i]),
                    priority=int(m.geom_priority[i]),
                    solmix=float(m.geom_solmix[i]),
                    margin=float(m.geom_margin[i]),
                    gap=float(m.geom_gap[i]),
                    fluid=_floats(m.geom_fluid[i]) if m.geom_fluid[i][0] > 0 else (),
                    adhesion=float(m.geom_adhesion[i]),
                    surface_velocity=_floats(m.geom_surfacevel[i]),
                    solref=_floats(m.geom_solref[i]),
                    corners=self._corners(i),
                    place=places[i],
                )
                for i in range(m.ngeom)
            ]
        )

    def _corners(self, geom: int) -> tuple[Any, ...]:
        """The corners of the convex hull of a mesh, which is what MuJoCo lets touch; none of what touches nothing."""
        m, mesh = self.m, int(self.m.geom_dataid[geom])
        touches = m.geom_contype[geom] or m.geom_conaffinity[geom]
        if _member("mjtGeom", "mjGEOM_", m.geom_type[geom]) != "mesh" or not touches or mesh < 0:
            return ()
        first, count, graph = m.mesh_vertadr[mesh], m.mesh_vertnum[mesh], m.mesh_graphadr[mesh]
        vertices = m.mesh_vert[first : first + count]
        if (
            graph >= 0
        ):  # the numbers of the hull's vertices and faces, where each one's edges begin, and which they are
            corners = int(m.mesh_graph[graph])
            vertices = vertices[m.mesh_graph[graph + 2 + corners : graph + 2 + 2 * corners]]
        return tuple([_floats(vertex) for vertex in vertices])

    def _sites(self) -> tuple[Site, ...]:
        m = self.m
        places = self._places("sites", "site", m.site_bodyid)
        return tuple(
            [
                Site(
                    name=self._name("SITE", i),
                    body=int(m.site_bodyid[i]),
                    kind=_member("mjtGeom", "mjGEOM_", m.site_type[i]),
                    size=_floats(m.site_size[i]),
                    pos=self._in_body(m.site_sameframe[i], m.site_bodyid[i], m.site_pos[i], m.site_quat[i])[
                        0
                    ],
                    quat=self._in_body(m.site_sameframe[i], m.site_bodyid[i], m.site_pos[i], m.site_quat[i])[
                        1
                    ],
                    place=places[i],
                )
                for i in range(m.nsite)
            ]
        )

    def _tendons(self) -> tuple[Tendon, ...]:
        m = self.m
        places = self._places("tendons", "tendon", [0] * m.ntendon)
        tendons = []
        for i in range(m.ntendon):
            steps = range(m.tendon_adr[i], m.tendon_adr[i] + m.tendon_num[i])
            path = [
                Step(
                    kind=_member("mjtWrap", "mjWRAP_", m.wrap_type[k]),
                    index=int(m.wrap_objid[k]),
                    parameter=float(m.wrap_prm[k]),
                )
                for k in steps
            ]
            tendons.append(
                Tendon(
                    name=self.tendon_names[i],
                    kind="fixed" if path and path[0].kind == "joint" else "spatial",
                    path=tuple(path),
                    reference=float(m.tendon_length0[i]),
                    limited=bool(m.tendon_limited[i]),
                    bounds=_floats(m.tendon_range[i]),
                    margin=float(m.tendon_margin[i]),
                    spring_range=_floats(m.tendon_lengthspring[i]),
                    stiffness=float(m.tendon_stiffness[i]),
                    stiffness_poly=_floats(m.tendon_stiffnesspoly[i]),
                    spring_yield=float(m.tendon_springyield[i]),
                    damping=float(m.tendon_damping[i]),
                    damping_poly=_floats(m.tendon_dampingpoly[i]),
                    armature=float(m.tendon_armature[i]),
                    frictionloss=float(m.tendon_frictionloss[i]),
                    force_limited=bool(m.tendon_actfrclimited[i]),
                    force_range=_floats(m.tendon_actfrcrange[i]),
                    place=places[i],
                )
            )
        return tuple(tendons)

    def _actuators(self) -> tuple[Actuator, ...]:
        m = self.m
        places = self._places("actuators", "actuator", [0] * m.nactuator)
        names = self._names("ACTUATOR", m.nactuator, self._acts_on)
        actuators = []
        for i in range(m.nactuator):
            u, out, act = int(m.actuator_ctrladr[i]), int(m.actuator_outadr[i]), int(m.actuator_actadr[i])
            controls = range(u, u + int(m.actuator_ctrlnum[i]))
            group = int(m.actuator_group[i])
            actuators.append(
                Actuator(
                    name=names[i],
                    transmission=_member("mjtTrn", "mjTRN_", m.actuator_trntype[i]),
                    target=int(m.actuator_trnid[i][0]),
                    reference=int(m.actuator_trnid[i][1]),
                    gear=_floats(m.actuator_gear[out]),
                    gain=_member("mjtGain", "mjGAIN_", m.actuator_gaintype[i]),
                    gain_parameters=_floats(m.actuator_gainprm[i]),
                    bias=_member("mjtBias", "mjBIAS_", m.actuator_biastype[i]),
                    bias_parameters=_floats(m.actuator_biasprm[i]),
                    dynamics=_member("mjtDyn", "mjDYN_", m.actuator_dyntype[i]),
                    dynamics_parameters=_floats(m.actuator_dynprm[i]),
                    controls=controls,
                    activations=range(act, act + int(m.actuator_actnum[i])) if act >= 0 else range(0),
                    inputs=self._inputs(i),
                    control_ranges=tuple(
                        [
                            _floats(m.actuator_ctrlrange[k]) if m.actuator_ctrllimited[k] else None
                            for k in controls
                        ]
                    ),
                    force_limited=bool(m.actuator_forcelimited[i]),
                    force_range=_floats(m.actuator_forcerange[i]),
                    activation_limited=bool(m.actuator_actlimited[i]),
                    activation_range=_floats(m.actuator_actrange[i]),
                    early=bool(m.actuator_actearly[i]),
                    delay=float(m.actuator_delay[i]),
                    armature=float(m.actuator_armature[i]),
                    damping=float(m.actuator_damping[i]),
                    damping_poly=_floats(m.actuator_dampingpoly[i]),
                    crank_length=float(m.actuator_cranklength[i]),
                    enabled=not (0 <= group < 31 and int(m.opt.disableactuator) >> group & 1),
                    plugin=int(m.actuator_plugin[i]) >= 0,
                    place=places[i],
                )
            )
        return tuple(actuators)

    def _inputs(self, actuator: int) -> tuple[str, ...]:
        """The names of the controls of a controller or an electric motor."""
        import mujoco

        if _member("mjtGain", "mjGAIN_", self.m.actuator_gaintype[actuator]) not in ("pid", "dcmotor"):
            return ()
        members = mujoco.mjtCtrlInput.__members__.items()
        given = int(self.m.actuator_ctrlspec[actuator])
        named = {int(bit): name.removeprefix("mjINPUT_").lower() for name, bit in members if given & int(bit)}
        return tuple([named[bit] for bit in sorted(named) if named[bit] != "none"])

    def _acts_on(self, actuator: int) -> str:
        """The name of an unnamed actuator."""
        m = self.m
        kind = _member("mjtTrn", "mjTRN_", m.actuator_trntype[actuator])
        target = int(m.actuator_trnid[actuator][0])
        if kind in ("joint", "jointinparent"):
            return self.joint_names[target]
        if kind == "tendon":
            return self.tendon_names[target]
        if kind in ("site", "slidercrank"):
            return self._name("SITE", target) or f"actuator{actuator + 1}"
        return f"actuator{actuator + 1}"

    def _equalities(self) -> tuple[Equality, ...]:
        m = self.m
        places = self._places("equalities", "equality", [0] * m.neq)
        kinds = [_member("mjtEq", "mjEQ_", kind) for kind in m.eq_type]
        names = self._names("EQUALITY", m.neq, lambda i: kinds[i])
        return tuple(
            [
                Equality(
                    name=names[i],
                    kind=kinds[i],
                    between=kinds[i]
                    if kinds[i] in ("joint", "tendon")
                    else _member("mjtObj", "mjOBJ_", m.eq_objtype[i]),
                    first=int(m.eq_obj1id[i]),
                    second=int(m.eq_obj2id[i]),
                    data=_floats(m.eq_data[i]),
                    active=bool(m.eq_active0[i]),
                    place=places[i],
                )
                for i in range(m.neq)
            ]
        )

    def _keyframes(self) -> tuple[Keyframe, ...]:
        m = self.m
        places = self._places("keys", "key", [0] * m.nkey)
        names = self._names("KEY", m.nkey, lambda i: f"keyframe{i + 1}")
        return tuple(
            [
                Keyframe(
                    name=names[i],
                    time=float(m.key_time[i]),
                    qpos=_floats(m.key_qpos[i]),
                    qvel=_floats(m.key_qvel[i]),
                    activations=_floats(m.key_act[i]),
                    controls=_floats(m.key_ctrl[i]),
                    place=places[i],
                )
                for i in range(m.nkey)
            ]
        )

    def _options(self) -> Options:
        import mujoco

        opt = self.m.opt
        return Options(
            gravity=_floats(opt.gravity),
            wind=_floats(opt.wind),
            density=float(opt.density),
            viscosity=float(opt.viscosity),
            timestep=float(opt.timestep),
            integrator=_member("mjtIntegrator", "mjINT_", opt.integrator),
            cone=_member("mjtCone", "mjCONE_", opt.cone),
            impratio=float(opt.impratio),
            disabled=_flags(mujoco.mjtDisableBit, "mjDSBL_", opt.disableflags),
            enabled=_flags(mujoco.mjtEnableBit, "mjENBL_", opt.enableflags),
            place=self.places.first("option"),
        )

    def _others(self) -> tuple[tuple[str, str, Place | None], ...]:
        """Flexes, and plugins that can exert forces by themselves."""
        m, found = self.m, list[tuple[str, str, Place | None]]()
        for element in list(self.spec.flexes)[: m.nflex]:
            place = self.places.of(element.info, "flex", element.name)
            found.append(("flex", element.name, place or self.places.first("flexcomp")))
        harmless = {int(k) for each in (m.geom_plugin, m.sensor_plugin, m.actuator_plugin) for k in each}
        bodies = {int(instance): body for body, instance in enumerate(m.body_plugin)}
        for instance in range(m.nplugin):
            body = bodies.get(instance)
            if body is not None:
                found.append(("plugin", f"of {self.body_names[body]}", self.body_places[body]))
            elif instance not in harmless:
                found.append(("plugin", self._name("PLUGIN", instance), self.places.first("instance")))
        return tuple(found)


def _same_frames() -> dict[str, int]:
    """MuJoCo's numbers for frames that are the same as others."""
    import mujoco

    members = mujoco.mjtSameFrame.__members__.items()
    return {name.removeprefix("mjSAMEFRAME_"): int(member) for name, member in members}


def _flags(enumeration: Any, prefix: str, bits: int) -> frozenset[str]:
    return frozenset(
        name.removeprefix(prefix).lower()
        for name, member in enumeration.__members__.items()
        if name.startswith(prefix) and int(bits) & int(member)
    )


_members: dict[tuple[str, int], str] = {}


def _member(enumeration: str, prefix: str, value: Any) -> str:
    """MuJoCo's name of a value of an enumeration, in lower case and without its prefix."""
    key = (enumeration, int(value))
    if key not in _members:
        import mujoco

        members: Sequence[tuple[str, Any]] = list(getattr(mujoco, enumeration).__members__.items())
        _members[key] = next(
            (name.removeprefix(prefix).lower() for name, member in members if int(member) == int(value)),
            str(int(value)),
        )
    return _members[key]
