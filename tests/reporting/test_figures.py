"""The figure primitives that every report draws with."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.figures import (
    Axis,
    Canvas,
    Lengths,
    Plot,
    nice_ticks,
    text_width,
)
from mlg_troubleshoot.reporting.html import environment
from mlg_troubleshoot.reporting.inspection_figures import joint_key, margin_gauge, schematic

from .conftest import FAILURE, SOUND, WORN, Judge

INCHES = Lengths()
SIGNS = environment().get_template("signs.html.j2").module.SIGNS  # type: ignore[attr-defined]


def rectangles(svg: str) -> list[dict[str, str]]:
    return [element.attrib for element in ET.fromstring(svg).iter() if element.tag.endswith("rect")]


@pytest.mark.parametrize("of", SIGNS)
def test_a_sign_is_well_formed(of: str) -> None:
    drawn = environment().get_template("signs.html.j2").module.sign(of)  # type: ignore[attr-defined]
    assert ET.fromstring(drawn.strip()).get("role") == "img"


def test_every_verdict_has_its_own_shape() -> None:
    assert len({SIGNS[verdict.value][0] for verdict in Verdict}) == len(Verdict)
    assert len({SIGNS[verdict][0] for verdict in ("NAMED", "AMBIGUOUS", "UNLISTED", "NONE")}) == 4


def test_text_in_a_figure_is_escaped_and_what_would_reorder_it_is_shown_as_its_code() -> None:
    canvas = Canvas(10, 10, "<script>", "\"'a\u202eb")
    canvas.text(0j, "</svg><script>")
    canvas.text(0j, "N1\u202d2")
    assert "<script>" not in canvas.svg()
    assert not {"\u202e", "\u202d"} & set(canvas.svg())
    assert "N1‹U+202D›2" in canvas.svg()


def test_a_gap_in_a_series_breaks_its_line() -> None:
    canvas = Canvas(100, 80, "t")
    Plot(canvas, Axis("x", 0, 4), Axis("y", 0, 2)).draw(enumerate((1, 1, float("nan"), 1, 1)))
    assert canvas.svg().count("<polyline") == 2


def test_a_plot_puts_the_ends_of_its_axes_on_its_frame() -> None:
    plot = Plot(Canvas(100, 80, "t"), Axis("x", 2.0, 4.0), Axis("y", -1.0, 1.0), 10, 10, 5, 15)
    assert plot.at(2.0, -1.0) == 10 + 65j
    assert plot.at(4.0, 1.0) == 90 + 5j


def test_the_numbers_of_the_vertical_axis_do_not_touch_its_label() -> None:
    canvas = Canvas(335, 236, "t")
    Plot(canvas, Axis("x", 0.0, 1.0), Axis("measured, in", -0.0105, 0.006)).draw_axes()
    (ends,) = {
        float(text.split('x="')[1].split('"')[0])
        for text in canvas.svg().split("<text")
        if 'anchor="end"' in text
    }
    assert ends - text_width("−0.005", 9.5) >= 16.0


def test_an_axis_around_values_holds_them_all() -> None:
    axis = Axis.around("x", [3.0, float("nan"), -2.0])
    assert axis.low < -2.0
    assert axis.high > 3.0


@pytest.mark.parametrize("value", [0.02, -0.02, 3000.0])
def test_an_axis_around_one_value_is_not_wider_than_the_value(value: float) -> None:
    axis = Axis.around("x", [value])
    assert axis.low < value < axis.high
    assert axis.high - axis.low < abs(value)


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_lie_within_their_axis(low: float, span: float) -> None:
    high = low + span
    room = 1e-6 * max(abs(low), abs(high), span)
    assert all(low - room <= tick <= high + room for tick in nice_ticks(low, high))


def test_the_margin_of_the_gauge_is_drawn_to_the_scale_of_the_worst_case(judge: Judge) -> None:
    judged = judge(FAILURE)
    svg = str(margin_gauge(judged, INCHES))
    assert ">−0.0429 / +0.0472</text>" in svg
    assert margin_gauge(judge(dict.fromkeys(range(1, 11), 0.0465)), INCHES) is None
    lines = re.findall(
        r'<line x1="([\d.]+)" y1="([\d.]+)" x2="([\d.]+)" y2="([\d.]+)"[^>]*stroke-width="4"', svg
    )
    (name,) = re.findall(r' y="([\d.]+)"[^>]*>Worst case \(bound\)<', svg)
    assert float(name) - float(lines[0][1]) == pytest.approx(4.0)
    margin = rectangles(svg)[0]
    assert judged.over_travel_in is not None
    assert judged.under_travel_in is not None
    drawn = float(lines[0][2]) - float(lines[0][0])
    expected = (judged.over_travel_in - judged.under_travel_in) / (2 * judged.margin_in)
    assert drawn / float(margin["width"]) == pytest.approx(expected, rel=0.01)


def arrow_lengths(gear: Gear, judge: Judge, clearance: dict[int, float]) -> list[float]:
    """Lengths of the white lines below the arrows."""
    found = "".join(str(svg) for _, svg, _ in schematic(gear, judge(clearance)).panels)
    ends = re.findall(
        r'<line x1="([\d.]+)" y1="([\d.]+)" x2="([\d.]+)" y2="([\d.]+)" stroke="#ffffff"'
        r' stroke-width="5.5"',
        found,
    )
    return [((float(c) - float(a)) ** 2 + (float(d) - float(b)) ** 2) ** 0.5 for a, b, c, d in ends]


def test_virtual_links_are_exaggerated_as_stated(gear: Gear, judge: Judge) -> None:
    three, five = arrow_lengths(gear, judge, FAILURE)
    assert three / five == pytest.approx(0.013 / 0.007, rel=0.02)
    drawn = schematic(gear, judge(FAILURE))
    # Joints 4 and 5 are 4.422 in apart in the reference; their markers tell the scale of the
    # drawing.
    marks = {
        number: float(x)
        for x, number in re.findall(
            r'<text x="([\d.]+)"[^>]*>(4|5)</text>', str(drawn.panels[0][1])
        )
    }
    scale = (marks["5"] - marks["4"]) / 4.422
    assert drawn.exaggeration is not None
    assert three == pytest.approx(0.013 * scale * drawn.exaggeration, rel=0.02)
    # Small clearances are not blown up.
    assert schematic(gear, judge(SOUND)).exaggeration == schematic(gear, judge(WORN)).exaggeration


def test_the_key_of_a_picture_names_the_joints_with_their_clearances(gear: Gear) -> None:
    key = str(joint_key(gear, FAILURE, INCHES))
    assert all(f">{joint.name}" in key for joint in gear.joints)
    assert "short link inner bearing, 0.0130\u00a0in, OVER LIMIT<" in key
    assert key.count("stroke-dasharray") == len(gear.joints) - len(FAILURE)


def test_no_label_of_the_schematic_lies_outside_it(gear: Gear, judge: Judge) -> None:
    for _, svg, width in schematic(gear, judge(WORN)).panels:
        height = float(ET.fromstring(str(svg)).attrib["height"])
        for x, y in re.findall(r'<text x="([-\d.]+)" y="([-\d.]+)"', str(svg)):
            assert 0 <= float(x) <= width
            assert 0 <= float(y) <= height


def test_markers_of_joints_do_not_overlap(gear: Gear, judge: Judge) -> None:
    for _, svg, _ in schematic(gear, judge(WORN)).panels:
        places = [
            (float(x), float(y))
            for x, y, _ in re.findall(
                r'<text x="([\d.]+)" y="([\d.]+)"[^>]*text-anchor="middle">(\d+)</text>', str(svg)
            )
        ]
        for i, (x, y) in enumerate(places):
            assert all((x - a) ** 2 + (y - b) ** 2 > 19.0**2 for a, b in places[:i])
