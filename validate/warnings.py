"""MuJoCo's warnings, collected instead of printed and appended to a log file; NumPy's, ignored."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from stc.validate.model import require_mujoco


@contextmanager
def caught_warnings() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, each kind once, as one-line texts in the yielded list.

    Of arithmetic nothing is told: a measurement that is not finite fails, and says so.
    """
    require_mujoco()
    import mujoco

    found: list[str] = []
    kinds: set[str] = set()

    def collect(message: str) -> None:
        text = " ".join(str(message).split())
        kind = text.split(" Time = ")[0]
        if kind not in kinds:
            kinds.add(kind)
            found.append(f"MuJoCo: {text}")

    previous = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(collect)
    try:
        with np.errstate(all="ignore"):
            yield found
    finally:
        mujoco.set_mju_user_warning(previous)
