"""How stated probabilities are compared with what acts, in fleets as drawn and in others."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from .calibration import MIXTURES, RESULT, bins, markdown

SOUND = {"truth": [], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}
WRONG = {"truth": [("gauge_bias", "gauge 1")], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}


def test_what_acts_is_counted_among_what_was_stated() -> None:
    assert (0.8, 0.95, 2, pytest.approx(0.9), pytest.approx(0.5)) in bins([SOUND, WRONG])


def test_fleets_with_nothing_wrong_count_three_times_where_they_are_so_much_oftener() -> None:
    found = bins([SOUND, WRONG], MIXTURES["nothing wrong three times as often"])
    assert (0.8, 0.95, 2, pytest.approx(0.9), pytest.approx(0.25)) in found


def test_another_linkage_is_a_cause_that_acts_in_its_fleets() -> None:
    said = {"truth": [], "probabilities": [("geometry", None, 0.9)]}
    assert bins([{**said, "linkage": "B"}])[0][-1] == 1.0
    assert bins([{**said, "linkage": "A"}])[0][-1] == 0.0


def test_the_figures_show_the_tables_of_the_committed_result() -> None:
    figures = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    committed = json.loads(RESULT.read_text(encoding="utf-8"))
    assert [table for table in markdown(committed)[:2] if table not in figures] == []
