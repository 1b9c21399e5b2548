"""The first page of a result's report, as a notebook shows it."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup, escape

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.notebook.pictures import plot
from mlg_troubleshoot.notebook.tables import to_frame
from mlg_troubleshoot.reporting.diagnosis_report import diagnosis_document
from mlg_troubleshoot.reporting.html import Document, render
from mlg_troubleshoot.reporting.inspection_report import batch_document, inspection_document
from mlg_troubleshoot.reporting.provenance import provenance_of
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.diagnose import DiagnoseResult

# More gears than this are shown as a table: pandas shows its ends.
_MOST_GEARS = 200
_HEIGHT_PX = 900


def page(result: Any) -> str:
    document = _document(result)
    if document is not None:
        # A frame of its own keeps the report's styles from those of the notebook.
        inside = escape(render(document, "A4"))
        return (
            f'<iframe srcdoc="{inside}" title="report" '
            f'style="width:100%;height:{_HEIGHT_PX}px;border:0"></iframe>'
        )
    table = Markup(to_frame(result).to_html(max_rows=20))
    if isinstance(result, Assessment):
        gauge = "" if result.over_travel_in is None else plot(result, "margin").svg
        return f"<p><b>{escape(result.headline)}</b></p>{gauge}{table}"
    return table


def _document(result: Any) -> Document | None:
    if isinstance(result, DiagnoseResult):
        made = provenance_of(result.gear, result.inputs_sha256)
        said = result.problems, result.notes
        return diagnosis_document(
            result.diagnosis, result.gear, made, result.extension, LengthUnit.INCH, *said
        )
    if not isinstance(result, CheckResult) or len(result.judgements) > _MOST_GEARS:
        return None
    made = provenance_of(result.gear, result.inputs_sha256)
    if len(result.judgements) == 1:
        return inspection_document(result.judgements[0], result.gear, made, result.problems)
    return batch_document(result.judgements, result.problems, result.gear, made, result.notes)
