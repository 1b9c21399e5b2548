"""Reports on paper and screen: one self-contained HTML file and one PDF a document."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mlg_troubleshoot.decision.assessment import Judgement
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.inspection_report import batch_document, inspection_document
from mlg_troubleshoot.reporting.provenance import ReportProvenance, provenance_of
from mlg_troubleshoot.reporting.publish import USUAL_FORMATS, Progress, WrittenReport, publish, publish_all
from mlg_troubleshoot.units import LengthUnit

__all__ = [
    "ReportProvenance",
    "WrittenReport",
    "batch_document",
    "inspection_document",
    "provenance_of",
    "publish",
    "write_reports",
]


def write_reports(  # noqa: PLR0913 - what a batch is, and how and for whom it is printed
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    directory: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    unit: LengthUnit = LengthUnit.INCH,
    notes: Sequence[str] = (),
    before: Sequence[Sequence[Mapping[str, Any]]] = (),
    workers: int | None = None,
    progress: Progress | None = None,
) -> tuple[WrittenReport, ...]:
    """Write a report for each inspection, in parallel, and for a batch the summary that links them.

    Lengths stand in `unit`; `before` is what each gear was like before, side by side with what it is now. `progress`
    is called with the number of reports done and the total. Returns the summary if
    there is not exactly one inspection, then one report for each, in the order of the input; raises `OutputError` if a
    file cannot be written.
    """
    documents = (
        inspection_document(j, gear, provenance, problems, unit, steps)
        for j, steps in zip(judgements, before or [()] * len(judgements), strict=True)
    )
    wanted: dict[str, Any] = {"formats": formats, "page": page}
    reports = publish_all(
        _told_apart(documents), len(judgements), directory, workers=workers, progress=progress, **wanted
    )
    if len(reports) == 1:
        return tuple(reports)
    links = {
        place: (report.html.name if report.html else "", report.pdf.name if report.pdf else "")
        for place, report in enumerate(reports)
    }
    summary = batch_document(judgements, problems, gear, provenance, notes, links, unit)
    return (publish(summary, directory, **wanted), *reports)


def _told_apart(documents: Iterable[Document]) -> Iterator[Document]:
    """Number the files of inspections that carry the same identity: none overwrites another."""
    seen: Counter[str] = Counter()
    for document in documents:
        seen[document.stem] += 1
        again = seen[document.stem]
        yield document if again == 1 else replace(document, stem=f"{document.stem}-{again}")
