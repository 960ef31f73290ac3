"""The command ``stc language-server``: diagnostics, completion and hover for editors."""

from __future__ import annotations

from stc.cli.statuses import GOOD
from stc.errors import UsageError


def serve() -> int:
    """Answer an editor until it hangs up.

    Raises:
        UsageError: pygls is not installed.
    """
    try:
        from stc.editor.server import serve
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] not in ("pygls", "lsprotocol"):
            raise
        raise UsageError(
            "the language server needs pygls, which is not installed", "pip install pygls"
        ) from None
    serve()
    return GOOD
