"""Five thousand spoilt inputs: every command ends in time, with a message, and loses nothing."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from fuzz.campaign import campaign

pytestmark = pytest.mark.nightly

CASES = 5000


def test_whatever_the_input_commands_end_with_a_message(tmp_path: Path) -> None:
    seed = int(time.time() // 86400)  # others every day; a finding names its own
    print(f"seed {seed}")
    findings = campaign(seed, range(CASES), tmp_path / "work", tmp_path / "findings")
    told = "\n".join(f"seed {seed} case {one.number}: {'; '.join(one.wrong)}" for one in findings)
    assert not findings, f"written to {tmp_path / 'findings'}:\n{told}"
