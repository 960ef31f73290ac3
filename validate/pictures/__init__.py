"""Pictures of a motion: plots, filmstrips and videos, none of which needs a screen."""

from __future__ import annotations

from stc.errors import StcError


class PictureError(StcError):
    """A picture that cannot be made here: no OpenGL, an unknown camera or kind of file, a missing library."""


__all__ = ["PictureError"]
