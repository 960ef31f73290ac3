"""The parser of `data:`: sources of columns, and the functions made from them."""

from __future__ import annotations

from functools import partial
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


def data_statement(parser: _Parser) -> tuple[syntax.Statement, str]:
    """Read one statement of the section, without the ``;`` at its end; and what it is called."""
    name = parser.name('the name of a data set or table, as in `polar = "polar.csv";`')
    if not parser.takes("="):
        raise parser.fail(
            f"expected `=` after `{name.name}`, found {parser.described()}", f"data is {_FORMS}"
        )
    if parser.kind == "string":
        path = parser.string("the name of a file")
        turned = parser.separated(partial(_unwrapped, parser)) if parser.takes(",") else []
        return syntax.DataFile(name.start, parser.end, name, path, turned), "the data set"
    if parser.takes("("):
        return _rows(parser, name), "the last row"
    if parser.takes(TABLE_WORD):
        return _table(parser, name), "the table"
    if parser.takes(KEYFRAMES):
        return syntax.DataKeyframes(name.start, parser.end, name), "the data set"
    raise parser.fail(f"expected data after `{name.name} =`, found {parser.described()}", f"data is {_FORMS}")


def _unwrapped(parser: _Parser) -> tuple[syntax.Name, syntax.Expression | None]:
    """A column of a file that is unwrapped at whole turns, with the value of a turn if it is given."""
    if not parser.takes(UNWRAP):
        hint = f'a file has the option `{UNWRAP}`, as in `swing = "swing.csv", {UNWRAP} angle;`'
        raise parser.fail(f"expected `{UNWRAP}`, found {parser.described()}", hint)
    column = parser.name_or_path(f"a column of angles, as in `{UNWRAP} angle`")
    return column, parser.expression() if parser.takes("=") else None


def _rows(parser: _Parser, name: syntax.Name) -> syntax.DataRows:
    what = "the name of a column, as in `thrust = (speed, force): (0, 10), (5, 4);`"
    columns = parser.separated(partial(parser.name_or_path, what))
    parser.expect(")", "`)` after the names of the columns")
    parser.expect(":", "`:` before the rows, as in `(x, y): (0, 1), (2, 3);`")
    rows = parser.separated(partial(_row, parser, columns))
    if parser.kind == "(":
        raise parser.fail("expected `,` between two rows, found `(`", "rows are `(0, 10), (2, 9.1)`")
    return syntax.DataRows(name.start, parser.end, name, columns, rows)


def _row(parser: _Parser, columns: list[syntax.Name]) -> list[syntax.Expression]:
    start = parser.starts[parser.at]
    parser.expect("(", "a row in parentheses, as in `(0, 10)`")
    row = parser.separated(parser.expression)
    parser.expect(")", "`)` after the numbers of a row")
    if len(row) != len(columns):
        count = f"{len(row)} number{'s' if len(row) != 1 else ''}"
        message = f"a row has {count} for {len(columns)} column{'s' if len(columns) != 1 else ''}"
        parser.diagnostics.error(message, start, parser.end)
        raise Misread
    return row


def _table(parser: _Parser, name: syntax.Name) -> syntax.TableDefinition:
    parser.expect("(", f"`(` after `{TABLE_WORD}`")
    columns = parser.separated(partial(parser.name_or_path, "a column, as in `polar.alpha`"))
    parser.expect(")", "`)` after the columns")
    options = parser.separated(partial(_option, parser)) if parser.takes(",") else []
    if parser.word in (*KINDS, OUTSIDE_WORD):
        hint = "as in `table(polar.alpha, polar.cd), monotone`"
        raise parser.fail(f"expected `,` before `{parser.word}`", hint)
    return syntax.TableDefinition(name.start, parser.end, name, columns, options)


def _option(parser: _Parser) -> tuple[syntax.Name, syntax.Name | None]:
    option = parser.name("an option: `monotone`, `linear` or `outside = hold`")
    return option, parser.name("`hold`, `extend` or `error`") if parser.takes("=") else None
