"""Sentences of the program in the unit that the user reads."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.units import LengthUnit, in_unit

THOU, MM = LengthUnit.THOU, LengthUnit.MILLIMETRE


@pytest.mark.parametrize(
    ("sentence", "thou", "mm"),
    [
        (
            "a margin of 0.0300 in (worst",
            "a margin of 30.0 thou (worst",
            "a margin of 0.762 mm (worst",
        ),
        ("±0.0300 in", "±30.0 thou", "±0.762 mm"),
        ("shifted by -0.0022 in)", "shifted by -2.2 thou)", "shifted by -0.056 mm)"),
        ("gives 0.0472 to 0.0473 in.", "gives 47.2 to 47.3 thou.", "gives 1.199 to 1.201 mm."),
        ("0.00050 in radial", "0.50 thou radial", "0.0127 mm radial"),
    ],
)
def test_a_length_in_a_sentence_is_said_in_the_users_unit(
    sentence: str, thou: str, mm: str
) -> None:
    assert (in_unit(sentence, THOU), in_unit(sentence, MM)) == (thou, mm)


@pytest.mark.parametrize(
    "sentence", ["#3 in this order", "p = 0.05 in every row", "row 12 in file", "2.5 inches"]
)
def test_the_preposition_is_no_unit(sentence: str) -> None:
    assert in_unit(sentence, THOU) == sentence


def test_an_entry_in_quotation_marks_stays_as_it_was_written() -> None:
    said = in_unit("found '0.013 in'; the gear's margin is 0.0300 in", THOU)
    assert said == "found '0.013 in'; the gear's margin is 30.0 thou"


def test_in_inches_nothing_changes() -> None:
    assert in_unit("0.0300 in", LengthUnit.INCH) == "0.0300 in"
