"""What Python shows of results: tables, the documented JSON, pictures and pages."""

from __future__ import annotations

from mlg_troubleshoot.notebook.pages import page
from mlg_troubleshoot.notebook.pictures import plot
from mlg_troubleshoot.notebook.tables import store_frame, to_dict, to_frame
from mlg_troubleshoot.reporting.picture import Picture

__all__ = ["Picture", "page", "plot", "store_frame", "to_dict", "to_frame"]
