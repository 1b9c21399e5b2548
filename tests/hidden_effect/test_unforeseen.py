"""What nobody listed: columns of a table's own, the scale of one gear or gauge, two lots of
aircraft, and rough data.
"""

from __future__ import annotations

import pytest

from .unforeseen import KINDS, run

EVERY_DAY = ("humidity", "bent_link", "nothing")
ALL = [pytest.param(kind, marks=() if kind in EVERY_DAY else pytest.mark.slow) for kind in KINDS]


@pytest.mark.parametrize("kind", ALL)
def test_what_is_hidden_is_found_by_its_column_or_name_and_rough_data_name_nothing(kind):
    found = run((64_100_002, kind))
    other = "in the set" if KINDS[kind][1] else "alarm"
    assert found["grade"] in {"right", other}, found
