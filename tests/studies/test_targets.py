"""Printed numbers as data."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.paper.verification import load_targets, targets_file


@pytest.mark.parametrize("width", ["0.0", "-0.1", "1e-30"])
def test_a_target_without_a_tolerance_is_refused(gear: Gear, tmp_path: Path, width: str) -> None:
    text = targets_file(gear).read_text(encoding="utf-8")
    (tmp_path / "t.toml").write_text(
        re.sub(r"tolerance = \S+", f"tolerance = {width}", text, count=1)
    )
    with pytest.raises(GearFileError, match="tolerance: expected a number above 0"):
        load_targets(tmp_path / "t.toml")
