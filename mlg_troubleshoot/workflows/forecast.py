"""Landings that gears have left, from a table of their inspections or from a store."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from mlg_troubleshoot.workflows.history import Lives, show_fleet
from mlg_troubleshoot.workflows.keep import keep, told_by

if TYPE_CHECKING:
    from mlg_troubleshoot.records.read import Source


def forecast(
    inspections: Source | Store, gear: Gear | str | Path = DEFAULT_GEAR, **declared: Any
) -> Lives:
    """Forecast the landings that each gear has left.

    Parameters
    ----------
    inspections : DataFrame, file or Store
        Inspections of gears over time, with ``gear_landings``; rows that cannot be judged are left
        out.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    **declared
        What `CheckOptions` declares about a table: ``convention="RADIAL"``.

    Returns
    -------
    Lives
        One life per gear with its forecast; ``problems`` of the table. [landings]
    """
    known = load_gear(gear)
    if isinstance(inspections, Store):
        return show_fleet(inspections, known, ahead=True)
    options = CheckOptions(gear=known, advice=False, **declared)
    checked = check_files([inspections], options)
    with TemporaryDirectory() as folder:
        store = Store(Path(folder) / "inspections.sqlite")
        keep(told_by(checked.judgements), store)
        return replace(show_fleet(store, known, ahead=True), problems=checked.problems)
