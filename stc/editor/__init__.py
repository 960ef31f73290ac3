"""The language server, ``stc language-server``: diagnostics, completion and hover for editors.

:mod:`stc.editor.reading` reads a text as far as it can be read, with the parser and the elaborator that every command
uses; :mod:`stc.editor.names` finds out what its names stand for, :mod:`stc.editor.words` what the words of the language
mean; :mod:`stc.editor.answers` makes answers of these, and :mod:`stc.editor.server` speaks the protocol, with pygls.
"""

from __future__ import annotations
