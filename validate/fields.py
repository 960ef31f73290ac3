"""The model fields that a spec may set: ``set body.particle.mass = m;`` and its like.

=============================================  =============================================================
path                                           field, in MuJoCo's units
=============================================  =============================================================
``option.gravity.x`` (``.y``, ``.z``)          gravity, m/s^2
``option.wind.x`` (``.y``, ``.z``)             wind, m/s
``option.density``, ``option.viscosity``       of the surrounding medium
``option.impratio``                            friction against normal stiffness of contacts
``option.solref.time``                         time constant of every contact and equality, s, critically damped, with
                                               an impedance (solimp) of at least MuJoCo's default, 0.9 and 0.95,
                                               and of 0.999 and 0.9999 for equalities;
                                               the time step is half of it at most
``body.NAME.mass``                             mass, kg
``body.NAME.inertia.x`` (``.y``, ``.z``)       principal moments of inertia, kg m^2
``body.NAME.com.x`` (``.y``, ``.z``)           centre of mass in the body's frame, m
``body.NAME.pos.x`` (``.y``, ``.z``)           place in the parent's frame, m
``body.NAME.gravcomp``                         share of gravity that is compensated
``joint.NAME.damping``                         N s/m or N m s/rad, of all degrees of freedom
``joint.NAME.armature``                        added inertia, kg or kg m^2
``joint.NAME.frictionloss``                    dry friction, N or N m
``joint.NAME.stiffness``                       spring, N/m or N m/rad
``joint.NAME.springref``                       position where the spring is at rest, m or rad
``joint.NAME.lower``, ``joint.NAME.upper``     range, m or rad; it limits the joint from then on
``geom.NAME.friction.slide``                   friction coefficients of a geom
(``.spin``, ``.roll``)
``geom.NAME.pos.x``, ``site.NAME.pos.x``       place in the body's frame, m
(``.y``, ``.z``)
``actuator.NAME.gear``                         force of the actuator per unit of its control
=============================================  =============================================================

A line sets only this field.  In particular, a mass does not scale the body's inertia: if the body rotates, a spec that
sets the mass must set the inertia too.  Quantities that MuJoCo derives from the fields (subtree masses, reference
inertias) are recomputed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.solution import Solution
from stc.validate.model import ModelError, find_object, lines_of, nearest, single_number

if TYPE_CHECKING:
    import mujoco

#: MuJoCo's own impedance of contacts that begin to touch, and of those that are pressed together; and that of links.
#: With MuJoCo's own, the hand by which an arm of 30 kg hangs turns by 4e-4 rad, with this one by 4e-6.
_IMPEDANCE, _OF_LINKS = (0.9, 0.95), (0.999, 0.9999)

#: Where a range ends on a side that is not limited, m or rad.
NO_END = 1e6

_AXES = {"x": 0, "y": 1, "z": 2}
_FRICTION = {"slide": 0, "spin": 1, "roll": 2}

#: Per kind of object and field: which array holds it, which address the object has there, which components.
#: Addresses are functions of the model and the object's index; None stands for a field of one number.
Address = Callable[[Any, int], int | slice]


def _own(_: Any, index: int) -> int:
    return index


def _dofs(model: Any, index: int) -> slice:
    """All degrees of freedom of a joint."""
    freedoms = (6, 3, 1, 1)[model.jnt_type[index]]
    return slice(int(model.jnt_dofadr[index]), int(model.jnt_dofadr[index]) + freedoms)


def _qpos(model: Any, index: int) -> int:
    return int(model.jnt_qposadr[index])


_FIELDS: Mapping[str, Mapping[str, tuple[str, Address, Mapping[str, int] | int | None]]] = {
    "body": {
        "mass": ("body_mass", _own, None),
        "inertia": ("body_inertia", _own, _AXES),
        "com": ("body_ipos", _own, _AXES),
        "pos": ("body_pos", _own, _AXES),
        "gravcomp": ("body_gravcomp", _own, None),
    },
    "joint": {
        "damping": ("dof_damping", _dofs, None),
        "armature": ("dof_armature", _dofs, None),
        "frictionloss": ("dof_frictionloss", _dofs, None),
        "stiffness": ("jnt_stiffness", _own, None),
        "springref": ("qpos_spring", _qpos, None),
        "lower": ("jnt_range", _own, 0),
        "upper": ("jnt_range", _own, 1),
    },
    "geom": {"friction": ("geom_friction", _own, _FRICTION), "pos": ("geom_pos", _own, _AXES)},
    "site": {"pos": ("site_pos", _own, _AXES)},
    "actuator": {"gear": ("actuator_gear", _own, 0)},
}
_OPTIONS: Mapping[str, Mapping[str, int] | None] = {
    "gravity": _AXES,
    "wind": _AXES,
    "density": None,
    "viscosity": None,
    "impratio": None,
}


def apply_fields(model: mujoco.MjModel, solution: Solution) -> dict[str, float]:
    """Set the fields of the spec's ``set`` lines, and let MuJoCo recompute its constants.

    Returns:
        The values by path, for the report.

    Raises:
        ModelError: an unknown path, or a value that is not a single number.
    """
    values = {line.path: single_number(line) for line in lines_of(solution, "set")}
    set_fields(model, values)
    return {".".join(path): value for path, value in values.items()}


def set_fields(model: mujoco.MjModel, values: Mapping[tuple[str, ...], float]) -> None:
    """Set model fields by their paths, and let MuJoCo recompute its constants.

    Raises:
        ModelError: an unknown path, or values with which MuJoCo can derive none.
    """
    import mujoco

    for path, value in values.items():
        if path[0] == "option":
            _set_option(model, path, value)
        else:
            _set_field(model, path, value)
    try:
        mujoco.mj_setConst(model, mujoco.MjData(model))
    except mujoco.FatalError as error:
        given = ", ".join(f"{'.'.join(path)} = {value:g}" for path, value in values.items())
        raise ModelError(f"MuJoCo does not accept what is set in the model ({given}): {error}") from None


def _set_option(model: mujoco.MjModel, path: tuple[str, ...], value: float) -> None:
    written = "set " + ".".join(path)
    if path[1:] == ("solref", "time"):
        _set_stiffness(model, written, value)
        return
    if len(path) < 2 or path[1] not in _OPTIONS:
        known = [*_OPTIONS, "solref.time"]
        raise ModelError(f"{written}: no such option{nearest(path[1] if len(path) > 1 else '', known)}")
    component = _component(written, path[2:], _OPTIONS[path[1]])
    if component is None:
        setattr(model.opt, path[1], value)
    else:
        getattr(model.opt, path[1])[component] = value


def _set_stiffness(model: mujoco.MjModel, written: str, time: float) -> None:
    """Set the time constant of all contacts and equalities."""
    if not time > 0.0:
        raise ModelError(f"{written}: a time is above 0, and {time:g} is not")
    for solref, solimp, least in (
        (model.geom_solref, model.geom_solimp, _IMPEDANCE),
        (model.pair_solref, model.pair_solimp, _IMPEDANCE),
        (model.eq_solref, model.eq_solimp, _OF_LINKS),
    ):
        solref[:] = time, 1.0
        # A small impedance makes them soft whatever the time.
        solimp[:, :2] = np.maximum(solimp[:, :2], least)
    # MuJoCo makes no contact stiffer than two of its time steps allow.
    model.opt.timestep = min(model.opt.timestep, 0.5 * time)


def _set_field(model: mujoco.MjModel, path: tuple[str, ...], value: float) -> None:
    written = "set " + ".".join(path)
    if path[0] not in _FIELDS:
        raise ModelError(f"{written}: {path[0]} cannot be set{nearest(path[0], ['option', *_FIELDS])}")
    if len(path) < 3:
        raise ModelError(f"{written}: write {path[0]}.NAME.FIELD, as in body.lamp.mass")
    index = find_object(model, path[0], path[1], written)
    fields = _FIELDS[path[0]]
    if path[2] not in fields:
        raise ModelError(f"{written}: a {path[0]} has no field {path[2]}{nearest(path[2], list(fields))}")
    array_name, address, components = fields[path[2]]
    array = getattr(model, array_name)
    if isinstance(components, int):
        if len(path) > 3:
            raise ModelError(f"{written}: {path[2]} has no parts")
        at = address(model, index)
        if array_name == "jnt_range":
            _begin_to_limit(model, index)
        elif array[at, components + 1 :].any() and array[at, components] != value:
            raise ModelError(
                f"{written}: the model gives the {path[0]} a {path[2]} of several parts; this would set the first"
            )
        array[at, components] = value
        return
    component = _component(written, path[3:], components)
    if component is None:
        array[address(model, index)] = value
    else:
        array[address(model, index), component] = value


def _begin_to_limit(model: mujoco.MjModel, index: int) -> None:
    """Enable a joint's range; if the model has none, an end that is not set is far away."""
    if not model.jnt_limited[index]:
        model.jnt_limited[index] = 1
        if not model.jnt_range[index].any():
            model.jnt_range[index] = -NO_END, NO_END


def _component(written: str, rest: tuple[str, ...], components: Mapping[str, int] | None) -> int | None:
    """The index of a component by its name, None for a field of one number."""
    if components is None:
        if rest:
            raise ModelError(f"{written}: this field has no parts")
        return None
    if len(rest) != 1 or rest[0] not in components:
        raise ModelError(
            f"{written}: this field has several parts; end the path in .{', .'.join(components)}"
        )
    return components[rest[0]]
