"""Reports on paper and screen: one self-contained HTML file and one PDF per document; the JSON."""

__all__ = [
    "diagnosis_figures",
    "diagnosis_report",
    "figures",
    "fleet_report",
    "html",
    "inspection_figures",
    "inspection_report",
    "json_form",
    "life_json",
    "model_json",
    "publish",
    "study_figures",
]
