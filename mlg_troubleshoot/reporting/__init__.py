"""Reports on paper and screen: one self-contained HTML file and one PDF a document."""

from __future__ import annotations

from mlg_troubleshoot.reporting.inspection_report import batch_document, inspection_document
from mlg_troubleshoot.reporting.provenance import ReportProvenance, provenance_of
from mlg_troubleshoot.reporting.publish import WrittenReport, publish, publish_all

__all__ = [
    "ReportProvenance",
    "WrittenReport",
    "batch_document",
    "inspection_document",
    "provenance_of",
    "publish",
    "publish_all",
]
