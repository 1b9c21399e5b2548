"""From points and links to a mechanism, and what is said when something is wrong."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.errors import GearFileError, MechanismError, UsageError
from mlg_troubleshoot.gear.assembly import DesignSpace
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.geometry.mechanism import Dyad, Guided, Lever, Slider, Slot, needs
from mlg_troubleshoot.indices.index_table import amplification


def limits(*points: str, limit: float = 0.01) -> dict[str, Any]:
    return {point: {"limit": limit} for point in points}


FOUR_BAR: dict[str, Any] = {
    "schema": 2,
    "name": "four-bar",
    "margin": 0.005,
    "source": "textbook",
    "sources": {"textbook": {"kind": "measured", "text": "textbook"}},
    "ground": {"O2": [0.0, 0.0], "O4": [6.0, 0.0]},
    "moving": {"A": [2.0, 0.0], "B": [0.0, 6.708203932499369]},
    "links": {"crank": ["O2", "A"], "coupler": ["A", "B"], "rocker": ["O4", "B"]},
    "input": {"crank": "crank", "travel": [0.0, 30.0]},
    "output": {"angle_of": "rocker"},
    "joints": limits("O2", "A", "B", "O4"),
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
    "joints": limits("1", "2", "3", "C"),
}


# A ram fixed to the ground, whose end pushes a rocker.
RAM: dict[str, Any] = {
    "ground": {"F": [0.0, 0.0], "D": [3.0, 1.0]},
    "moving": {"R": [0.3, 0.4], "P": [1.5, 2.0]},
    "links": {"ram": ["F", "R"], "rod": ["R", "P"], "rocker": ["D", "P"]},
    "guides_deg": {"R": math.degrees(math.atan2(4.0, 3.0))},
    "input": {"actuator": "ram", "travel": [-0.5, 0.2]},
    "output": {"angle_of": "rocker"},
    "joints": limits("R", "P", "D"),
}
PIN = [math.cos(1.0), math.sin(1.0)]
# A Scotch yoke: the pin of the crank runs in the slot of a yoke that slides.
YOKE: dict[str, Any] = {
    "ground": {"O": [0.0, 0.0]},
    "moving": {"A": PIN, "Y": [PIN[0], 0.3]},
    "links": {"crank": ["O", "A"]},
    "guides_deg": {"Y": 0.0},
    "guides": {"Y": [["A", 90.0]]},
    "input": {"crank": "crank", "travel": [-20.0, 0.0]},
    "output": {"position_of": "Y"},
    "joints": limits("A", limit=0.005),
}
# A rod that slides on the coupler of the four-bar, C beside its line.
SLIDING_ROD: dict[str, Any] = {
    "ground": {**FOUR_BAR["ground"], "E": [-2.0, 4.0]},
    "moving": {**FOUR_BAR["moving"], "C": [1.2, 3.0]},
    "links": {**FOUR_BAR["links"], "rod": ["E", "C"]},
    "guides": {"C": [["A", "B"]]},
    "input": {"crank": "crank", "travel": [-10.0, 0.0]},
    "output": {"angle_of": "rod"},
    "joints": limits("A", "B", "C", "E"),
}


def changed(**parts: Any) -> dict[str, Any]:
    return copy.deepcopy(FOUR_BAR) | parts


def gear_of(form: dict[str, Any], folder: Path) -> Gear:
    file = folder / "gear.toml"
    file.write_text(tomli_w.dumps(form))
    return load_gear(file)


def test_a_four_bar_without_what_is_assumed_predicts_as_the_one_that_states_it(tmp_path):
    full = load_gear(Path(__file__).parents[1] / "geometry" / "data" / "four-bar.toml")
    clearance = np.array([[0.004, 0.01, 0.002, 0.007]])
    found, wanted = (worst_case(g.model, clearance) for g in (gear_of(FOUR_BAR, tmp_path), full))
    assert found.over_in[0] == pytest.approx(wanted.over_in[0], rel=1e-12)
    assert found.under_in[0] == pytest.approx(wanted.under_in[0], rel=1e-12)


def located(gear: Gear) -> dict[str, tuple[Any, ...]]:
    """How each point is located, and from which ones."""
    return {step.joint: (type(step), *needs(step)) for step in gear.reference.mechanism.steps}


def test_the_gear_file_on_the_page_is_a_whole_one(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "own-gear.md").read_text("utf-8")
    (tmp_path / "gear.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    gear = load_gear(tmp_path / "gear.toml")
    assert gear.joint_numbers == (1, 2, 3)
    assert gear.model.plunger_amplification() == pytest.approx(1.0, abs=1.0)


def test_each_part_is_understood_in_the_terms_of_the_field(tmp_path: Path) -> None:
    assert located(gear_of(changed(**ACTUATOR), tmp_path)) == {
        "1": (Dyad, "F", "E"),
        "2": (Lever, "1", "E"),
        "3": (Slot, "2", "Q"),
        "C": (Slider, "3"),
    }


def test_the_order_in_which_points_are_written_does_not_matter(tmp_path: Path) -> None:
    backwards = changed(**ACTUATOR) | {"moving": dict(reversed(ACTUATOR["moving"].items()))}
    assert list(located(gear_of(backwards, tmp_path))) == ["1", "2", "3", "C"]


def test_the_actuator_keeps_the_length_that_it_is_driven_to(tmp_path: Path) -> None:
    model = gear_of(changed(**ACTUATOR), tmp_path).model
    place = model.kernel.positions(-0.1, model.kernel.no_clearance())
    reach = math.dist(map(float, place["F"]), map(float, place["1"]))
    assert reach == pytest.approx(math.dist((-3.0, -2.0), (-2.0, 1.5)) - 0.1)


def test_an_actuator_on_a_guide_extends_along_it(tmp_path: Path) -> None:
    kernel = gear_of(changed(**RAM), tmp_path).model.kernel
    extended = np.array([-0.5, -0.2, 0.2])
    x, y = kernel.positions(extended, kernel.no_clearance())["R"]
    assert x == pytest.approx(0.6 * (0.5 + extended), abs=1e-15)
    assert y == pytest.approx(0.8 * (0.5 + extended), abs=1e-15)


def test_a_gear_with_an_actuator_on_a_guide_is_drawn(tmp_path: Path) -> None:
    assert gear_of(changed(**RAM), tmp_path).plot()._repr_svg_().startswith("<svg")


def test_clearance_of_a_lever_is_at_the_link_that_it_moves(tmp_path: Path) -> None:
    mechanism = gear_of(changed(**ACTUATOR), tmp_path).reference.mechanism
    links = {step.joint: step.virtual_links for step in mechanism.steps}
    assert links == {"1": (1,), "2": (), "3": (2,), "C": (3, 4)}


@pytest.mark.parametrize(("name", "times"), [("confirm_above", 2), ("hard_limit", 5)])
def test_readings_are_asked_again_and_refused_at_multiples_of_the_largest_limit(
    name, times, tmp_path
):
    gear = gear_of(changed(joints=limits("A", "B") | limits("O2", limit=0.02)), tmp_path)
    assert getattr(gear, name).value == times * 0.02
    assert "assumed by the authors" in getattr(gear, name).source


def test_an_assumed_number_is_not_counted_as_a_given_one(tmp_path: Path) -> None:
    kinds = [str(n.kind) for n in gear_of(FOUR_BAR, tmp_path).numbers]
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
        ({"input": {"crank": "rod", "travel": [0, 1]}}, r"input\.crank: expected one of the links"),
        (
            {"input": {"crank": "coupler", "travel": [0, 1]}},
            r"links\.coupler: expected one point on",
        ),
        ({"input": {"travel": [0, 1]}}, r"input\.crank: expected the name of a link"),
        ({"output": {"angle_of": "B"}}, r"output\.angle_of: expected one of the links"),
        ({"output": {}}, r"output\.angle_of: expected a link here"),
        ({"joints": {}}, "joints: expected at least one point"),
        ({"joints": limits("Z")}, r"joints\.Z"),
        ({"guides_deg": {"O2": 0.0}}, r"guides_deg\.O2: expected a moving point"),
        ({"slots": {"crank": "nobody"}}, r"slots\.crank: expected one of the points"),
        ({"slots": {"nobody": "A"}}, r"slots\.nobody: expected one of the links"),
        (
            RAM | {"guides_deg": {"R": 10.0}},
            r"guides_deg\.R: expected the direction from F to R: ram pushes along it",
        ),
        (
            RAM | {"guides_deg": {}, "guides": {"R": [["F", "D"]]}},
            r"moving\.R: expected one guide, in guides_deg, and F on the ground",
        ),
    ],
)
def test_what_is_wrong_is_named_with_key_and_what_was_expected(parts, words, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(tomli_w.dumps(changed(**parts)))
    with pytest.raises(GearFileError, match=words) as caught:
        load_gear(file)
    assert caught.value.message.startswith("mine.toml") and caught.value.remedy


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"moving": FOUR_BAR["moving"] | {"B": [8.0, 0.0]}}, "'B' is in line with 'A' and 'O4'"),
        ({"output": {"position_of": "B"}}, "position of 'B', which is not a slider"),
        (
            {"input": {"crank": "crank", "travel": [0.0, 180.0]}}
            | {
                "ground": {"O2": [0.0, 0.0], "O4": [13.0, 0.0]},
                "moving": {"A": [2.0, 0.0], "B": [7.0, 4.9]},
            },
            "closes over only",
        ),
    ],
)
def test_a_linkage_that_cannot_move_is_refused(parts, words, tmp_path):
    with pytest.raises(MechanismError, match=words):
        _ = gear_of(changed(**parts), tmp_path).model


def test_a_yoke_on_a_guide_and_a_pin_moves_as_the_cosine_of_the_crank(tmp_path: Path) -> None:
    kernel = gear_of(changed(**YOKE), tmp_path).model.kernel
    turned = np.array([-0.3, 0.0, 0.2])
    x, y = kernel.positions(turned, kernel.no_clearance())["Y"]
    assert x == pytest.approx(np.cos(1.0 + turned), abs=1e-15)
    assert y == pytest.approx(np.full(3, 0.3))
    found = kernel.output(turned, kernel.no_clearance())
    assert found == pytest.approx(np.cos(1.0 + turned) - math.cos(1.0), abs=1e-15)


def test_clearance_of_the_pin_in_a_yoke_moves_the_yoke_by_as_much(tmp_path: Path) -> None:
    worst = worst_case(gear_of(changed(**YOKE), tmp_path).model, np.array([[0.005]]))
    assert (worst.over_in[0], worst.under_in[0]) == pytest.approx((0.005, -0.005))


@pytest.mark.parametrize("end", [[-2.0, 4.0], [0.3, 2.0]])
def test_a_slider_on_a_link_keeps_its_distance_from_the_link_and_its_rod(end, tmp_path):
    form = SLIDING_ROD | {"ground": {**FOUR_BAR["ground"], "E": end}}
    kernel = gear_of(changed(**form), tmp_path).model.kernel
    rods, distances = [], []
    for turned in (-0.2, 0.0, 0.1):
        found = kernel.positions(turned, kernel.no_clearance())
        a, b, c = (complex(*map(float, found[name])) for name in "ABC")
        rods.append(abs(c - complex(*end)))
        distances.append(((c - a) * (b - a).conjugate()).imag / abs(b - a))
        assert turned or c == pytest.approx(complex(1.2, 3.0))
    assert rods == pytest.approx([rods[1]] * 3)
    assert distances == pytest.approx([distances[1]] * 3)


def test_no_directions_move_a_sliding_rod_beyond_its_worst_case(tmp_path: Path) -> None:
    model = gear_of(changed(**SLIDING_ROD), tmp_path).model
    clearance = np.full((1, 4), 0.01)
    worst = worst_case(model, clearance)
    angles = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, (4, 20_000))
    links = [part * 0.01 for angle in angles for part in (np.cos(angle), np.sin(angle))]
    reached = model.displacement(links)
    assert worst.under_in[0] - 1e-12 <= reached.min() < 0.9 * worst.under_in[0]
    assert 0.9 * worst.over_in[0] < reached.max() <= worst.over_in[0] + 1e-12


def test_the_amplification_of_a_sliding_rod_is_the_derivative_of_its_angle(tmp_path: Path) -> None:
    gear = gear_of(changed(**SLIDING_ROD), tmp_path)
    found = amplification(gear)
    assert found.local_plunger == pytest.approx(found.exact, rel=1e-6)


def test_guides_are_understood_as_dyads(tmp_path: Path) -> None:
    yoke = gear_of(changed(**YOKE), tmp_path).reference.mechanism.step("Y")
    rod = gear_of(changed(**SLIDING_ROD), tmp_path).reference.mechanism.step("C")
    assert yoke == Guided("Y", "A", ("O", 0.0), math.radians(90.0), (1,))
    assert rod == Guided("C", "E", ("A", "B"), virtual_links=(3,))


def test_a_third_guide_of_a_point_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match=r"guides_deg\.Y: .* at most two guides"):
        gear_of(changed(**YOKE | {"guides": {"Y": [["A", 90.0], ["O", "A"]]}}), tmp_path)


def test_a_guide_of_an_unknown_point_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match=r"guides\.Y\[1\]: expected one of the points O, A, Y"):
        gear_of(changed(**YOKE | {"guides": {"Y": [["nobody", 90.0]]}}), tmp_path)


def test_a_linkage_whose_guide_moves_is_not_surveyed(tmp_path: Path) -> None:
    gear = gear_of(changed(**YOKE), tmp_path)
    with pytest.raises(UsageError, match="the guide of Y moves"):
        DesignSpace(gear.reference)


def test_a_gear_with_guides_that_move_is_drawn_with_them(tmp_path: Path) -> None:
    drawn = gear_of(changed(**YOKE), tmp_path).plot().svg
    still = gear_of(changed(**ACTUATOR), tmp_path).plot().svg
    assert drawn.count("<line") > 0 and "actuator" not in drawn and "actuator" in still


@pytest.mark.parametrize("ends", [["A", "B"], ["B", "A"]])
def test_clearance_turns_the_link_that_it_displaces(ends: list[str], tmp_path: Path) -> None:
    """The pins' offsets add to the coupler: it starts beside the crank's tip."""
    parts = {"output": {"angle_of": "coupler"}, "links": FOUR_BAR["links"] | {"coupler": ends}}
    kernel = gear_of(changed(**parts), tmp_path).model.kernel
    links = np.array([0.0, 0.0, 0.003, -0.004, 0.002, 0.006, 0.0, 0.0])
    found = kernel.positions(0.1, links.tolist())
    a, b = (complex(*map(float, found[name])) for name in ("A", "B"))
    start = a + complex(0.005, 0.002)
    assert abs(b - start) == pytest.approx(abs(complex(-2.0, 6.708203932499369)))
    reached = b - start if ends[0] == "A" else start - b
    angle = float(kernel.output(0.1, links.tolist()))
    assert angle == pytest.approx(math.atan2(reached.imag, reached.real), abs=1e-12)
