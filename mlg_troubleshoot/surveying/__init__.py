"""The geometry of a gear from readings of a real one."""

from mlg_troubleshoot.surveying.survey import SurveyResult, survey

__all__ = [
    "SurveyResult",
    "survey",
]
