"""Mechanisms as data: planes, dyads, levers, slots and sliders, solved in batch. Knows no
aircraft.
"""

__all__ = [
    "kernel",
    "mechanism",
    "program",
]
