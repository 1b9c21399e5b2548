"""The table of indices of a gear, computed again when the geometry changed."""

from __future__ import annotations

import warnings

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import (
    IndexTable,
    StaleTableError,
    read_index_table,
    write_index_table,
)


def renew_index_table(gear: Gear) -> str | None:
    """Compute and write the table of indices of a gear if it is missing or of another geometry, and
    return what to say about it; None if it fits.
    """
    from mlg_troubleshoot.paper.study import StudyOptions, run_study

    try:
        read_index_table(gear)
    except StaleTableError as stale:
        write_index_table(run_study(gear, StudyOptions()).table, gear.indices_file)
        return f"{stale.message}. It was computed again: {gear.indices_file}"
    return None


def load_index_table(gear: Gear) -> IndexTable:
    """Load the table of indices of a gear, renewed with a warning when its geometry changed.

    Parameters
    ----------
    gear : Gear
        The gear.

    Returns
    -------
    IndexTable
        Its table.

    Raises
    ------
    GearFileError
        If the table is not one.
    OutputError
        If a table that no longer fits cannot be written again.
    """
    said = renew_index_table(gear)
    if said is not None:
        warnings.warn(said, stacklevel=2)
    return read_index_table(gear)
