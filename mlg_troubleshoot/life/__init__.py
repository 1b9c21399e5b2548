"""The life of each gear, folded from its kept records: what was found, restored and forecast.

Its modules are its doors: who keeps an inspection needs no forecast, which is slow to import.
"""

__all__ = [
    "chronology",
    "folding",
    "forecast",
    "judged",
    "landings_left",
    "logbook",
    "looking_back",
    "state",
    "urgency",
    "wear_paths",
]
