"""A probability is never rounded to a certainty."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.decision.sentences import percent


@pytest.mark.parametrize(
    ("share", "written"),
    [
        (0.0, "0 %"),
        (1e-9, "< 0.1 %"),
        (0.0017, "0.2 %"),
        (0.0249, "2.5 %"),
        (0.2466, "25 %"),
        (0.9849, "98.5 %"),
        (0.9992, "> 99.9 %"),
        (0.99991, "> 99.9 %"),
        (1.0, "100 %"),
    ],
)
def test_a_probability_is_written_as_a_percentage_that_is_not_a_false_certainty(
    share: float, written: str
) -> None:
    assert percent(share) == written
