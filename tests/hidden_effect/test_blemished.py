"""What the study of blemished fleets counts as right, in the set, near and wrong."""

from __future__ import annotations

from typing import Any

import pytest

from .blemished import judged, summarise
from .simulator import Truth

Name = tuple[str, str | None]
ZEROS: tuple[Name, ...] = (("modification", "base B1"), ("modification", "base B3"))


def truth(*causes: tuple[str, str | None], near: tuple[str, ...] = ()) -> Truth:
    return Truth("zero_by_base", "strong", (), causes, near, [], 1)


def said(*names: tuple[str, str | None]) -> list[dict[str, Any]]:
    return [{"cause": cause, "target": target} for cause, target in names]


STEP = ("date_step", None)
SLIP, BIAS = ("convention_slip", "gauge G-03"), ("gauge_bias", "gauge G-03")


@pytest.mark.parametrize(
    ("names", "also", "hidden", "beside", "counted"),
    [
        ((ZEROS[0],), (), truth(*ZEROS), None, {"right", "in_set"}),
        ((ZEROS[1],), (), truth(*ZEROS), None, {"right", "in_set"}),
        ((ZEROS[0], STEP), (), truth(*ZEROS), None, {"wrong", "in_set"}),
        ((), (ZEROS[0], STEP), truth(*ZEROS), None, {"in_set"}),
        ((BIAS,), (), truth(near=("gauge_bias",)), None, {"near"}),
        ((STEP,), (), truth(SLIP, STEP), "date_step", {"right", "in_set"}),
        ((STEP,), (), truth(), None, {"wrong"}),
    ],
    ids=["a base", "another", "beside", "offered", "partly true", "blemish", "nothing"],
)
def test_a_name_is_right_in_the_set_near_or_wrong(names, also, hidden, beside, counted):
    found = judged("NAMED", said(*names), said(*also), hidden, beside)
    assert {key for key in ("right", "in_set", "near", "wrong") if found[key]} == counted


def test_a_table_without_a_verdict_has_no_answer() -> None:
    assert judged(None, [], [], truth())["verdict"] == "NO ANSWER"


def test_an_extension_is_worse_only_where_unseen_rows_lose() -> None:
    record: dict[str, Any] = {"case": "round", "form": "mild", "beside": None, "condition": []}
    record |= judged("NAMED", said(("date_step", None)), [], truth())
    records = [record | {"unseen": pair} for pair in ((None, None), (0.2, 0.1), (0.1, 0.2))]
    assert summarise(records)["an extension that makes unseen rows worse"]["rate"] == 1 / 3
