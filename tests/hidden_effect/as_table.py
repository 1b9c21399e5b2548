"""A simulated fleet as the columns that a diagnosis takes; nothing of the label goes along."""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np

from mlg_troubleshoot.diagnosis import DiagnosisTable

_JOINTS = range(1, 11)
_READINGS = ("plunger_displacement_in", "plunger_displacement_2_in", "plunger_displacement_3_in")
_FACTORS = ("tail_no", "side", "gauge_id", "technician_id", "approach")
_QUANTITIES = ("temperature_c", "hydraulic_pressure_psi", "gear_landings")


def as_table(columns: dict[str, list[Any]]) -> DiagnosisTable:
    """Turn the columns of a simulated table into a table for the diagnosis."""
    n = len(columns["record_id"])

    def numbers(name: str) -> np.ndarray:
        cells = columns.get(name)
        if cells is None:
            return np.full(n, np.nan)
        return np.array([np.nan if cell is None else float(cell) for cell in cells])

    quantities = {
        name: values for name in _QUANTITIES if np.isfinite(values := numbers(name)).any()
    }
    first: date | None = None
    if any(columns.get("inspection_date", [])):
        days = [
            None if cell is None else date.fromisoformat(str(cell))
            for cell in columns["inspection_date"]
        ]
        first = min(day for day in days if day is not None)
        quantities["day"] = np.array(
            [np.nan if day is None else (day - first).days for day in days]
        )
    floats = np.column_stack([numbers(f"axial_float_{j}_in") for j in _JOINTS])
    margin = numbers("margin_in")
    gauge = numbers("gauge_u_in")
    declared = numbers("plunger_gauge_u_in")
    return DiagnosisTable(
        clearance_in=np.column_stack([numbers(f"clearance_{j}_in") for j in _JOINTS]),
        readings_in=np.column_stack([numbers(name) for name in _READINGS]),
        record_id=tuple(columns["record_id"]),
        row=np.arange(2, n + 2),
        margin_in=np.where(np.isfinite(margin), margin, 0.03),
        gauge_u_in=np.where(np.isfinite(gauge), gauge, 0.0005),
        quantities=quantities,
        factors={
            name: np.array([cell or "" for cell in columns[name]])
            for name in _FACTORS
            if any(columns.get(name, []))
        },
        axial_float_in=floats if np.isfinite(floats).any() else None,
        first_day=None if first is None else first.isoformat(),
        plunger_gauge_u_in=declared if np.isfinite(declared).any() else None,
    )
