"""The clock that is shown."""

from hypothesis import given
from hypothesis import strategies as st

from stc.viewer.timeline import PAUSE, SPEEDS, Timeline


def test_plays_at_its_speed_and_stays_at_the_end_for_a_moment():
    clock = Timeline(1.0, 3.0, 1.0, speed=0.5)
    clock.advance(1.0)
    assert clock.now == 1.5
    clock.advance(10.0)
    assert clock.now == 3.0
    clock.advance(0.9 * PAUSE)
    assert clock.now == 3.0
    clock.advance(0.2 * PAUSE)
    clock.advance(0.1)
    assert clock.now == 1.0
    clock.advance(0.1)
    assert clock.now == 1.05


def test_without_a_loop_it_stops_and_plays_again_from_the_start():
    clock = Timeline(0.0, 1.0, 0.9, loop=False)
    clock.advance(1.0)
    clock.advance(1.0)
    assert clock.now == 1.0 and not clock.playing
    clock.toggle()
    assert clock.now == 0.0 and clock.playing


def test_a_pause_holds_and_a_step_pauses():
    clock = Timeline(0.0, 1.0, 0.5)
    clock.step(0.1)
    clock.advance(5.0)
    assert clock.now == 0.6 and not clock.playing
    clock.step(-2.0)
    assert clock.now == 0.0


def test_another_motion_keeps_the_share_that_has_passed():
    clock = Timeline(0.0, 2.0, 0.5)
    clock.cover(0.0, 4.0)
    assert clock.now == 1.0
    clock.cover(2.0, 2.0)
    assert (clock.now, clock.share, clock.duration) == (2.0, 0.0, 0.0)


def test_speeds_go_up_and_down_and_end():
    clock = Timeline(speed=0.3)
    clock.faster()
    assert clock.speed == 0.5
    for _ in SPEEDS:
        clock.faster(-1)
    assert clock.speed == SPEEDS[0]


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("advance"), st.floats(-1, 5)),
            st.tuples(st.just("seek"), st.floats(-10, 10)),
            st.tuples(st.just("step"), st.floats(-1, 1)),
            st.tuples(st.just("toggle"), st.none()),
        ),
        max_size=20,
    )
)
def test_never_leaves_the_motion(acts):
    clock = Timeline(-1.0, 2.0, 0.0)
    for act, value in acts:
        getattr(clock, act)(*(() if value is None else (value,)))
        assert -1.0 <= clock.now <= 2.0 and 0.0 <= clock.share <= 1.0
