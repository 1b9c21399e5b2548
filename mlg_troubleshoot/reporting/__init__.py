"""Reports on paper and screen: one self-contained HTML file and one PDF per document; the JSON."""

__all__ = [
    "diagnosis_figures",
    "diagnosis_lines",
    "diagnosis_report",
    "fleet_figures",
    "fleet_report",
    "formats",
    "html",
    "inspection_report",
    "json_form",
    "life_json",
    "model_json",
    "picture",
    "provenance",
    "publish",
    "schematic",
    "study_figures",
    "witness",
]
