"""The parser of `data:`: sources of columns, and the functions made from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stc.language import syntax
from stc.language.expression_parser import Misread
from stc.symbolic.tables import KINDS

if TYPE_CHECKING:
    from stc.language.parser import _Parser

#: What a table is made by.
TABLE_WORD = "table"
#: The option that says what a table is outside of its numbers.
OUTSIDE_WORD = "outside"
#: The option of a file that says which columns go on where they leap by a whole turn.
UNWRAP = "unwrap"
#: What a motion is called that the model's file has.
KEYFRAMES = "keyframes"
_FORMS = '`name = "file.csv";`, `name = (x, y): (0, 1), (2, 3);` or `name = table(data.x, data.y);`'


def data_statement(parser: _Parser, into: list[syntax.Statement]) -> None:
    """Read one statement of the section."""
    name = parser.name('the name of a data set or table, as in `polar = "polar.csv";`')
    if parser.kind != "=":
        raise parser.fail(
            f"expected `=` after `{name.name}`, found {parser.described()}", f"data is {_FORMS}"
        )
    parser.advance()
    if parser.kind == "string":
        path = parser.string("the name of a file")
        turned = _unwrapped(parser)
        into.append(syntax.DataFile(name.start, parser.ends[parser.at - 1], name, path, turned))
        parser.end_statement("the data set")
    elif parser.kind == "(":
        into.append(_rows(parser, name))
        parser.end_statement("the last row")
    elif parser.kind == "name" and parser.token_text(parser.at) == TABLE_WORD:
        into.append(_table(parser, name))
        parser.end_statement("the table")
    elif parser.kind == "name" and parser.token_text(parser.at) == KEYFRAMES:
        parser.advance()
        into.append(syntax.DataKeyframes(name.start, parser.ends[parser.at - 1], name))
        parser.end_statement("the data set")
    else:
        raise parser.fail(
            f"expected data after `{name.name} =`, found {parser.described()}", f"data is {_FORMS}"
        )


def _unwrapped(parser: _Parser) -> list[tuple[syntax.Name, syntax.Expression | None]]:
    """The columns of a file that are unwrapped at whole turns, each with the value of a turn if it is given."""
    found: list[tuple[syntax.Name, syntax.Expression | None]] = []
    while parser.kind == ",":
        parser.advance()
        if parser.kind != "name" or parser.token_text(parser.at) != UNWRAP:
            hint = f'a file has the option `{UNWRAP}`, as in `swing = "swing.csv", {UNWRAP} angle;`'
            raise parser.fail(f"expected `{UNWRAP}`, found {parser.described()}", hint)
        parser.advance()
        column = parser.name_or_path(f"a column of angles, as in `{UNWRAP} angle`")
        turn: syntax.Expression | None = None
        if parser.kind == "=":
            parser.advance()
            turn = parser.expression()
        found.append((column, turn))
    return found


def _rows(parser: _Parser, name: syntax.Name) -> syntax.DataRows:
    parser.advance()
    columns = [_column(parser)]
    while parser.kind == ",":
        parser.advance()
        columns.append(_column(parser))
    parser.expect(")", "`)` after the names of the columns")
    parser.expect(":", "`:` before the rows, as in `(x, y): (0, 1), (2, 3);`")
    rows = [_row(parser, columns)]
    while parser.kind == ",":
        parser.advance()
        rows.append(_row(parser, columns))
    if parser.kind == "(":
        raise parser.fail("expected `,` between two rows, found `(`", "rows are `(0, 10), (2, 9.1)`")
    return syntax.DataRows(name.start, parser.ends[parser.at - 1], name, columns, rows)


def _column(parser: _Parser) -> syntax.Name:
    what = "the name of a column, as in `thrust = (speed, force): (0, 10), (5, 4);`"
    return parser.name_or_path(what)


def _row(parser: _Parser, columns: list[syntax.Name]) -> list[syntax.Expression]:
    start = parser.starts[parser.at]
    parser.expect("(", "a row in parentheses, as in `(0, 10)`")
    row = [parser.expression()]
    while parser.kind == ",":
        parser.advance()
        row.append(parser.expression())
    parser.expect(")", "`)` after the numbers of a row")
    if len(row) != len(columns):
        count = f"{len(row)} number{'s' if len(row) != 1 else ''}"
        message = f"a row has {count} for {len(columns)} column{'s' if len(columns) != 1 else ''}"
        parser.diagnostics.error(message, start, parser.ends[parser.at - 1])
        raise Misread
    return row


def _table(parser: _Parser, name: syntax.Name) -> syntax.TableDefinition:
    parser.advance()
    parser.expect("(", f"`(` after `{TABLE_WORD}`")
    columns = [parser.name_or_path("a column, as in `polar.alpha`")]
    while parser.kind == ",":
        parser.advance()
        columns.append(parser.name_or_path("a column, as in `polar.cl`"))
    parser.expect(")", "`)` after the columns")
    options: list[tuple[syntax.Name, syntax.Name | None]] = []
    while parser.kind == ",":
        parser.advance()
        option = parser.name("an option: `monotone`, `linear` or `outside = hold`")
        value: syntax.Name | None = None
        if parser.kind == "=":
            parser.advance()
            value = parser.name("`hold`, `extend` or `error`")
        options.append((option, value))
    if parser.kind == "name" and parser.token_text(parser.at) in (*KINDS, OUTSIDE_WORD):
        word = parser.token_text(parser.at)
        raise parser.fail(f"expected `,` before `{word}`", "as in `table(polar.alpha, polar.cd), monotone`")
    return syntax.TableDefinition(name.start, parser.ends[parser.at - 1], name, columns, options)
