"""What the report of one gear must say (the decision rule's list, read from the HTML)."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import datetime

import pytest

from mlg_troubleshoot.decision.assessment import Rejected
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.units import LengthUnit

from .conftest import FAILURE, SOUND, WORN, Judge, Made, inspection

Make = Callable[..., Made]


@pytest.mark.parametrize(
    "words",
    [
        *("COULD BE OUTSIDE", "0.0472 in", "a bound, not a forecast"),
        *("8 joints not measured: #1, #2, #4, #6, #7, #8, #9, #10", "acts like #5"),
        *("Which valve port is affected: not stated", "Handover, open for the next shift"),
        *("Joint limit 0.0075 in radial: assumed", "9f2c" + "ab" * 30),
        "Troubleshooting aid, not maintenance data.",
        "Does not replace the maintenance manual's limits.",
        "Within margin is not an approval for return to service.",
        "not hydraulics, friction, doors, switches or structure",
        *("reconstructed from published figures, not drawing data", "not a validation set"),
        "its position cannot distinguish them",
    ],
)
def test_the_report_of_the_failure_says(words: str, failure: Made) -> None:
    assert words in failure.text


@pytest.mark.parametrize(
    "markup",
    [
        *('<p class="side" aria-hidden="true">LH</p>', ">−0.0300</text>", ">+0.0300</text>"),
        *('<th scope="row">Measured by</th>', '<th scope="row">Independently measured by</th>'),
        *('<th scope="row">Rectified by</th>', '<th scope="row">Inspected by</th>'),
    ],
)
def test_side_margins_and_lines_to_sign_for_stand_in_the_page(markup: str, failure: Made) -> None:
    assert markup in failure.html


@pytest.mark.parametrize(
    "words",
    [
        r"short link inner bearing 0\.0252 in 0\.0126 0\.0075 OVER LIMIT",
        "Entered total play",
        "Measured less predicted, same sense −0\\.0331 in",
    ],
)
def test_readings_of_another_convention_stand_as_entered_and_radial(words: str, worn: Made) -> None:
    assert re.search(words, worn.text)


def test_there_is_one_next_action_that_of_the_decision(judge: Judge, failure: Made) -> None:
    assert failure.html.count('class="action-text"') == 1
    assert judge(FAILURE).next_action.text in failure.text


def test_the_size_to_which_virtual_links_are_drawn_is_stated(failure: Made) -> None:
    said = r"drawn \d+ times its size, in the worst direction for over-travel"
    assert re.search(said, failure.text)


def test_a_repair_set_stands_with_its_minutes_and_what_it_leaves(judge: Judge, worn: Made) -> None:
    best, section = judge(WORN).repair_sets[0], worn.text.split("Repair sets")[1]
    left = f"{best.predicted_displacement_in:.4f} in"
    assert re.search(rf"#3, #4, #5 sure {left} > 99\.9 % < 0\.1 % {best.minutes:.0f} ", section)


def test_identity_stands_before_the_verdict(failure: Made) -> None:
    assert (
        -1
        < failure.text.find("N123AB")
        < failure.text.find("COULD BE OUTSIDE", failure.text.find("R-2024-0117"))
    )


def test_a_repair_that_is_signed_off_stands_with_the_identity(judge: Judge, make: Make) -> None:
    repaired = judge(
        SOUND,
        restored_joints=(3, 5),
        rigging_checked=RiggingCheck.CORRECTED,
        repair_date=datetime(2024, 5, 18, 9, 30, 12),
        measured_again=(3,),
    )
    said = make(repaired, formats=("html",)).text
    assert "Restored #3, #5" in said
    assert "Rigging and lock roller corrected" in said
    assert "Repaired on 2024-05-18 09:30 " in said
    assert "Measured again #3" in said


def test_an_outcome_before_the_repair_is_called_so(judge: Judge, make: Make) -> None:
    repaired = judge(SOUND, restored_joints=(3,), repair_date=datetime(2024, 5, 18, 9, 30))
    assert "Outcome FAILED before repair" in make(repaired, formats=("html",)).text


def test_which_joints_explain_the_displacement_is_said_as_on_the_screen(judge, make):
    found = judge(SOUND, readings_in=(0.002,))
    assert found.posterior is not None
    assert found.posterior.text in make(found, formats=("html",)).text


def test_the_side_is_also_said_in_words(judge: Judge, make: Make) -> None:
    assert (
        "right-hand main landing gear" in make(judge(FAILURE, side=Side.RH), formats=("html",)).text
    )


def test_the_chance_with_random_directions_stands_beside_the_worst_case(failure: Made) -> None:
    found = re.search(r"Chance, random directions (\d+) % of leaving the margin", failure.text)
    assert found is not None
    # One in four of the two measured joints alone, and what unread joints add by their wear.
    assert 25 <= int(found[1]) <= 40


def test_joints_stand_in_the_order_to_inspect_them(judge: Judge, worn: Made) -> None:
    table = worn.html[worn.html.index('<table class="ranked">') :]
    names = [f.name for f in judge(WORN).ranked]
    places = [table.index(name) for name in names]
    assert places == sorted(places)


def test_a_joint_over_its_limit_is_distinguished_by_text_next_to_the_schematic(failure):
    table = failure.html[failure.html.index('<table class="ranked">') :]
    line = next(row for row in table.split("<tr") if "short link inner bearing" in row)
    assert ">0.0130<" in line
    assert ">OVER LIMIT<" in line


def test_a_joint_over_its_limit_is_distinguished_by_shape_in_the_schematic(failure: Made) -> None:
    drawing = failure.html[failure.html.index('<svg class="figure panel"') :]
    number = drawing.index('font-weight="bold" fill="#ffffff" text-anchor="middle">3</text>')
    assert drawing[:number].rsplit("<", 2)[1].count(",") == 4


def test_an_unmeasured_joint_has_a_dashed_mark(failure: Made) -> None:
    drawing = failure.html[failure.html.index('<svg class="figure panel"') :]
    number = drawing.index('text-anchor="middle">1</text>')
    assert "stroke-dasharray" in drawing[:number].rsplit("<", 2)[1]


def test_every_joint_is_numbered_in_the_schematic(gear: Gear, failure: Made) -> None:
    drawings = "".join(re.findall(r'<svg class="figure panel".*?</svg>', failure.html, re.DOTALL))
    assert all(f">{joint.number}</text>" in drawings for joint in gear.joints)


def test_no_repair_table_where_none_was_asked_for(judge: Judge, make: Make) -> None:
    import dataclasses

    assert (
        "Repair sets"
        not in make(dataclasses.replace(judge(FAILURE), repair_sets=None), formats=("html",)).text
    )


def test_the_symptom_of_a_sound_gear_is_the_one_within(gear, judge, make):
    assert gear.cycle is not None
    text = make(judge(SOUND), formats=("html",)).text
    assert gear.cycle.within in text
    assert gear.cycle.beyond not in text


def test_what_stays_open_stands_on_the_first_page_and_in_the_handover(judge, make):
    ended = judge({3: 0.0005}, readings_in=(0.002,), cannot_reach=(4,))
    open_question = ended.plan.open_question or ""
    text = make(ended, formats=("html",)).text
    assert open_question == "#4 cannot be reached and is not read."
    assert -1 < text.find(f"Open: {open_question}") < text.find("in the order to inspect them")
    assert f"Handover, open for the next shift: {open_question}" in text


def test_a_gear_with_nothing_to_do_has_no_table_of_steps(judge: Judge, make: Make) -> None:
    done = judge(dict.fromkeys(range(1, 11), 0.0005), outcome=None)
    assert len(done.plan.steps) == 1
    assert "Expected step" not in make(done, formats=("html",)).text


def test_the_title_of_a_verdict_is_said_once(failure: Made) -> None:
    card = failure.html[failure.html.index('class="card"') :]
    assert card[: card.index('class="action"')].count("COULD BE OUTSIDE") == 1


def test_reconstructed_and_assumed_numbers_are_counted(gear: Gear, failure: Made) -> None:
    assumed = sum(n.kind is SourceKind.ASSUMED for n in gear.numbers)
    assert f"Of {len(gear.numbers)} numbers behind a verdict:" in failure.text
    assert f"{assumed} assumed" in failure.text


def test_warnings_of_the_decision_stand_on_the_report(judge: Judge, failure: Made) -> None:
    warnings = judge(FAILURE).warnings
    assert warnings
    assert all(warning in failure.text for warning in warnings)


def test_many_warnings_are_cut_short_in_front_and_stand_in_full_behind(judge, make):
    many = tuple(f"Remark {i} about this row." for i in range(9))
    warned = judge(FAILURE, warnings=many)
    text = make(warned, formats=("html",)).text
    assert f"{len(warned.warnings) - 2} more warnings under “Warnings”" in text
    assert all(warning in text for warning in many)


def test_an_extension_is_named(judge: Judge, make: Make, provenance: object) -> None:
    import dataclasses

    extended = dataclasses.replace(provenance, extension="rigging_offset of tail N123, sha256 77")  # type: ignore[type-var]
    text = make(judge(FAILURE), formats=("html",), provenance=extended).text
    assert "rigging_offset of tail N123" in text
    assert text.count("Drawn without the extension") == 1


def test_a_linkage_that_does_not_close_still_gets_its_report(judge: Judge, make: Make) -> None:
    text = make(judge(dict.fromkeys(range(1, 11), 0.0465)), formats=("html",)).text
    assert "the linkage does not close: there is no displacement to show" in text


def test_an_invalid_row_says_what_to_correct(rejected: Rejected, make: Make) -> None:
    problem = Problem(
        "side", "fleet.csv", None, 7, "side", "C7", "LEFT", "LH or RH", "Write LH or RH."
    )
    other = Problem("side", "fleet.csv", None, 8, "side", "C8", "UP", "LH or RH", "Write LH or RH.")
    text = make(rejected, formats=("html",), problems=(problem, other)).text
    assert "CANNOT BE JUDGED" in text
    assert "LEFT" in text
    assert "C8" not in text


def test_an_invalid_row_without_a_side_shows_a_question_mark(rejected, make):
    assert '<p class="side" aria-hidden="true">?</p>' in make(rejected, formats=("html",)).html


def test_a_sound_gear_needs_no_repair(judge: Judge, make: Make) -> None:
    section = make(judge(SOUND), formats=("html",)).text.split("Repair sets")[1]
    assert "None needed" in section


def test_the_plunger_is_shown_as_it_was_read_each_time(judge: Judge, make: Make) -> None:
    page = make(judge(SOUND, readings_in=(0.041, 0.004)), formats=("html",)).html
    assert '<td class="n">+0.0410, +0.0040</td>' in page


def test_a_gear_measured_within_its_margin_is_said_neither_to_fail_nor_to_lack_a_repair(
    judge, make
):
    worn = {1: 0.004} | dict.fromkeys(range(2, 11), 0.0045)
    within = judge(worn, readings_in=(0.006,), outcome=Outcome.RETRACTED)
    text = make(within, formats=("html",)).text
    assert within.verdict == "WITHIN_MARGIN"
    assert "None needed" in text.split("Repair sets")[1]
    assert "No set of joints" not in text
    assert "has another cause" not in text
    assert "The verdict was measured. OUTSIDE: a plunger reading that stands is" in text
    assert "Here:" not in text


def test_unread_joints_are_named_where_they_keep_a_repair_from_being_sure(judge, make):
    some = dict.fromkeys((1, 3, 5), 0.006)
    section = make(judge(some, outcome=None), formats=("html",)).text
    assert "No repair set is certain while #2, #4" in section.split("Repair sets")[1]


def test_a_measurement_beyond_the_margin_is_the_verdict_and_stands_large(worn: Made) -> None:
    block = worn.html[worn.html.index('<div class="verdict red measured-first">') :]
    assert re.search(r'<p class="headline">\+0\.0\d+ of', block[:2600])


def test_a_sound_gear_measured_outside_is_not_shown_as_within(judge: Judge, make: Make) -> None:
    text = make(judge(SOUND, readings_in=(0.06,)), formats=("html",)).text
    assert "WITHIN MARGIN" not in text
    assert "OUTSIDE MARGIN, MEASURED +0.0600 of 0.0300 in." in text
    assert re.search(r"Not explained by the joints 0\.0\d+ in", text)


def test_what_follows_is_the_plan_to_its_end(judge: Judge, failure: Made) -> None:
    text = failure.text
    steps = judge(FAILURE).plan.steps
    at = 0
    for step in steps:
        at = text.index(step.text, at) + 1
    for step in steps[1:]:
        if step.minutes:
            assert re.search(rf"{re.escape(step.text)}.{{0,60}}? {step.minutes:.0f} min", text)


def test_each_step_has_a_box_to_tick_and_room_for_a_signature(judge: Judge, failure: Made) -> None:
    steps = judge(FAILURE).plan.steps
    assert failure.html.count('class="tick"') == len(steps) - 1
    assert failure.html.count('class="sign-here"') == len(steps) - 1


def test_an_incomplete_gear_has_no_probability_that_would_clear_it(judge, make):
    judged = judge({3: 0.001}, outcome=None)
    assert judged.verdict == "INCOMPLETE"
    text = make(judged, formats=("html",)).text
    assert "Worst case within margin not known" in text
    assert "99.9 %" not in text[: text.index("Joints in detail")]


def test_the_first_page_says_date_and_manual_reference(judge: Judge, make: Make) -> None:
    text = make(
        judge(FAILURE, carried={"manual_ref": "32-10-05", "manual_rev": "12"}), formats=("html",)
    ).text
    front = text[: text.index("in the order to inspect them")]
    assert "Inspected on 2024-05-17" in front
    assert "Manual 32-10-05 rev. 12" in front
    assert "report made 2024-05-17" in front


@pytest.mark.parametrize(
    ("unit", "shown"), [(LengthUnit.THOU, "47.2 thou"), (LengthUnit.MILLIMETRE, "1.199 mm")]
)
def test_a_report_has_one_unit(unit: LengthUnit, shown: str, judge: Judge, make: Make) -> None:
    text = make(judge(FAILURE, entered={}), formats=("html",), unit=unit).text
    assert shown in text
    assert (
        re.findall(r"\d\.\d+ in\b(?! radially)", text[: text.index("Assumptions and provenance")])
        == []
    )


def test_the_joints_that_explain_a_measured_displacement_have_a_table(gear, table, make):
    (partly,) = assess(
        [inspection({2: 0.001, 4: 0.001}, readings_in=(0.028,))], gear, table, advice=True
    )
    text = make(partly, formats=("html",)).text
    assert "Which joints explain the measured displacement" in text
    assert re.search(r"#3, #5 \d[\d.]*\s%", text)
