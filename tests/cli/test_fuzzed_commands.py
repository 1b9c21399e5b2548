"""Damaged and hostile files of every kind end with an exit code of the contract."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz_commands import ALLOWED, SLOWEST_S, Fuzz
from tests.machine import SLOWER


@pytest.mark.slow
def test_no_damaged_input_ends_in_an_internal_error_or_late(tmp_path: Path) -> None:
    ended = list(Fuzz(tmp_path, seed=1).cases(1400))
    assert [e for e in ended if e.code not in ALLOWED or e.seconds > SLOWEST_S * SLOWER] == []
    assert {e.kind for e in ended if e.code != 2} >= {"table", "gear", "ensemble", "extension", "draft"}
