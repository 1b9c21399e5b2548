"""An independent simulator of inspected landing gears: draws a fleet, hides effects in it, keeps
the label.

It shares nothing with the program that it tests but the coordinates of the joints.
"""

from .blemishes import BLEMISHES, FORMS, Truth, blemished_fleet, write_rows
from .causes import CATALOGUE, OFF_CATALOGUE
from .departures import DEPARTURES
from .generate import (
    KINDS,
    NULLS,
    Effect,
    EffectSpec,
    Fleet,
    FleetSpec,
    Label,
    draw_fleet,
    draw_spec,
    follow_up,
    simulate_fleet,
    write_csv,
)
from .records import COLUMNS, FAULT_KINDS, Fault

__all__ = [
    "BLEMISHES",
    "CATALOGUE",
    "COLUMNS",
    "DEPARTURES",
    "FAULT_KINDS",
    "FORMS",
    "KINDS",
    "NULLS",
    "OFF_CATALOGUE",
    "Effect",
    "EffectSpec",
    "Fault",
    "Fleet",
    "FleetSpec",
    "Label",
    "Truth",
    "blemished_fleet",
    "draw_fleet",
    "draw_spec",
    "follow_up",
    "simulate_fleet",
    "write_csv",
    "write_rows",
]
