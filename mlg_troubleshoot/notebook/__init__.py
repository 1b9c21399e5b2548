"""What Python shows of results: tables, the documented JSON, and a picture of each."""

from __future__ import annotations

from mlg_troubleshoot.notebook.pictures import plot
from mlg_troubleshoot.notebook.tables import html, store_frame, to_frame
from mlg_troubleshoot.reporting.publish import Picture

__all__ = [
    "Picture",
    "html",
    "plot",
    "store_frame",
    "to_frame",
]
