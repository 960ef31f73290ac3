"""Pictures of a motion: plots, filmstrips and videos; none needs a screen."""

from __future__ import annotations

from stc.errors import StcError


class PictureError(StcError):
    """A picture cannot be made: there is no OpenGL, the camera or file type is unknown, or a library is missing."""


__all__ = ["PictureError"]
