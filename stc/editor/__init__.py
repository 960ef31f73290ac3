"""The language server, ``stc language-server``: what an editor is told about the text of a spec while it is written.

:mod:`stc.editor.reading` reads a text as far as it can be read, with the parser and the elaborator that every command
uses; :mod:`stc.editor.names` finds out what its names stand for, :mod:`stc.editor.words` what the words of the language
mean; :mod:`stc.editor.answers` makes answers of these, and :mod:`stc.editor.server` speaks the protocol, with pygls.
"""

from __future__ import annotations
