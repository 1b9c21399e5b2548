"""Reports on paper and screen: one self-contained HTML file and one PDF per document."""

__all__ = [
    "diagnosis_figures",
    "diagnosis_report",
    "figures",
    "fleet_report",
    "html",
    "inspection_figures",
    "inspection_report",
    "publish",
    "study_figures",
]
