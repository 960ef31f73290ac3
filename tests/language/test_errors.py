import pickle

from stc.errors import Diagnostic, EvaluationError, Source, Span, SpecError, UsageError


def test_positions_count_lines_and_columns_from_one() -> None:
    source = Source("a.stc", "ab\n\ncde")
    assert [source.position(offset) for offset in range(8)] == [
        (1, 1),
        (1, 2),
        (1, 3),
        (2, 1),
        (3, 1),
        (3, 2),
        (3, 3),
        (3, 4),
    ]
    assert [source.line(number) for number in (1, 2, 3)] == ["ab", "", "cde"]


def test_span_knows_its_text_and_place() -> None:
    span = Span(Source("a.stc", "x = 1;\n  yy = 2;"), 9, 11)
    assert (span.line, span.column, span.text, span.location) == (2, 3, "yy", "a.stc:2:3")


def test_excerpt_marks_exactly_the_span() -> None:
    lines = Span(Source("a.stc", "m*x'' - fxx;"), 8, 11).excerpt().splitlines()
    start = lines[0].index("fxx")
    assert lines[1].index("^") == start
    assert lines[1].count("^") == 3


def test_excerpt_keeps_the_caret_below_tabs_and_at_line_ends() -> None:
    tabbed = Span(Source("a.stc", "\tx\t= yy;"), 5, 7).excerpt().splitlines()
    assert tabbed[1].index("^") == tabbed[0].index("yy")
    at_end = Span(Source("a.stc", "x = 1"), 5, 6).excerpt().splitlines()
    assert at_end[1].index("^") == len(at_end[0])


def test_excerpt_of_a_long_line_is_a_window_around_the_span() -> None:
    text = "+ ".join(f"name{k}*other" for k in range(200))
    start = text.index("name150")
    lines = Span(Source("a.stc", text), start, start + 7).excerpt().splitlines()
    assert len(lines[0]) < 130
    assert lines[0][lines[1].index("^") :].startswith("name150")
    whole = Span(Source("a.stc", text), 0, len(text)).excerpt().splitlines()
    assert len(whole[0]) < 130 and whole[1].count("^") > 20


def test_excerpt_of_a_span_over_several_lines_shows_the_first() -> None:
    lines = Span(Source("a.stc", "x +\n y"), 0, 6).excerpt().splitlines()
    assert len(lines) == 2 and lines[1].count("^") == 3


def test_diagnostic_renders_location_message_excerpt_and_hint() -> None:
    source = Source("a.stc", "x = yy;")
    text = Diagnostic("error", "`yy` is not declared", Span(source, 4, 6), "did you mean `y`?").render()
    assert text.splitlines()[0] == "a.stc:1:5: error: `yy` is not declared"
    assert text.splitlines()[-1].strip() == "did you mean `y`?"


def test_spec_error_prints_all_its_diagnostics_and_survives_pickling() -> None:
    error = SpecError([Diagnostic("error", "one"), Diagnostic("error", "two", None, "a hint")])
    assert str(error) == "error: one\nerror: two\n        a hint"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_evaluation_error_names_expression_frame_and_values() -> None:
    error = EvaluationError("`log` of a negative number", expression="log(x)", frame=2.5, values={"x": -1.0})
    assert str(error).splitlines() == [
        "error: `log` of a negative number at frame 2.5",
        "        in `log(x)`",
        "        with x = -1",
    ]


def test_usage_error_shows_its_hint() -> None:
    assert str(UsageError("no constant `gg`", "did you mean `g`?")) == "no constant `gg`\n  did you mean `g`?"
    assert str(UsageError("no constant `gg`")) == "no constant `gg`"
