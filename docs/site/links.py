"""Hooks of the site's builder, for what reads well elsewhere and not there.

Links to files of the repository that are not part of the site become their paths: pages are read in the repository too,
where such links lead somewhere.  Of the docstrings' references (``:mod:`` and its kin) the names are left.
"""

import re
from typing import Any

#: A link out of docs/: its text, its path, what follows a #.
_OUTSIDE = re.compile(r"\[([^\]]*)\]\(\.\./([^)#]+)(#[^)]*)?\)")

_ROLE = re.compile(r":(?:mod|class|func|meth|data|attr):\s*(?=<code>)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page with the text of such a link, and its path unless the text is that."""

    def plain(link: re.Match[str]) -> str:
        text, path = link[1], link[2]
        return text if path in text else f"{text} (`{path}`)"

    return _OUTSIDE.sub(plain, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """The HTML of a page without Sphinx's roles, such as ``:mod:``, before the names that docstrings refer to."""
    return _ROLE.sub("", html)
