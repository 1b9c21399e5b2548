"""Reports on paper and screen: one self-contained HTML file and one PDF per document; the JSON."""

__all__ = [
    "diagnosis_lines",
    "diagnosis_report",
    "fleet_report",
    "inspection_report",
    "json_form",
    "life_json",
    "model_json",
    "provenance",
    "publish",
    "study_report",
    "survey_report",
]
