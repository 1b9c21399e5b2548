"""Forecasts of wear from irregular inspections of many units; knows no gear."""

from mlg_troubleshoot.wear.model import Samples, WearModel, WearPath, first_passage, fit_wear

__all__ = [
    "Samples",
    "WearModel",
    "WearPath",
    "first_passage",
    "fit_wear",
]
