"""How stated probabilities are compared with what acts, in fleets as drawn and in others."""

from __future__ import annotations

import pytest

from .calibration import MIXTURES, bins

SOUND = {"truth": [], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}
WRONG = {"truth": [("gauge_bias", "gauge 1")], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}


def test_what_acts_is_counted_among_what_was_stated() -> None:
    assert (0.8, 0.95, 2, pytest.approx(0.9), pytest.approx(0.5)) in bins([SOUND, WRONG])


def test_fleets_with_nothing_wrong_count_three_times_where_they_are_so_much_oftener() -> None:
    found = bins([SOUND, WRONG], MIXTURES["nothing wrong three times as often"])
    assert (0.8, 0.95, 2, pytest.approx(0.9), pytest.approx(0.25)) in found


def test_fleets_of_another_linkage_say_nothing_of_how_far_probabilities_hold() -> None:
    assert all(count == 0 for _low, _high, count, *_rates in bins([{**WRONG, "linkage": "B"}]))
