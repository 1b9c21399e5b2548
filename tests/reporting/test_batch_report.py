"""The summary of a batch, and many reports at once."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import pytest

from mlg_troubleshoot.decision.assessment import Judgement, Rejected
from mlg_troubleshoot.decision.judge_rows import latest_of_each_gear, listed, worst_first
from mlg_troubleshoot.errors import OutputError, Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.html import ReportProvenance
from mlg_troubleshoot.reporting.inspection_report import batch_document
from mlg_troubleshoot.reporting.publish import WrittenReport, publish

from .conftest import FAILURE, SOUND, WORN, Judge, readable, write_reports
from .test_pdf import opened


def write_batch_report(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    folder: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = ("html", "pdf"),
    notes: Sequence[str] = (),
) -> WrittenReport:
    document = batch_document(judgements, problems, gear, provenance, notes)
    (report,) = publish([document], folder, formats=formats)
    return report


PROBLEM = Problem("side", "fleet.csv", None, 7, "side", "C7", "LEFT", "LH or RH", "Write LH or RH.")


@pytest.fixture(scope="module")
def batch(judge: Judge, rejected: Rejected) -> list[Judgement]:
    return [
        judge(SOUND, record_id="sound", tail_no="N1"),
        judge(FAILURE, record_id="published", tail_no="N2"),
        rejected,
        judge(WORN, record_id="worn", tail_no="N3"),
        judge({1: 0.001}, record_id="little", tail_no="N4", readings_in=(0.05,)),
    ]


@pytest.fixture(scope="module")
def summary(
    batch: list[Judgement],
    gear: Gear,
    provenance: ReportProvenance,
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[str, bytes]:
    folder = tmp_path_factory.mktemp("batch")
    written = write_batch_report(
        batch, [PROBLEM], gear, folder, provenance=provenance, notes=("2 columns unread.",)
    )
    assert written.html is not None
    assert written.pdf is not None
    return written.html.read_text(encoding="utf-8"), written.pdf.read_bytes()


def records(html: str) -> list[str]:
    return re.findall(
        r'<th scope="row"><bdi>.*?</bdi></th><td class="strong">..?</td><td'
        r' class="one-line">[-–\d]*</td>'
        r"<td>(?:<a[^>]*>)?<bdi>(.*?)</bdi>",
        html,
    )


def test_each_verdict_is_counted_once_under_its_name(batch, summary):
    counts = [int(n) for n in re.findall(r'class="count-number">(\d+)<', summary[0])]
    assert sum(counts) == len(batch)
    assert re.search(r"2</span><span>COULD BE OUTSIDE", summary[0])


def test_every_gear_has_one_line_what_was_measured_beyond_its_margin_and_the_worst_first(summary):
    assert records(summary[0]) == ["little", "worn", "published", "sound"]


@pytest.mark.parametrize("words", ["LEFT", "cell C7", "2 columns unread."])
def test_the_summary_says_what_is_wrong_with_gears_and_input(words, summary):
    assert words in summary[0] + readable(summary[0])


def test_a_row_that_cannot_be_judged_stands_in_a_list_with_what_to_correct(summary, rejected):
    listed = readable(summary[0]).partition("Rows to correct: 1 could not be judged")[2]
    assert "R-9" in listed
    assert rejected.in_brief in listed


def test_an_action_stands_alone_on_paper(batch, summary):
    words = readable(summary[0])
    assert all(judgement.in_brief in words for judgement in batch)


def test_of_gears_outside_the_margin_the_one_farther_beyond_its_own_stands_first(judge):
    # The gear that moves the plunger farther is allowed to do so.
    wide, narrow = judge(WORN, margin_in=0.05), judge(FAILURE, tail_no="N2")
    assert wide.predicted_displacement_in > narrow.predicted_displacement_in
    assert worst_first(listed([wide, narrow]), [0, 1]) == [1, 0]


def test_the_summary_is_printed_in_landscape(summary: tuple[str, bytes]) -> None:
    box = opened(summary[1]).pages[0].mediabox
    assert box.width > box.height


def test_a_long_table_repeats_its_header_on_each_page(judge, gear, provenance, tmp_path):
    one = judge(SOUND)
    many = [
        dataclasses.replace(one, inspection=dataclasses.replace(one.inspection, record_id=f"r{i}"))
        for i in range(120)
    ]
    written = write_batch_report(many, [], gear, tmp_path, provenance=provenance, formats=("pdf",))
    assert written.pdf is not None
    pages = [page.extract_text() for page in opened(written.pdf.read_bytes()).pages]
    with_rows = [text for text in pages if re.search(r"\br\d+\b", text)]
    assert len(with_rows) > 2
    assert all("Verdict" in text for text in with_rows)


def test_a_batch_gets_its_summary_first_then_a_report_for_each_row_that_was_judged(
    batch, gear, tmp_path
):
    seen: list[tuple[int, int]] = []
    written = write_reports(
        batch, gear, tmp_path, on_written=lambda done, total: seen.append((done, total))
    )
    judged = len(batch) - 1
    assert len(written) == judged + 1
    assert seen == [(n, judged) for n in range(1, judged + 1)]
    names = [report.html.name for report in written if report.html]
    assert names[0].startswith("mlg-batch")
    assert "published" in names[2]
    links = re.findall(r'href="([^"#]+)"', (tmp_path / names[0]).read_text(encoding="utf-8"))
    assert sorted(links) == sorted(names[1:])


def test_a_link_to_a_long_name_leads_there(judge: Judge, gear: Gear, tmp_path: Path) -> None:
    long = [judge(SOUND, tail_no="N" * 40, record_id=f"{n}" * 40) for n in range(2)]
    first = write_reports(long, gear, tmp_path)[0]
    assert first.html is not None
    links = re.findall(r'href="([^"#]+)"', first.html.read_text(encoding="utf-8"))
    assert all(len(link) > 64 and (tmp_path / link).is_file() for link in links)
    assert len(links) == 2


@pytest.fixture(scope="module")
def twice(judge: Judge) -> list[Judgement]:
    """One gear inspected three times, the latest of them not last in the table, and another one
    once.
    """
    days = {"spring": date(2024, 3, 1), "autumn": date(2024, 9, 2), "summer": date(2024, 6, 3)}
    one = [
        judge(FAILURE, record_id=name, inspection_date=day, tail_no="N2")
        for name, day in days.items()
    ]
    return [*one, judge(SOUND, record_id="other", tail_no="N1")]


def test_each_gear_has_one_line_with_its_latest_inspection(twice: list[Judgement]) -> None:
    latest, earlier = latest_of_each_gear(listed(twice))
    named = [
        [j.inspection.record_id for j in (twice[i] for i in places)] for places in (latest, earlier)
    ]
    assert named == [["autumn", "other"], ["spring", "summer"]]


def test_an_inspection_without_a_date_is_not_an_earlier_one(judge, twice):
    undated = judge(SOUND, record_id="undated", tail_no="N2", inspection_date=None)
    latest, earlier = latest_of_each_gear(listed([*twice, undated]))
    assert len(twice) in latest
    assert len(earlier) == 2


def test_of_two_inspections_of_one_day_the_worse_is_shown(judge: Judge) -> None:
    one_day = [judge(values, inspection_date=date(2024, 3, 1)) for values in (FAILURE, SOUND)]
    assert latest_of_each_gear(listed(one_day)) == ([0], [1])


def test_a_repair_hides_no_worse_inspection_of_its_day(judge: Judge) -> None:
    day = date(2024, 3, 1)
    after = judge(SOUND, inspection_date=day, restored_joints=(3,), repair_date=day)
    one_day = [after, judge(FAILURE, inspection_date=day)]
    assert latest_of_each_gear(listed(one_day)) == ([1], [0])


def test_a_gear_that_cannot_be_cleared_has_no_probability_that_would_clear_it(
    judge, gear, provenance, tmp_path
):
    open_joints = [
        judge({3: 0.001}, outcome=None, record_id=name, tail_no=name) for name in ("one", "two")
    ]
    written = write_batch_report(
        open_joints, [], gear, tmp_path, provenance=provenance, formats=("html",)
    )
    assert written.html is not None
    text = readable(written.html.read_text(encoding="utf-8"))
    assert "NOT ENOUGH READ" in text
    assert "99.9" not in text


def test_earlier_inspections_have_a_table_of_their_own(twice, gear, provenance, tmp_path):
    written = write_batch_report(
        twice, [], gear, tmp_path, provenance=provenance, formats=("html",)
    )
    assert written.html is not None
    text = readable(written.html.read_text(encoding="utf-8"))
    first, second = text[text.index("Latest inspection of each gear") :].split(
        "Earlier inspections of the same gears"
    )
    assert "2024-09-02 autumn" in first
    assert "2024-03-01 spring" in second


def test_a_link_in_the_pdf_opens_the_pdf_beside_it(twice, gear, tmp_path):
    written = write_reports(twice, gear, tmp_path, ("pdf",))
    assert written[0].pdf is not None
    actions = [
        note.get_object()["/A"]
        for page in opened(written[0].pdf.read_bytes()).pages
        for note in page.get("/Annots", ())
        if "/A" in note.get_object()
    ]
    files = {action["/F"] for action in actions if action["/S"] == "/GoToR"}
    assert files == {report.pdf.name for report in written[1:] if report.pdf}


def test_inspections_of_the_same_identity_do_not_overwrite_each_other(judge, gear, tmp_path):
    twice = [judge(SOUND), judge(FAILURE)]
    written = write_reports(twice, gear, tmp_path)
    first, second = (report.html.stem for report in written[1:] if report.html)
    assert second == f"{first}-2"


def test_one_inspection_gets_no_summary(judge: Judge, gear: Gear, tmp_path: Path) -> None:
    assert len(write_reports([judge(SOUND)], gear, tmp_path)) == 1


def test_a_folder_that_cannot_be_written_is_named(batch, gear, tmp_path):
    (tmp_path / "taken").write_text("a file", encoding="utf-8")
    with pytest.raises(OutputError, match="taken"):
        write_reports(batch, gear, tmp_path / "taken")
