"""What cannot be stated is named, with its line, and can be left out by a word."""

from __future__ import annotations

from pathlib import Path

import pytest
from mechanism_states import dynamics_of

from stc.mechanism.read import read_model
from stc.mechanism.refusals import KINDS, refusals, without

BODY = '<body name="b"><joint name="j"/><geom name="g" size=".1"/><site name="s"/></body>'
WORLD = f'<site name="w" pos="1 0 0"/><geom name="pole" type="cylinder" size=".1 1" pos=".5 0 0"/>{BODY}'


def model(rest: str = "", world: str = WORLD, options: str = "") -> str:
    return f"<mujoco>\n{options}\n<worldbody>\n{world}\n</worldbody>\n{rest}\n</mujoco>"


def acting(actuator: str) -> str:
    return model(f"<actuator>{actuator}</actuator>")


def with_attribute(name: str, attributes: str) -> str:
    return model(world=WORLD.replace(f'name="{name}"', f'name="{name}" {attributes}'))


#: Of each kind a model, the element that is named, and a piece of its line.
REFUSED = {
    "muscles": (acting('<muscle name="m" joint="j" lengthrange="0 1"/>'), 'actuator "m"', "muscle"),
    "actuators": (
        acting('<pid name="m" joint="j" kp="1" slewmax="2"/>'),
        'actuator "m"',
        "slewmax",
    ),
    "wrapping": (
        model(
            '<tendon><spatial name="t"><site site="w"/><geom geom="pole"/><site site="s"/></spatial></tendon>'
        ),
        'tendon "t"',
        "spatial",
    ),
    "adhesion": (acting('<adhesion name="m" body="b" ctrlrange="0 1"/>'), 'actuator "m"', "adhesion"),
    "yielding": (with_attribute("j", 'stiffness="3" springyield=".1"'), 'joint "j"', 'name="j"'),
    "branches": (
        model(
            '<tendon>\n<fixed name="t" armature="1"><joint joint="j" coef="1"/><joint joint="k" coef="1"/></fixed>\n'
            "</tendon>",
            world=WORLD
            + BODY.replace('"b"', '"c"').replace('"j"', '"k"').replace('"g"', '"h"').replace('"s"', '"v"'),
        ),
        'tendon "t"',
        "armature",
    ),
    "delays": (acting('<motor name="m" joint="j" delay=".1" nsample="4"/>'), 'actuator "m"', "delay"),
    "conveyors": (with_attribute("pole", 'surfacevel="1 0 0 0 0 0"'), 'geom "pole"', "surfacevel"),
    "flexes": (
        model(
            world=WORLD
            + '\n<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" mass="1"/>'
        ),
        'flex "cloth"',
        "flexcomp",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_is_refused(kind: str) -> None:
    """It is named with its line; a word leaves it out, and then there are equations."""
    text, element, line = REFUSED[kind]
    read = read_model("robot.xml", text=text)
    found = refusals(read)
    assert {refusal.kind for refusal in found} == {kind}
    first = found[0]
    assert first.element == element
    assert first.place is not None
    assert line in text.splitlines()[first.place.line - 1]
    assert str(first).startswith(f"robot.xml:{first.place.line}: {element}: ")
    left = without(read, [kind])
    assert refusals(left) == []
    assert left.left_out == {kind}
    assert len(dynamics_of(left).residual()) == read.n_freedoms


def test_what_is_refused_in_other_files_has_its_line_there(tmp_path: Path) -> None:
    """Elements of included files with and without names, and of a model whose part is attached; defaults are none."""
    muscle = '<muscle joint="j" lengthrange="0 1"/>'
    (tmp_path / "drives.xml").write_text(
        f"<mujocoinclude><default><default class='c'>\n<muscle force='3'/></default></default>\n<actuator>\n"
        f"<motor joint='j'/>\n{muscle}\n{muscle}\n</actuator></mujocoinclude>"
    )
    (tmp_path / "hand.xml").write_text(
        f"<mujoco>\n<worldbody>{BODY}</worldbody><actuator>\n"
        '<muscle name="flexor" joint="j" lengthrange="0 1"/></actuator></mujoco>'
    )
    (tmp_path / "robot.xml").write_text(
        '<mujoco><include file="drives.xml"/><asset><model name="hand" file="hand.xml"/></asset>\n'
        f'<worldbody>{BODY}\n<attach model="hand" body="b" prefix="L_"/></worldbody>\n'
        f"<actuator>{muscle}</actuator></mujoco>"
    )
    found = {refusal.element: refusal.place for refusal in refusals(read_model(tmp_path / "robot.xml"))}
    lines = {name: (Path(place.file).name, place.line) for name, place in found.items() if place is not None}
    assert lines == {
        'actuator "j_2"': ("drives.xml", 5),
        'actuator "j_3"': ("drives.xml", 6),
        'actuator "j_4"': ("robot.xml", 4),
        'actuator "L_flexor"': ("hand.xml", 3),
    }


def test_words_are_known() -> None:
    """A word that stands for nothing is a mistake, and the message lists those that do."""
    with pytest.raises(ValueError, match="fluid, muscles"):
        without(read_model("robot.xml", text=model()), ["fluids"])
    assert set(REFUSED) <= set(KINDS)


def test_a_tendon_along_one_branch_may_have_armature() -> None:
    """Also where it begins in the world and passes several bodies."""
    inner = BODY.replace('"b"', '"c"').replace('"j"', '"k"').replace('"g"', '"h"').replace('"s"', '"v"')
    text = model(
        '<tendon><spatial name="t" armature="1"><site site="w"/><site site="s"/><site site="v"/></spatial></tendon>',
        world=WORLD.replace("</body>", f"{inner}</body>"),
    )
    assert refusals(read_model("robot.xml", text=text)) == []


@pytest.mark.parametrize(
    ("flags", "rest"),
    [
        (
            '<option><flag actuation="disable"/></option>',
            '<actuator><muscle joint="j" lengthrange="0 1"/></actuator>',
        ),
    ],
)
def test_what_flags_switch_off_is_not_refused(flags: str, rest: str) -> None:
    """Without springs and dampers MuJoCo has no passive forces at all, those of a medium among them."""
    assert refusals(read_model("robot.xml", text=model(rest, options=flags))) == []


def test_what_is_off_is_not_refused() -> None:
    """An actuator that the model's options switch off stands in nobody's way."""
    text = model(
        '<actuator><muscle name="m" joint="j" lengthrange="0 1" group="3"/></actuator>',
        options='<option actuatorgroupdisable="3"/>',
    )
    assert refusals(read_model("robot.xml", text=text)) == []


def test_constraints_of_flexes_are_left_out_with_them() -> None:
    grid = 'name="cloth" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1"'
    text = model(world=f'<flexcomp {grid}><edge equality="true"/></flexcomp>')
    read = read_model("<text>", text=text)
    assert [each.active for each in read.equalities] == [True]
    assert without(read, ["flexes"]).equalities == ()
