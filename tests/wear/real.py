"""Measured series that stand beside the checkout, not in it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]


def series(name: str, unit: str, usage: str, value: str) -> dict[str, Array]:
    """Readings (usage, value) by unit; the test that asks is skipped where the file is not
    there.
    """
    beside = [parent / "shared" / "real" / name for parent in Path(__file__).resolve().parents]
    found = next((path for path in beside if path.is_file()), None)
    if found is None:
        pytest.skip(f"{name} stands in ../shared/real beside the checkout, and it is not there")
    paths: dict[str, list[tuple[float, float]]] = {}
    with found.open(encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            paths.setdefault(row[unit], []).append((float(row[usage]), float(row[value])))
    return {name: np.array(rows) for name, rows in paths.items()}


def liners() -> dict[str, Array]:
    """Wear of 32 ship engine liners. [years, mm]"""
    return series("liner-wear.csv", "unit", "years", "wear_mm")


def cracks() -> dict[str, Array]:
    """Crack lengths of 21 specimens. [million cycles, in]"""
    return series("alloy-a-cracks.csv", "specimen", "megacycles", "inches")
