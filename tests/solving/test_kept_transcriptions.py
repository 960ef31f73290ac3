"""A model that is solved with many numbers of frames keeps the transcriptions asked for last."""

from __future__ import annotations

import stc
from stc.solving.kept_transcriptions import KEPT

SPEC = """
constants: n = 4, h = 1/n;
variables: x;
constraints: [0]: x = 0; [n]: x = 1;
objective: [0, n]: integral(x'^2);
"""


def test_old_transcriptions_go_and_recent_ones_stay() -> None:
    model = stc.load(SPEC)
    _, first = model.transcription(n=3)
    for n in range(4, KEPT + 10):
        again = model.transcription(n=3)[1]
        model.transcription(n=n)
    assert len(model._transcriptions) <= KEPT
    assert again is first  # asked for again and again
    assert model.transcription(n=4)[1].problem.n == 4
