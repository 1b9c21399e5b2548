"""Reports on paper and screen: one self-contained HTML file and one PDF a document."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Rejected
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.batch_context import batch_context
from mlg_troubleshoot.reporting.context import inspection_context, rejected_context
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.publish import (
    FORMATS,
    PAGES,
    USUAL_FORMATS,
    Progress,
    WrittenReport,
    publish,
    publish_all,
    safe_stem,
)

__all__ = [
    "FORMATS",
    "PAGES",
    "USUAL_FORMATS",
    "Document",
    "Progress",
    "ReportProvenance",
    "WrittenReport",
    "batch_document",
    "inspection_document",
    "publish",
    "publish_all",
    "safe_stem",
    "write_batch_report",
    "write_inspection_report",
    "write_reports",
]


def inspection_document(
    judgement: Judgement, gear: Gear, provenance: ReportProvenance, problems: Iterable[Problem] = ()
) -> Document:
    """Make the document of one inspection.

    Parameters
    ----------
    judgement : Assessment or Rejected
        The decision, or the row that could not be judged.
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.
    problems : iterable of Problem, optional
        Problems of the input; a rejected row shows its own.

    Returns
    -------
    Document
        The document, not yet rendered.
    """
    if isinstance(judgement, Rejected):
        row = judgement.row
        where = (row.source.file, row.source.sheet, None if row.source.row is None else str(row.source.row))
        stem = safe_stem(row.tail_no, row.side.value if row.side else None, row.record_id, *where)
        return Document("rejected.html.j2", rejected_context(judgement, gear, provenance, problems), stem)
    inspection = judgement.inspection
    stem = safe_stem(inspection.tail_no, inspection.side.value, inspection.record_id)
    return Document("inspection.html.j2", inspection_context(judgement, gear, provenance), stem)


def write_inspection_report(
    judgement: Assessment | Rejected,
    gear: Gear,
    directory: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    problems: Iterable[Problem] = (),
) -> WrittenReport:
    """Write the report of one inspection.

    Parameters
    ----------
    judgement : Assessment or Rejected
        The decision, or the row that could not be judged.
    gear : Gear
        The gear type.
    directory : Path
        Folder; it is made if it is missing.
    provenance : ReportProvenance
        Program, inputs and moment.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged). Where no PDF can be made, the HTML is written in its
        place and a note says so.
    page : str
        ``A4`` or ``Letter``.
    problems : iterable of Problem, optional
        Problems of the input; a rejected row shows its own.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    document = inspection_document(judgement, gear, provenance, problems)
    return publish(document, directory, formats=formats, page=page, created=provenance.created)


def batch_document(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    provenance: ReportProvenance,
    notes: Sequence[str] = (),
    links: Mapping[int, str] | None = None,
) -> Document:
    """Make the document of a batch summary.

    Parameters
    ----------
    judgements : sequence of Assessment or Rejected
        One a data row, in the order of the input.
    problems : sequence of Problem
        Problems of the input.
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.
    notes : sequence of str, optional
        What the reader noticed about the whole input.
    links : mapping of int to str, optional
        File name of each gear's own report, by its place in `judgements`.

    Returns
    -------
    Document
        The document, not yet rendered.
    """
    context = batch_context(judgements, problems, gear, provenance, notes, links)
    stem = safe_stem("batch", *(Path(name).name for name in provenance.input_sha256))
    return Document("batch.html.j2", context, stem, landscape=True)


def write_batch_report(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    directory: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    notes: Sequence[str] = (),
) -> WrittenReport:
    """Write the summary of a batch: how many of each verdict, then one line a gear, worst first.

    Parameters
    ----------
    judgements : sequence of Assessment or Rejected
        One a data row, in the order of the input.
    problems : sequence of Problem
        Problems of the input.
    gear : Gear
        The gear type.
    directory : Path
        Folder; it is made if it is missing.
    provenance : ReportProvenance
        Program, inputs and moment.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged).
    page : str
        ``A4`` or ``Letter``, in landscape.
    notes : sequence of str, optional
        What the reader noticed about the whole input.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    document = batch_document(judgements, problems, gear, provenance, notes)
    return publish(document, directory, formats=formats, page=page, created=provenance.created)


def write_reports(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    directory: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    notes: Sequence[str] = (),
    workers: int | None = None,
    progress: Progress | None = None,
) -> tuple[WrittenReport, ...]:
    """Write a report for each inspection, in parallel, and for a batch the summary that links them.

    Parameters
    ----------
    judgements : sequence of Assessment or Rejected
        One a data row, in the order of the input.
    problems : sequence of Problem
        Problems of the input.
    gear : Gear
        The gear type.
    directory : Path
        Folder; it is made if it is missing.
    provenance : ReportProvenance
        Program, inputs and moment.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged).
    page : str
        ``A4`` or ``Letter``.
    notes : sequence of str, optional
        What the reader noticed about the whole input.
    workers : int, optional
        Child processes for PDFs; the number of processors, at most 4, if not given.
    progress : callable, optional
        Called with the number of reports done and the total, from worker threads, one at a time.

    Returns
    -------
    tuple of WrittenReport
        The summary if there is not exactly one inspection, then one report for each, in the order of the input.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    documents = (inspection_document(j, gear, provenance, problems) for j in judgements)
    reports = publish_all(
        _told_apart(documents),
        len(judgements),
        directory,
        formats=formats,
        page=page,
        created=provenance.created,
        workers=workers,
        progress=progress,
    )
    if len(reports) == 1:
        return tuple(reports)
    links = {i: report.html.name for i, report in enumerate(reports) if report.html is not None}
    summary = publish(
        batch_document(judgements, problems, gear, provenance, notes, links),
        directory,
        formats=formats,
        page=page,
        created=provenance.created,
    )
    return (summary, *reports)


def _told_apart(documents: Iterable[Document]) -> Iterator[Document]:
    """Number the files of inspections that carry the same identity: none overwrites another."""
    seen: Counter[str] = Counter()
    for document in documents:
        seen[document.stem] += 1
        again = seen[document.stem]
        yield document if again == 1 else replace(document, stem=f"{document.stem}-{again}")
