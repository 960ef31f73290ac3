"""What tests of the linear algebra share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stc.codegen import threads


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Two threads whatever the environment says and the machine has."""
    monkeypatch.setattr(threads, "_processors", lambda: 2)
    monkeypatch.delenv("STC_THREADS", raising=False)
    threads.limit(2)
    yield
    threads.limit(None)
