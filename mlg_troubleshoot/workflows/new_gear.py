"""A gear from nothing: a short form or a linkage of another program in, a gear file out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.short_form import NewGear, read_short_form, short_form
from mlg_troubleshoot.outputs import OutputKind, write_text
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.index_tables import load_index_table

_HEADING = "# Written by mlg gear new.\n"
NEW_GEAR = OutputKind.marked("is not a gear file that mlg gear new wrote", _HEADING)


@dataclass(frozen=True, slots=True)
class WrittenGear:
    """A gear that was written, what was understood, and what was assumed.

    Parameters
    ----------
    gear : Gear
        The gear, as it is read from its file.
    steps : tuple of str
        How each point is located.
    assumed : tuple of str
        What the short form does not state.
    """

    gear: Gear
    steps: tuple[str, ...]
    assumed: tuple[str, ...]


def new_gear(form: Mapping[str, Any] | str | Path, file: str | Path) -> WrittenGear:
    """Write the full gear file of a short form, and its table of indices.

    Parameters
    ----------
    form : mapping, str or Path
        The short form: its values, or its TOML file.
    file : str or Path
        The gear file to write; its table is written next to it.

    Returns
    -------
    WrittenGear
        The gear, how each point is located, and what the short form does not state.

    Raises
    ------
    GearFileError
        If something is wrong or missing; the message says key, value and what to add.
    MechanismError
        If the linkage does not close over its travel.
    """
    found = short_form(form) if isinstance(form, Mapping) else read_short_form(Path(form))
    return _write(found, Path(file))


def from_pylinkage(
    linkage: Any,
    file: str | Path,
    *,
    limit: float,
    margin: float,
    travel_deg: tuple[float, float] = (-10.0, 0.0),
    output: Mapping[str, str] | None = None,
    unit: LengthUnit | str = LengthUnit.INCH,
) -> Gear:
    """Write the gear of a linkage of pylinkage, and its table of indices.

    Parameters
    ----------
    linkage : Linkage, Mechanism, mapping, str or Path
        A `pylinkage.simulation.Linkage` or `Mechanism`, the values of its JSON, or the JSON file.
        It is read in its present position, which must not be flat.
    file : str or Path
        The gear file to write.
    limit, margin : float
        Limit of every joint, and allowed displacement of the output. [in, in or rad]
    travel_deg : tuple of float
        Travel of the crank from its present position; clearances act at its end. A linear
        actuator travels over its stroke instead, to its full extension. [deg]
    output : mapping, optional
        As in a short form; else the last point on a guide, or the last link on the ground.
    unit : LengthUnit or str
        Unit of the coordinates, which a linkage does not state.

    Returns
    -------
    Gear
        The gear.

    Raises
    ------
    GearFileError
        If a part has no counterpart, or the position is flat.
    """
    from mlg_troubleshoot.gear.from_pylinkage import short_form_of

    how: dict[str, Any] = {
        "travel_deg": travel_deg,
        "output": output,
        "unit": LengthUnit.parse(unit),
    }
    form = short_form_of(linkage, limit=limit, margin=margin, **how)
    return _write(short_form(form), Path(file)).gear


def _write(found: NewGear, file: Path) -> WrittenGear:
    text = _HEADING + tomli_w.dumps(found.values)
    # A linkage that does not close over its travel leaves no file.
    found.closes()
    write_text(file, text)
    gear = load_gear(file)
    load_index_table(gear, say=str)
    return WrittenGear(gear, found.steps, found.assumed)
