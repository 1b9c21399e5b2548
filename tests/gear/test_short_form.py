"""A gear from nothing: what a short form becomes, and what is said when something is wrong."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.errors import GearFileError, MechanismError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.short_form import read_short_form, short_form

FOUR_BAR: dict[str, Any] = {
    "name": "four-bar",
    "margin": 0.005,
    "source": {"kind": "assumed", "text": "textbook"},
    "ground": {"O2": [0.0, 0.0], "O4": [6.0, 0.0]},
    "moving": {"A": [2.0, 0.0], "B": [0.0, 6.708203932499369]},
    "links": {"crank": ["O2", "A"], "coupler": ["A", "B"], "rocker": ["O4", "B"]},
    "input": {"crank": "crank", "travel": [0.0, 30.0]},
    "output": {"angle_of": "rocker"},
    "joints": {"O2": 0.01, "A": 0.01, "B": 0.01, "O4": 0.01},
}
ACTUATOR = {
    "ground": {"F": [-3.0, -2.0], "E": [0.0, 0.0], "Q": [3.0, 2.5]},
    "moving": {"1": [-2.0, 1.5], "2": [1.5, 1.5], "3": [3.5, 0.5], "C": [6.0, -0.5]},
    "links": {
        "jack": ["F", "1"],
        "bellcrank": ["E", "1", "2"],
        "lever": ["Q", "3"],
        "rod": ["3", "C"],
    },
    "slots": {"lever": "2"},
    "guides_deg": {"C": -20.0},
    "input": {"actuator": "jack", "travel": [-0.2, 0.0]},
    "output": {"position_of": "C"},
    "joints": {"1": 0.01, "2": 0.01, "3": 0.01, "C": 0.01},
}


def changed(**parts: Any) -> dict[str, Any]:
    return copy.deepcopy(FOUR_BAR) | parts


def gear_of(form: dict[str, Any], folder: Path) -> Gear:
    file = folder / "gear.toml"
    file.write_text(tomli_w.dumps(short_form(form).values))
    return load_gear(file)


def test_a_short_four_bar_predicts_as_the_one_that_is_written_in_full(tmp_path: Path) -> None:
    full = load_gear(Path(__file__).parents[1] / "geometry" / "data" / "four-bar.toml")
    clearance = np.array([[0.004, 0.01, 0.002, 0.007]])
    found, wanted = (worst_case(g.model, clearance) for g in (gear_of(FOUR_BAR, tmp_path), full))
    assert found.over_in[0] == pytest.approx(wanted.over_in[0], rel=1e-12)
    assert found.under_in[0] == pytest.approx(wanted.under_in[0], rel=1e-12)


def test_each_part_is_understood_in_the_words_of_the_field() -> None:
    assert short_form(changed(**ACTUATOR)).steps == (
        "1: dyad RRR: jack from F, bellcrank from E",
        "2: rigid on bellcrank with E and 1",
        "3: lever about Q, turned by pin 2 in its slot",
        "C: dyad RRP: rod from 3, guide at -20°",
    )


def test_the_order_in_which_points_are_written_does_not_matter() -> None:
    backwards = changed(**ACTUATOR) | {"moving": dict(reversed(ACTUATOR["moving"].items()))}
    steps = short_form(backwards).values["steps"]
    assert [step["joint"] for step in steps] == ["1", "2", "3", "C"]


def test_the_actuator_keeps_the_length_that_it_is_driven_to(tmp_path: Path) -> None:
    model = gear_of(changed(**ACTUATOR), tmp_path).model
    place = model.kernel.positions(-0.1, model.kernel.no_clearance())
    reach = math.dist(map(float, place["F"]), map(float, place["1"]))
    assert reach == pytest.approx(math.dist((-3.0, -2.0), (-2.0, 1.5)) - 0.1)


def test_clearance_of_a_lever_is_at_the_link_that_it_moves(tmp_path: Path) -> None:
    mechanism = gear_of(changed(**ACTUATOR), tmp_path).reference.mechanism
    links = {step.joint: step.virtual_links for step in mechanism.steps}
    assert links == {"1": (1,), "2": (), "3": (2,), "C": (3, 4)}


def test_what_is_not_stated_is_assumed_and_named() -> None:
    assert any("10 min" in text for text in short_form(FOUR_BAR).assumed)


def test_an_assumed_number_is_not_counted_as_a_given_one(tmp_path: Path) -> None:
    given = changed(source={"kind": "measured", "text": "bench"})
    kinds = [str(n.kind) for n in gear_of(given, tmp_path).numbers]
    assert "assumed" in kinds and "measured" in kinds


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        (
            {"links": {"crank": ["O2", "A"], "rocker": ["O4", "B"]}},
            r"moving\.B: nothing locates.*rocker",
        ),
        (
            {"links": FOUR_BAR["links"] | {"bar": ["B", "X"]}},
            r"links\.bar.*O2, O4, A, B, found 'X'",
        ),
        ({"links": FOUR_BAR["links"] | {"bar": ["B"]}}, r"links\.bar"),
        (
            {"input": {"crank": "rod", "travel": [0, 1]}},
            r"input\.crank: expected one of the links",
        ),
        (
            {"input": {"crank": "coupler", "travel": [0, 1]}},
            r"links\.coupler: expected one point on",
        ),
        ({"input": {"crank": "crank", "travel": [1, 1]}}, r"input\.travel: expected two different"),
        ({"input": {"travel": [0, 1]}}, r"input\.crank: expected the name of a link"),
        ({"output": {"position_of": "B"}}, r"output\.position_of: expected a point with a guide"),
        ({"output": {"angle_of": "B"}}, r"output\.angle_of: expected one of the links"),
        ({"output": {}}, r"output\.angle_of: expected a link here"),
        ({"joints": {}}, "joints: expected at least one point"),
        ({"joints": {"Z": 0.01}}, r"joints\.Z"),
        ({"joints": {"A": -1.0}}, r"joints\.A: expected a number above 0"),
        (
            {"moving": FOUR_BAR["moving"] | {"O2": [0, 0]}},
            r"moving\.O2: expected a point that is not",
        ),
        (
            {"moving": FOUR_BAR["moving"] | {"B": [8.0, 0.0]}},
            r"moving\.B.*off the line from A to O4",
        ),
        ({"moving": FOUR_BAR["moving"] | {"B": [1e300, 0.0]}}, r"moving\.B"),
        ({"guides_deg": {"O2": 0.0}}, r"guides_deg\.O2: expected a moving point"),
        ({"slots": {"crank": "nobody"}}, r"slots\.crank: expected one of the points"),
        ({"slots": {"nobody": "A"}}, r"slots\.nobody: expected one of the links"),
        ({"masses": {}}, "masses: expected a known key"),
        ({"name": "a\nb"}, "name"),
    ],
)
def test_what_is_wrong_is_named_with_key_and_what_was_expected(
    parts: dict[str, Any], words: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(tomli_w.dumps(changed(**parts)))
    with pytest.raises(GearFileError, match=words) as caught:
        read_short_form(file)
    assert caught.value.message.startswith("mine.toml") and caught.value.remedy


def test_a_linkage_that_does_not_close_over_its_travel_is_refused() -> None:
    wide = changed(input={"crank": "crank", "travel": [0.0, 30.0]})
    wide["ground"]["O4"] = [13.0, 0.0]
    wide["moving"]["B"] = [7.0, 4.9]
    wide["input"]["travel"] = [0.0, 180.0]
    with pytest.raises(MechanismError, match="closes over only"):
        short_form(wide).closes()
