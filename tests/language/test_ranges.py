import pytest
from hypothesis import given
from hypothesis import strategies as st
from reading import messages_of, problem_of


def frames_of(header: str, n: int = 60) -> tuple[int, int]:
    text = f"constants: n = {n}, k = 7, third = 1/3; variables: x; definitions: mid = n/2;"
    (relation,) = problem_of(f"{text} constraints: {header} x = 1;").relations
    return relation.range.first, relation.range.last


@pytest.mark.parametrize(
    ("header", "frames"),
    [
        ("", (0, 60)),
        ("[0, n]:", (0, 60)),
        ("[n]:", (60, 60)),
        ("[n/2]:", (30, 30)),
        ("[mid, n - k]:", (30, 53)),
        ("[0, n/7]:", (0, 8)),
        ("[0.5, 3.5]:", (1, 3)),
        ("[n*third]:", (20, 20)),
        ("[0.1*30, k*(1 - 0.9)*10]:", (3, 7)),
        ("[1 - 1e-10, 2 + 1e-10]:", (1, 2)),
        ("[-1e-10, n]:", (0, 60)),
        ("[sqrt(16), 2^3]:", (4, 8)),
        ("[0, 0]:", (0, 0)),
    ],
)
def test_frames_of_a_header(header: str, frames: tuple[int, int]) -> None:
    assert frames_of(header) == frames


def test_noise_beyond_a_billionth_is_no_noise() -> None:
    assert frames_of("[1 + 1e-8, 3 - 1e-8]:") == (2, 2)


@given(st.floats(0, 60), st.floats(0, 60))
def test_every_whole_number_in_between(a: float, b: float) -> None:
    inside = [k for k in range(61) if a - 1e-9 <= k <= b + 1e-9]
    text = f"constants: n = 60; variables: x; constraints: [{a!r}, {b!r}]: x = 1;"
    if inside:
        (relation,) = problem_of(text).relations
        assert (relation.range.first, relation.range.last) == (inside[0], inside[-1])
    else:
        (message,) = messages_of(text)
        assert "holds no whole number" in message


@pytest.mark.parametrize("header", ["[61]:", "[-1, 3]:", "[0, n + 1]:", "[-1]:", "[59, 62]:"])
def test_ranges_stay_within_the_motion(header: str) -> None:
    (message,) = messages_of(f"constants: n = 60; variables: x; constraints: {header} x = 1;")
    assert "outside the motion" in message


def test_ranges_follow_constants_from_outside() -> None:
    text = "constants: n = 60, a = n/2; variables: x; constraints: [a, n]: x = 1;"
    assert problem_of(text, n=10).relations[0].range.first == 5
    assert problem_of(text, a=7).relations[0].range.first == 7


def test_a_header_holds_until_the_next_one_or_section() -> None:
    problem = problem_of(
        """constants: n = 10; variables: x, y;
        constraints: x = 1; [3]: y = 2; x = 2; [4, 5]: y = 1;
        constraints: y = 4;
        objective: [1, 2]: x; y;"""
    )
    assert [(str(r.range), r.text) for r in problem.relations] == [
        ("[0, 10]", "x = 1"),
        ("[3]", "y = 2"),
        ("[3]", "x = 2"),
        ("[4, 5]", "y = 1"),
        ("[0, 10]", "y = 4"),
    ]
    assert [str(term.range) for term in problem.objective] == ["[1, 2]", "[1, 2]"]
    header = problem.relations[1].range.span
    assert header is not None and header.text == "[3]:"
    assert problem.relations[0].range.span is None


def test_a_motion_of_one_frame() -> None:
    problem = problem_of("constants: n = 0; variables: x; parameters: p; constraints: x = p; [0]: p >= 1;")
    assert [str(r.range) for r in problem.relations] == ["[0]", "[0]"]
