"""The language server as an editor meets it: another process, asked over its standard input and output."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TypeVar

import pytest

import stc
from stc import models, specs

pytest.importorskip("pygls")

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

T = TypeVar("T")

#: Seconds within which an answer comes, however busy the machine is.
PATIENCE = 120.0

SWING = """\
constants:
  n = 20,                  # frames
  T = 1, h = T/n,
  g = 9.81,                # m/s^2, gravity
  l = 0.5;                 # m, length
variables:
  θ,                       # rad, from hanging
  u;                       # N m, torque
definitions:
  [0, n/2]: s = sin(θ);
  [n/2 + 1, n]: s = θ;
constraints:
  [0, n]: θ'' = -g/l*s + u;
  [0]: θ; θ';
  [n]: θ = 0.5; θ';
objective: [0, n]: integral(u^2);
method: hermite-simpson;
"""


class Editor:
    """A client with one text open, which it changes and asks about."""

    def __init__(self, client: LanguageClient, path: Path) -> None:
        self.client = client
        self.uri = path.as_uri()
        self.text = ""
        self.version = 0
        self._published: asyncio.Queue[lsp.PublishDiagnosticsParams] = asyncio.Queue()

        @client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def published(found: lsp.PublishDiagnosticsParams) -> None:
            self._published.put_nowait(found)

    async def shows(self, text: str) -> list[lsp.Diagnostic]:
        """The mistakes and warnings of a text that is opened, or put in the place of the last one."""
        self.text, self.version = text, self.version + 1
        if self.version == 1:
            item = lsp.TextDocumentItem(self.uri, "stc", 1, text)
            self.client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))
        else:
            document = lsp.VersionedTextDocumentIdentifier(version=self.version, uri=self.uri)
            whole = lsp.TextDocumentContentChangeWholeDocument(text)
            self.client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [whole]))
        while True:
            found = await asyncio.wait_for(self._published.get(), PATIENCE)
            if found.version == self.version:
                return list(found.diagnostics)

    def place(self, words: str, after: int = 0) -> lsp.Position:
        """So many characters into the first place of some words."""
        at = self.text.index(words) + after
        line = self.text[self.text.rfind("\n", 0, at) + 1 : at]
        return lsp.Position(self.text.count("\n", 0, at), len(line.encode("utf-16-le")) // 2)

    def within(self, span: lsp.Range) -> str:
        """The characters of a range of one line, of which none takes more than one unit."""
        line = self.text.split("\n")[span.start.line]
        assert span.end.line == span.start.line
        return line[span.start.character : span.end.character]

    async def hover(self, words: str, after: int = 0) -> str:
        parameters = lsp.HoverParams(lsp.TextDocumentIdentifier(self.uri), self.place(words, after))
        found = await self.client.text_document_hover_async(parameters)
        if found is None:
            return ""
        assert isinstance(found.contents, lsp.MarkupContent)
        return found.contents.value

    async def definition(self, words: str, after: int = 0) -> list[tuple[str, int, str]]:
        """Name of the file, line from 1, and the characters where they are in the text itself."""
        parameters = lsp.DefinitionParams(lsp.TextDocumentIdentifier(self.uri), self.place(words, after))
        found = await self.client.text_document_definition_async(parameters)
        assert isinstance(found, list)
        places = [one for one in found if isinstance(one, lsp.Location)]
        return [
            (
                one.uri.rpartition("/")[2],
                one.range.start.line + 1,
                self.within(one.range) if one.uri == self.uri else "",
            )
            for one in places
        ]

    async def completions(self, words: str, after: int = 0) -> dict[str, str]:
        document = lsp.TextDocumentIdentifier(self.uri)
        found = await self.client.text_document_completion_async(
            lsp.CompletionParams(document, self.place(words, after))
        )
        assert isinstance(found, list)
        return {item.label: item.detail or "" for item in found}

    async def symbols(self) -> dict[str, list[str]]:
        parameters = lsp.DocumentSymbolParams(lsp.TextDocumentIdentifier(self.uri))
        found = await self.client.text_document_document_symbol_async(parameters)
        sections = [one for one in found or () if isinstance(one, lsp.DocumentSymbol)]
        return {one.name: [child.name for child in one.children or ()] for one in sections}


def edited(path: Path, session: Callable[[Editor], Awaitable[T]]) -> T:
    """What comes of a session with a server of its own, which ends by itself when it is told to."""

    async def whole() -> T:
        client = LanguageClient("test", "1")
        await client.start_io(sys.executable, "-m", "stc", "language-server", "--stdio", cwd=path.parent)
        process = client._server
        assert process is not None
        try:
            await client.initialize_async(lsp.InitializeParams(capabilities=lsp.ClientCapabilities()))
            client.initialized(lsp.InitializedParams())
            found = await session(Editor(client, path))
            await client.shutdown_async(None)
            client.exit(None)
            assert await asyncio.wait_for(process.wait(), PATIENCE) == 0
            return found
        finally:
            if process.returncode is None:
                process.kill()
            await client.stop()

    return asyncio.run(asyncio.wait_for(whole(), 4 * PATIENCE))


def test_mistakes_are_marked_where_they_are_and_go_away_when_they_are_mended(tmp_path: Path) -> None:
    async def session(editor: Editor) -> None:
        assert await editor.shows(SWING) == []
        twice = SWING.replace("+ u;", "+ uu;").replace("= 0.5; θ'", "= 0.5; θθ'")
        found = await editor.shows(twice)
        assert [editor.within(one.range) for one in found] == ["uu", "θθ"]
        assert "`uu` is not declared\ndid you mean `u`?" in found[0].message
        assert {one.severity for one in found} == {lsp.DiagnosticSeverity.Error}
        (unused,) = await editor.shows(SWING.replace("  T = 1,", "  T = 1, w = 2,"))
        assert unused.severity == lsp.DiagnosticSeverity.Warning
        assert editor.within(unused.range) == "w"
        assert await editor.shows(SWING.replace("\n", "\r\n")) == []
        assert await editor.shows("") == []

    edited(tmp_path / "swing.stc", session)


def test_columns_are_counted_as_the_editor_counts_them(tmp_path: Path) -> None:
    """In units of UTF-16, of which a letter beyond the first 65536 takes two."""

    async def session(editor: Editor) -> None:
        line = 'model: "𝒙𝒙.xml"; variables: x, y; constraints: zz;'
        found = await editor.shows(line)
        start = next(one.range.start.character for one in found if "`zz`" in one.message)
        assert start == line.index("zz") + 2

    edited(tmp_path / "letters.stc", session)


def test_half_typed_text_has_mistakes_and_the_server_goes_on(tmp_path: Path) -> None:
    async def session(editor: Editor) -> None:
        await editor.shows(SWING)
        for cut in range(10, len(SWING), 37):
            await editor.shows(SWING[:cut])
        for half in ("for k in 1..", "for k in 1..3: q{k", "[0, n", '"', 'model: "', "sum(k in"):
            assert await editor.shows(SWING + half)
        assert "m/s^2, gravity" in (await editor.completions("method"))["g"]  # known from before the slip
        assert await editor.shows(SWING) == []

    edited(tmp_path / "swing.stc", session)


def test_a_name_is_explained_and_found(tmp_path: Path) -> None:
    async def session(editor: Editor) -> None:
        await editor.shows(SWING)
        told = await editor.hover("-g/l", 1)
        assert "constant" in told and "m/s^2, gravity" in told and "9.81" in told
        assert "rad, from hanging" in await editor.hover("θ''")
        assert "[0, n/2]: s = sin(θ)" in await editor.hover("s + u")
        assert "integral of e" in await editor.hover("integral(", 2)
        assert "midpoint in every step" in await editor.hover("hermite-simpson", 9)
        assert await editor.hover("9.81") == ""
        assert await editor.definition("l*s") == [("swing.stc", 5, "l")]
        assert await editor.definition("s + u") == [("swing.stc", 10, "s"), ("swing.stc", 11, "s")]
        assert await editor.definition("sin(") == []
        assert await editor.symbols() == {
            "constants": ["n", "T", "h", "g", "l"],
            "variables": ["θ", "u"],
            "definitions": ["s"],
            "constraints": [],
            "objective": [],
            "method": [],
        }

    edited(tmp_path / "swing.stc", session)


def test_values_come_from_the_last_solution_beside_the_spec(tmp_path: Path) -> None:
    path = tmp_path / "swing.stc"
    path.write_text(SWING, encoding="utf-8")
    solution = stc.load(path).solve()
    solution.save(tmp_path / "swing.npz")

    async def session(editor: Editor) -> None:
        await editor.shows(SWING)
        low, high = solution["u"].min(), solution["u"].max()
        assert f"`u` from {low:.4g} to {high:.4g}" in await editor.hover("u;  ")
        assert "in `swing.npz` (optimal): " in await editor.hover("θ''")
        await editor.shows(SWING.replace("9.81", "3.7"))
        assert "of another text): `g` = 9.81" in await editor.hover("g = ")

    edited(path, session)


def test_things_of_the_model(tmp_path: Path) -> None:
    quadruped = models.locate("quadruped.xml")
    assert quadruped is not None
    lines = quadruped.read_text().splitlines()

    def line_of(element: str) -> int:
        return next(number for number, line in enumerate(lines, 1) if element in line)

    async def session(editor: Editor) -> None:
        text = specs_text("quadruped_hop")
        assert await editor.shows(text) == []
        assert await editor.definition("quadruped.xml") == [("quadruped.xml", 1, "")]
        assert await editor.definition("geom.RR_foot", 7) == [
            ("quadruped.xml", line_of('name="RR_foot"'), "")
        ]
        assert await editor.definition("keyframe.stand", 10) == [
            ("quadruped.xml", line_of('key name="stand"'), "")
        ]
        assert "sphere" in await editor.hover("geom.RR_foot")
        assert {"stand", "crouch", "reference"} == (await editor.completions("keyframe.stand", 9)).keys()
        await editor.shows(text.replace("integral(effort);", "integral(joint.); site."))
        joints = await editor.completions("joint.)", 6)
        assert {"*", "root", "FL_knee"} <= joints.keys()
        assert "rad, from -2.7 to -0.8" in joints["FL_knee"]
        assert {"FL_foot", "floor"} <= (await editor.completions("geom.FL_foot", 5)).keys()
        words = await editor.completions("integral(", 3)
        assert {"D", "FL", "FL_fz", "sin", "effort", "geom", "keyframe", "constraints"} <= words.keys()
        assert "cost of the speed" in (await editor.completions("landing"))["landing"]

    edited(tmp_path / "hop.stc", session)


def test_data_and_repetitions(tmp_path: Path) -> None:
    (tmp_path / "polar.csv").write_text("alpha,lift\n0,0\n1,2\n2,3\n")
    text = """\
constants: n = 10, N = 3, h = 0.1;
data: polar = "polar.csv"; lift = table(polar.alpha, polar.lift);
variables: for k in 1..N: q{k};     # m, of each
constraints:
  for k in 1..N: { [0, n]: q{k}'' = lift(q{k}); [0]: q{k} = {k}; [n]: q{k} = z{k}; }
"""

    async def session(editor: Editor) -> None:
        found = await editor.shows(text)
        assert [editor.within(one.range) for one in found] == ["z{k}"]
        assert "(for k = 1)" in found[0].message
        assert "m, of each" in await editor.hover("q{k}''")
        assert await editor.definition("q{k}''") == [("repeated.stc", 3, "q{k}")]
        assert await editor.definition("lift(q") == [("repeated.stc", 2, "lift")]
        assert await editor.definition("polar.csv") == [("polar.csv", 1, "")]
        assert (await editor.completions("polar.lift", 6)).keys() == {"alpha", "lift"}

    edited(tmp_path / "repeated.stc", session)


@pytest.mark.nightly
@pytest.mark.slow
def test_every_shipped_spec_is_without_mistakes(tmp_path: Path) -> None:
    (tmp_path / "particle_terrain.csv").write_bytes((specs_folder() / "particle_terrain.csv").read_bytes())

    async def session(editor: Editor) -> None:
        for name in specs.names():
            found = await editor.shows(specs_text(name))
            assert not [one.message for one in found if one.severity == lsp.DiagnosticSeverity.Error], name

    edited(tmp_path / "shipped.stc", session)


def specs_folder() -> Path:
    path = specs.locate("quadruped_hop")
    assert path is not None
    return path.parent


def specs_text(name: str) -> str:
    return (specs_folder() / f"{name}.stc").read_text(encoding="utf-8")
