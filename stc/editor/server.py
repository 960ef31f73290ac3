"""The protocol: documents that open and change, and the editor's questions about them.

A text is read in a thread of its own, a moment after the last change; meanwhile the server answers from what it knows.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from lsprotocol import types as lsp
from pygls import uris
from pygls.lsp.server import LanguageServer

from stc.editor.answers import Completion, completions, hover, outline, targets
from stc.editor.last_solution import LastSolution
from stc.editor.names import Known, names_of
from stc.editor.reading import Reading, read
from stc.errors import Diagnostic, Source
from stc.version import __version__

__all__ = ["serve"]

T = TypeVar("T")

#: Seconds without a change before a text is read.
PAUSE = 0.1

_SYMBOLS = {
    "constant": lsp.SymbolKind.Constant,
    "variable": lsp.SymbolKind.Variable,
    "parameter": lsp.SymbolKind.TypeParameter,
    "definition": lsp.SymbolKind.Function,
}
_ITEMS = {
    "constant": lsp.CompletionItemKind.Constant,
    "variable": lsp.CompletionItemKind.Variable,
    "parameter": lsp.CompletionItemKind.TypeParameter,
    "definition": lsp.CompletionItemKind.Function,
    "path": lsp.CompletionItemKind.Field,
    "section": lsp.CompletionItemKind.Module,
    "word": lsp.CompletionItemKind.Keyword,
}


class Document:
    """A text that is open in the editor.

    Attributes:
        reading: of the last version that was read.
        names: the names of the last version that had any.
        reader: what reads the newest version, and ends when it has been read.
    """

    def __init__(self) -> None:
        self.reading: Reading | None = None
        self.names: dict[str, Known] = {}
        self.reader: asyncio.Task[None] | None = None


class Server(LanguageServer):
    """The server, with the documents that are open."""

    def __init__(self) -> None:
        super().__init__("stc", __version__)
        self.documents: dict[str, Document] = {}
        self.last = LastSolution()
        # One thread: expressions are interned, and MuJoCo's reader of models has settings for the whole process.
        self._thread = ThreadPoolExecutor(1)

    async def apart(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a slow function on another thread, so that the server goes on answering, and return its result."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, function, *arguments)

    def changed(self, uri: str, pause: float) -> None:
        """Read a text that was opened or edited, after a pause in which it is not edited again, in s."""
        document = self.documents.setdefault(uri, Document())
        if document.reader is not None:
            document.reader.cancel()
        document.reader = asyncio.ensure_future(self._read(uri, document, pause))

    async def _read(self, uri: str, document: Document, pause: float) -> None:
        await asyncio.sleep(pause)
        text = self.workspace.get_text_document(uri)
        source = source_of(uri, text.source)
        version = text.version
        reading, names = await self.apart(_read_all, source)
        document.reading, document.names = reading, names or document.names
        found = [self._diagnostic(reading.source, each) for each in reading.diagnostics]
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, found, version))

    async def known(self, uri: str) -> tuple[Reading, dict[str, Known]] | None:
        """The analysis of the newest version of a text, once it is finished."""
        document = self.documents.get(uri)
        while document is not None and document.reader is not None and not document.reader.done():
            await asyncio.wait([document.reader])
        if document is None or document.reading is None:
            return None
        return document.reading, document.names

    def offset(self, source: Source, position: lsp.Position) -> int:
        """The character of a text at a position of the editor."""
        lines = source.text.split("\n")
        at = self.workspace.position_codec.position_from_client_units(lines, position)
        return min(source.line_starts()[min(at.line, len(lines) - 1)] + at.character, len(source.text))

    def range(self, source: Source, start: int, end: int) -> lsp.Range:
        """The editor's range of some characters of a text."""
        corners = []
        for offset in (start, end):
            line, column = source.position(min(offset, len(source.text)))
            corners.append(lsp.Position(line - 1, column - 1))
        return self.workspace.position_codec.range_to_client_units(
            source.text.split("\n"), lsp.Range(*corners)
        )

    def _diagnostic(self, source: Source, found: Diagnostic) -> lsp.Diagnostic:
        start = end = 0
        message = found.message
        if found.span is not None:
            start, end = found.span.source.place(found.span.start, found.span.end)
            message += f" (for {found.span.repeated})" if found.span.repeated else ""
        severity = lsp.DiagnosticSeverity.Error
        if found.severity != "error":
            severity = lsp.DiagnosticSeverity.Warning
        text = f"{message}\n{found.hint}" if found.hint else message
        return lsp.Diagnostic(self.range(source, start, end), text, severity, source="stc")


def source_of(uri: str, text: str) -> Source:
    """The text of a document, its lines ended as those of files are when they are read."""
    path = uris.to_fs_path(uri)
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    return Source(Path(path).name if path else "<text>", plain, path)


def _read_all(source: Source) -> tuple[Reading, dict[str, Known]]:
    reading = read(source)
    try:
        return reading, names_of(reading)
    except Exception:  # a defect of the program must not end the editing
        logging.getLogger(__name__).exception("the names of %s", source.name)
        return reading, {}


server = Server()


@server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
async def _opened(params: lsp.DidOpenTextDocumentParams) -> None:
    server.changed(params.text_document.uri, 0.0)


@server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
async def _changed(params: lsp.DidChangeTextDocumentParams) -> None:
    server.changed(params.text_document.uri, PAUSE)


@server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)
async def _saved(params: lsp.DidSaveTextDocumentParams) -> None:
    for uri in server.documents:  # perhaps a model or data that others read
        server.changed(uri, 0.0)


@server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
async def _closed(params: lsp.DidCloseTextDocumentParams) -> None:
    document = server.documents.pop(params.text_document.uri, None)
    if document is not None and document.reader is not None:
        document.reader.cancel()
    server.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(params.text_document.uri, []))


@server.feature(lsp.TEXT_DOCUMENT_COMPLETION, lsp.CompletionOptions(trigger_characters=["."]))
async def _complete(params: lsp.CompletionParams) -> list[lsp.CompletionItem]:
    uri = params.text_document.uri
    document = server.documents.get(uri)
    if document is not None and not document.names:
        await server.known(uri)
    if document is None or document.reading is None:
        return []
    source = source_of(uri, server.workspace.get_text_document(uri).source)
    offset = server.offset(source, params.position)
    return [_item(each) for each in completions(document.names, source.text, offset)]


def _item(found: Completion) -> lsp.CompletionItem:
    kind = _ITEMS.get(found.kind, lsp.CompletionItemKind.Reference)
    return lsp.CompletionItem(found.word, kind=kind, detail=found.about or found.kind)


@server.feature(lsp.TEXT_DOCUMENT_HOVER)
async def _hover(params: lsp.HoverParams) -> lsp.Hover | None:
    known = await server.known(params.text_document.uri)
    if known is None:
        return None
    reading, names = known
    offset = server.offset(reading.source, params.position)
    found = await server.apart(hover, reading, names, offset, server.last)
    if found is None:
        return None
    text, start, end = found
    content = lsp.MarkupContent(lsp.MarkupKind.Markdown, text)
    return lsp.Hover(content, server.range(reading.source, start, end))


@server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
async def _definition(params: lsp.DefinitionParams) -> list[lsp.Location]:
    uri = params.text_document.uri
    known = await server.known(uri)
    if known is None:
        return []
    reading, names = known
    found = []
    for target in targets(reading, names, server.offset(reading.source, params.position)):
        if target.file is None:
            found.append(lsp.Location(uri, server.range(reading.source, target.start, target.end)))
        else:
            line = lsp.Position(target.line - 1, 0)
            found.append(lsp.Location(target.file.as_uri(), lsp.Range(line, line)))
    return found


@server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
async def _symbols(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    known = await server.known(params.text_document.uri)
    if known is None:
        return []
    reading, names = known
    found = []
    for heading in outline(reading, names):
        children = []
        for each in heading.names:
            kind = _SYMBOLS.get(each.kind, lsp.SymbolKind.Object)
            places = [span for span in each.places if heading.head[1] <= span[0] < heading.end]
            where = server.range(reading.source, *places[0])
            children.append(lsp.DocumentSymbol(each.name, kind, where, where, each.about))
        head = server.range(reading.source, *heading.head)
        whole = server.range(reading.source, heading.head[0], heading.end)
        found.append(
            lsp.DocumentSymbol(heading.name, lsp.SymbolKind.Namespace, whole, head, children=children)
        )
    return found


def serve() -> None:
    """Answer an editor over standard input and output until it hangs up."""
    # What a library prints must not come between the messages.
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        server.start_io(stdout=answers)
