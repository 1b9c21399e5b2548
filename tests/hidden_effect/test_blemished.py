"""What the study of blemished fleets counts as right, in the set, near and wrong."""

from __future__ import annotations

from typing import Any

import pytest

from .blemished import judged, summarise
from .simulator import Truth

ZEROS = (("modification", "base B1"), ("modification", "base B3"))


def truth(*causes: tuple[str, str | None], near: tuple[str, ...] = ()) -> Truth:
    return Truth("zero_by_base", "strong", (), causes, near, [], 1)


def said(*names: tuple[str, str | None]) -> list[dict[str, Any]]:
    return [{"cause": cause, "target": target} for cause, target in names]


@pytest.mark.parametrize("name", ZEROS)
def test_either_of_two_bases_is_right(name: tuple[str, str]) -> None:
    assert judged("NAMED", said(name), [], truth(*ZEROS))["right"]


def test_a_name_beside_the_right_one_is_wrong() -> None:
    names = said(ZEROS[0], ("date_step", None))
    found = judged("NAMED", names, [], truth(*ZEROS))
    assert (found["right"], found["wrong"]) == (False, True)


def test_a_cause_that_is_offered_is_in_the_set_and_not_right() -> None:
    found = judged("AMBIGUOUS", [], said(ZEROS[0], ("date_step", None)), truth(*ZEROS))
    assert (found["right"], found["in_set"], found["wrong"]) == (False, True, False)


def test_a_name_that_is_partly_true_is_near_and_not_wrong() -> None:
    hidden = truth(near=("gauge_bias",))
    found = judged("NAMED", said(("gauge_bias", "gauge G-03")), [], hidden)
    assert (found["right"], found["near"], found["wrong"]) == (False, True, False)


def test_beside_a_blemish_only_the_listed_cause_is_asked_for() -> None:
    hidden = truth(("convention_slip", "gauge G-03"), ("date_step", None))
    found = judged("NAMED", said(("date_step", None)), [], hidden, "date_step")
    assert (found["right"], found["wrong"]) == (True, False)


def test_any_name_in_a_fleet_without_a_cause_is_wrong() -> None:
    assert judged("NAMED", said(("date_step", None)), [], truth())["wrong"]


def test_a_table_without_a_verdict_has_no_answer() -> None:
    assert judged(None, [], [], truth())["verdict"] == "NO ANSWER"


def test_an_extension_is_worse_only_where_unseen_rows_lose() -> None:
    record: dict[str, Any] = {"case": "round", "form": "mild", "beside": None, "condition": []}
    record |= judged("NAMED", said(("date_step", None)), [], truth())
    records = [record | {"unseen": pair} for pair in ((None, None), (0.2, 0.1), (0.1, 0.2))]
    assert summarise(records)["an extension that makes unseen rows worse"]["rate"] == 1 / 3
