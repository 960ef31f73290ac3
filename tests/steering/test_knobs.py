"""The numbers of a spec that can be steered, and its text with other numbers: exact, comments and layout kept."""

import pytest

from stc.errors import Source, UsageError
from stc.pipeline import Model, read_source
from stc.steering.edits import Edit, edited, number
from stc.steering.knobs import find_knobs

TEXT = """# a ball is thrown
constants:
  n = 20, T = 1, h = T/n,  # frames
  g = 9.81,      # m/s^2
  D = 2*0.25;    # m, how far
variables: x, z, fx, fz;
constraints:
  [0, n]:  # Newton
    x'' = fx;   z'' = fz - g;
  [0]:   x; z; x'; z';
  [n/2]: z = 0.5;  # over the wall
         -0.25 <= x;
  [n]:   x = D; z; x'; z';
objective: [0, n]: integral(fx^2 + fz^2);
"""


def knobs_of(text):
    return find_knobs(Source("ball.stc", text))


def named(knobs, label):
    return next(name for name, knob in knobs.knobs.items() if knob.label == label)


def test_that_nothing_changes_where_nothing_is_turned():
    knobs = knobs_of(TEXT)
    assert knobs.written({}) == TEXT
    assert knobs.written({name: knob.value for name, knob in knobs.knobs.items()}) == TEXT


def test_a_constant_at_its_place_with_its_comment_where_it_was():
    assert knobs_of(TEXT).written({"g": 1.62}) == TEXT.replace(
        "g = 9.81,      # m/s^2", "g = 1.62,      # m/s^2"
    )
    assert knobs_of(TEXT).written({"g": -12.125}) == TEXT.replace(
        "g = 9.81,      # m/s^2", "g = -12.125,   # m/s^2"
    )


def test_an_expression_of_numbers_becomes_a_number():
    knobs = knobs_of(TEXT)
    assert knobs.knobs["D"].value == 0.5
    assert knobs.written({"D": 0.75}) == TEXT.replace("D = 2*0.25;    # m", "D = 0.75;      # m")


def test_a_constant_that_is_computed_is_told_of_and_not_written():
    knobs = knobs_of(TEXT)
    with pytest.raises(UsageError, match=r"`h` is computed, `T/n`: steer what it is made of"):
        knobs.written({"h": 0.1})
    with pytest.raises(UsageError, match="no number called `k`"):
        knobs.written({"k": 0.1})


def test_numbers_in_statements_at_a_frame():
    knobs = knobs_of(TEXT)
    height, bound = named(knobs, "z at [n/2]"), named(knobs, "x at [n/2]")
    assert (knobs.knobs[height].value, knobs.knobs[bound].value) == (0.5, -0.25)
    assert knobs.written({height: 0.625, bound: 0.0}) == TEXT.replace("z = 0.5;", "z = 0.625;").replace(
        "-0.25 <= x;", "0 <= x;"
    )


def test_what_is_repeated_is_not_one_number():
    text = TEXT.replace("g = 9.81,", "g = 9.81; constants: for k in 1..2: m{k} = 3; constants:")
    knobs = knobs_of(text)
    assert "m1" not in knobs.knobs
    with pytest.raises(UsageError, match="one of several constants that are written once"):
        knobs.written({"m1": 2.0})
    assert knobs.written({"g": 1.5}) == text.replace("9.81", "1.5")


def test_the_working_text_means_the_same_with_a_constant_for_each_number():
    knobs = knobs_of(TEXT)
    working, plain = Model(Source("ball.stc", knobs.working)), Model(Source("ball.stc", TEXT))
    one, other = working.problem(), plain.problem()
    assert set(one.constants) - set(other.constants) == {"steered1", "steered2"}
    assert working.solve().objective == pytest.approx(plain.solve().objective, rel=1e-9)
    higher = Model(Source("ball.stc", knobs.written({named(knobs, "z at [n/2]"): 0.75})))
    turned = working.solve(constants={named(knobs, "z at [n/2]"): 0.75})
    assert turned.objective == pytest.approx(higher.solve().objective, rel=1e-9)


def test_a_name_of_the_working_text_is_not_one_of_the_spec():
    text = TEXT.replace("g = 9.81,", "g = 9.81, steered1 = 3,")
    knobs = knobs_of(text)
    assert knobs.knobs["steered1"].value == 3.0
    assert len(set(knobs.knobs)) == len(knobs.knobs)
    Model(Source("ball.stc", knobs.working)).problem()


def test_a_keyframe_of_the_model_becomes_a_pose_of_the_spec():
    source = read_source("quadruped_hop")
    knobs = find_knobs(source)
    site = next(site for site in knobs.poses if site.frame == 60)
    knee = site.coordinates["joint.FL_knee"]
    assert site.shift == ("D", None, None)
    assert knobs.written({knee: -1.5, "D": 0.625}) == source.text.replace(
        "D = 0.5;                      # m", "D = 0.625;                    # m"
    ).replace("[n]: keyframe.stand +", "[n]: stand_n +").replace(
        "constraints:\n", "poses:\n  stand_n = keyframe.stand, joint.FL_knee = -1.5;\n\nconstraints:\n"
    )


def test_an_orientation_is_written_whole():
    source = read_source("quadruped_hop")
    knobs = find_knobs(source)
    site = next(site for site in knobs.poses if site.frame == 0)
    text = knobs.written({site.coordinates["joint.root.qz"]: 0.5})
    assert (
        "  stand_0 = keyframe.stand, joint.root.qw = 1, joint.root.qx = 0, joint.root.qy = 0,\n"
        "      joint.root.qz = 0.5;\n" in text
    )


def test_poses_that_the_spec_has_are_changed_where_they_stand():
    source = read_source("quadruped_hop")
    text = source.text.replace(
        "constraints:\n",
        "poses:\n  low = keyframe.stand,  # crouching\n    joint.FL_hip = 0.9;  joint_free = keyframe.stand;\n"
        "constraints:\n",
    ).replace("[0]: keyframe.stand;", "[0]: low;")
    knobs = find_knobs(Source("hop.stc", text, source.path))
    site = next(site for site in knobs.poses if site.frame == 0)
    changed = {site.coordinates["joint.FL_hip"]: 0.75, site.coordinates["joint.FL_knee"]: -1.5}
    assert knobs.written(changed) == text.replace(
        "joint.FL_hip = 0.9;", "joint.FL_hip = 0.75, joint.FL_knee = -1.5;"
    )
    other = next(site for site in knobs.poses if site.frame == 60)
    assert (
        "    joint.FL_hip = 0.9;  joint_free = keyframe.stand;\n  stand_n = keyframe.stand, "
        in knobs.written({other.coordinates["joint.RR_hip"]: 0.9})
    )


def test_edits():
    assert edited("abcdef", [Edit(4, 5, "E"), Edit(1, 3, "-"), Edit(0, 0, ">")]) == ">a-dEf"
    with pytest.raises(ValueError, match="two edits"):
        edited("abcdef", [Edit(1, 3, "x"), Edit(2, 4, "y")])
    assert [number(value) for value in (1.0, -2.0, 0.1, 1e-9, 0.30000000000000004)] == [
        "1", "-2", "0.1", "1e-09", "0.30000000000000004",
    ]  # fmt: skip
