"""Numbers that can be set: as symbols of the expressions, and in the data."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mechanism_models import FREE, SLIDE, TERMS, chain, hinge
from mechanism_states import PARTS, Compared, dynamics_of, inverse, relative_error, symbols_of
from tape_reference import run

from stc.codegen.tape import build_tape
from stc.mechanism.numbers import DerivedNumber, ModelNumber, Numbers, all_of_them
from stc.mechanism.read import read_model
from stc.mechanism.settings import changed, settable
from stc.symbolic.expr import Expr, symbols
from stc.symbolic.structure import mentions
from stc.validate.fields import set_fields

ROBOT = chain(
    FREE.format("root", ""),
    hinge("a", more='damping=".3" armature=".1" stiffness="2" springref="20"'),
    SLIDE.format("b", 'damping=".2"'),
    rest='<actuator><motor name="m" joint="a" gear="3" armature=".1" damping=".2"/></actuator>',
    extra='<body name="load{0}" pos=".1 .2 0"><geom size=".1"/></body>',
).replace("load{0}", "load")


def robot() -> str:
    """The bodies that are fixed to others need names of their own."""
    text, count = ROBOT, 0
    while '"load"' in text:
        text, count = text.replace('"load"', f'"load{count}"', 1), count + 1
    return text


NEW = {
    ("body", "b1", "mass"): 3.3,
    ("body", "b2", "inertia", "x"): 0.07,
    ("body", "b0", "com", "y"): -0.04,
    ("body", "load1", "pos", "x"): 0.3,
    ("option", "gravity", "z"): -3.7,
    ("joint", "a", "damping"): 0.9,
    ("joint", "a", "armature"): 0.4,
    ("joint", "a", "stiffness"): 5.0,
    ("joint", "a", "springref"): -0.2,
    ("actuator", "m", "gear"): 7.0,
}


def evaluated(both: Compared, expressions: list[Expr], values: dict[object, float]) -> np.ndarray:
    keys = [e.payload for part in symbols_of(both.mechanism).values() for e in part]
    tape = build_tape(expressions, list(values), keys)
    inputs = np.array([np.concatenate([state[part] for part in PARTS]) for state in both.states]).T
    return run(tape, list(values.values()), inputs)


@pytest.mark.parametrize("new", [{}, NEW, *[{path: value} for path, value in NEW.items()]], ids=str)
def test_symbols_take_other_values(new: dict[tuple[str, ...], float]) -> None:
    """With the symbols at other values, the forces are those of a model that was set so."""
    both = Compared(robot(), states=50)
    numbers = Numbers(all_of_them)
    rows = dynamics_of(both.mechanism, numbers).inverse()
    values: dict[object, float] = {
        ModelNumber(path): new.get(path, value) for path, value in numbers.values.items()
    }
    assert {ModelNumber(path) for path in new} <= values.keys()
    values |= numbers.derived_values(values)
    set_fields(both.model, new)
    both.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    wanted = both.in_mujoco(inverse)
    assert relative_error(evaluated(both, rows, values), wanted) < 1e-10
    again = dynamics_of(changed(both.mechanism, new)).inverse()
    assert relative_error(both.values(again), wanted) < 1e-10


def test_derived_numbers_stand_for_formulas() -> None:
    """No formula of numbers is left in the rows but products with what moves; expanded, they are as before."""
    both = Compared(robot(), states=5)
    numbers = Numbers(all_of_them)
    rows = dynamics_of(both.mechanism, numbers).inverse()
    keys = {key for e in rows for key in symbols(e)}
    assert any(isinstance(key, DerivedNumber) for key in keys)
    mass = ModelNumber(("body", "load1", "mass"))
    assert mass not in keys
    expanded = numbers.expanded(rows, lambda key: key == mass)
    assert any(mentions(e, lambda key: key == mass) for e in expanded)
    values: dict[object, float] = {ModelNumber(path): value for path, value in numbers.values.items()}
    values |= numbers.derived_values(values)
    assert relative_error(evaluated(both, expanded, values), evaluated(both, rows, values)) < 1e-12


def test_zeros_are_no_symbols() -> None:
    """What is zero in the model is not in the expressions at all."""
    both = Compared(robot(), states=1)
    numbers = Numbers(all_of_them)
    dynamics_of(both.mechanism, numbers).inverse()
    assert all(numbers.values.values())
    assert ("joint", "b", "stiffness") not in numbers.values
    assert settable(both.mechanism)["joint", "b", "stiffness"] == 0.0


def test_some_numbers_are_symbols() -> None:
    """Only those that are chosen."""
    both = Compared(robot(), states=1)
    numbers = Numbers(lambda path: path[0] == "option")
    rows = dynamics_of(both.mechanism, numbers).inverse()
    assert set(numbers.values) == {("option", "gravity", "z")}
    assert not numbers.derived
    assert any(mentions(e, lambda key: key == ModelNumber(("option", "gravity", "z"))) for e in rows)


def test_settings() -> None:
    """Ranges limit the joint from then on; unknown paths are mistakes."""
    both = Compared(robot(), states=1)
    set_to = changed(both.mechanism, {("joint", "a", "upper"): 0.5})
    assert set_to.joints[1].limited
    assert set_to.joints[1].bounds[1] == 0.5
    assert changed(both.mechanism, {("body", "b0", "pos", "y"): 2.0}).bodies[1].pos[1] == 2.0
    assert changed(both.mechanism, {("joint", "root", "damping"): 2.0}).joints[0].damping == 2.0
    with pytest.raises(ValueError, match=r"body.b9.mass"):
        changed(both.mechanism, {("body", "b9", "mass"): 1.0})


def test_places_that_other_numbers_follow_cannot_be_set() -> None:
    """A connect of bodies is anchored where the file draws it; one of sites is where these are."""
    joined = '<equality><connect {0}="{1}0" {2}="{1}2"{3}/></equality></mujoco>'
    for tie, free in (
        (joined.format("body1", "b", "body2", ' anchor="0 0 0"'), False),
        (joined.format("site1", "s", "site2", ""), True),
    ):
        mechanism = read_model("m.xml", text=robot().replace("</mujoco>", tie))
        assert (("body", "b1", "pos", "x") in settable(mechanism)) == free
        assert ("body", "b1", "mass") in settable(mechanism)


@pytest.mark.parametrize("name", TERMS)
def test_symbols_change_no_values(name: str) -> None:
    """With all numbers as symbols at the model's values, the residual is what it is with numbers."""
    both = Compared(TERMS[name], states=5)
    numbers = Numbers(all_of_them)
    rows = dynamics_of(both.mechanism, numbers).residual()
    values: dict[object, float] = {ModelNumber(path): value for path, value in numbers.values.items()}
    values |= numbers.derived_values(values)
    assert relative_error(evaluated(both, rows, values), both.values(both.dynamics.residual())) < 1e-9
