"""The life of each gear, folded from its kept records: what was found, restored and forecast.

Its modules are its doors: who keeps an inspection needs no forecast, which is slow to import.
"""

__all__ = [
    "folding",
    "forecast",
    "logbook",
    "state",
    "urgency",
]
