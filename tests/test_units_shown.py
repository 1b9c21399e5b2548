"""Lengths as they are shown, and slopes of arrays."""

from __future__ import annotations

import copy
import json

import numpy as np
import pytest

from mlg_troubleshoot.arrays import central_slopes, central_steps
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import Length, LengthUnit, Sentence, parse_length, said_in, with_unit

THOU, MM = LengthUnit.THOU, LengthUnit.MILLIMETRE


@pytest.mark.parametrize(
    ("length", "inches", "thou", "mm"),
    [
        (Length(0.03), "0.0300 in", "30.0 thou", "0.762 mm"),
        (Length(-0.0022, sign=True), "-0.0022 in", "-2.2 thou", "-0.056 mm"),
        (Length(0.0022, sign=True), "+0.0022 in", "+2.2 thou", "+0.056 mm"),
        (Length(0.0005, 5), "0.00050 in", "0.50 thou", "0.0127 mm"),
        (Length(0.01, 2, named=False), "0.01", "10", "0.3"),
        (Length.brief(0.015), "0.015 in", "15 thou", "0.38 mm"),
    ],
)
def test_a_length_keeps_its_resolution_in_every_unit(length, inches, thou, mm):
    said = tuple(length.said_in(unit) for unit in (LengthUnit.INCH, THOU, MM))
    assert said == (inches, thou, mm)


def test_a_length_is_rounded_once_in_the_unit_of_the_reader() -> None:
    assert Length(0.04724).said_in(MM) == "1.200 mm"


def test_a_sentence_is_said_in_the_users_unit() -> None:
    sentence = Sentence.of("gives {} to {}.", Length(0.0472, named=False), Length(0.0473))
    assert sentence.said_in(THOU) == "gives 47.2 to 47.3 thou."


def test_a_sentence_is_kept_as_a_text_in_inches() -> None:
    assert json.dumps(Sentence.of("worst case {}", Length(0.0472))) == '"worst case 0.0472 in"'


def test_a_sentence_within_a_sentence_is_said_in_the_same_unit() -> None:
    inner = Sentence.of("worst case {}", Length(0.0472))
    assert said_in(Sentence.of("Predicted: {}.", inner), THOU) == "Predicted: worst case 47.2 thou."


def test_what_a_person_wrote_stays_as_it_was_written() -> None:
    sentence = Sentence.of("found {}; the margin is {}", "'0.013 in' {}", Length(0.03))
    assert sentence.said_in(THOU) == "found '0.013 in' {}; the margin is 30.0 thou"


def test_a_sentence_without_lengths_may_hold_braces() -> None:
    assert Sentence("as {written}").said_in(THOU) == "as {written}"


def test_joined_sentences_are_said_in_one_unit() -> None:
    joined = Sentence.joined([Sentence.of("{}", Length(0.03)), "and more"], "; ")
    assert joined.said_in(THOU) == "30.0 thou; and more"


def test_a_copied_sentence_still_knows_its_lengths() -> None:
    sentence = copy.deepcopy(Sentence.of("worst case {} {{}}", Length(0.0472)))
    assert sentence.said_in(THOU) == "worst case 47.2 thou {}"


def test_a_unit_may_end_with_a_full_stop_and_no_length_is_below_zero() -> None:
    assert [LengthUnit.parse(unit) for unit in ("in.", "mm.")] == [LengthUnit.INCH, MM]
    assert (with_unit("0.013 in.", MM), with_unit("13", THOU)) == ("0.013 in.", "13 thou")
    with pytest.raises(UsageError):
        parse_length("-0.013 in")


def test_the_slopes_of_a_curve_are_its_derivatives_to_second_order() -> None:
    at = np.array([0.3, 1.1])
    moved = np.sin((at + central_steps(2)) @ np.array([2.0, -1.0]))
    expected = np.cos(2.0 * 0.3 - 1.1) * np.array([2.0, -1.0])
    assert central_slopes(moved) == pytest.approx(expected, abs=1e-9)


def test_values_along_another_axis_with_another_step_give_the_same_slopes() -> None:
    moved = np.exp(0.1 + central_steps(1, 1e-3))
    assert central_slopes(moved.T, 1e-3, axis=1)[0] == pytest.approx(np.exp(0.1), rel=1e-6)
