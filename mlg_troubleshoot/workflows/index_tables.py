"""The table of indices of a gear, computed again when the geometry changed."""

from __future__ import annotations

import warnings
from collections.abc import Callable

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import (
    IndexTable,
    StaleTableError,
    read_index_table,
    write_index_table,
)


def load_index_table(gear: Gear, say: Callable[[str], object] | None = None) -> IndexTable:
    """Load the table of indices of a gear; one of another geometry is computed again and written.

    Parameters
    ----------
    gear : Gear
        The gear.
    say : callable or None
        Takes what is said of a table that was computed again; None warns.

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
    try:
        return read_index_table(gear)
    except StaleTableError as stale:
        from mlg_troubleshoot.paper.study import StudyOptions, run_study

        write_index_table(run_study(gear, StudyOptions()).table, gear.indices_file)
        said = f"{stale.message}. It was computed again: {gear.indices_file}"
        if say is None:
            warnings.warn(said, stacklevel=2)
        else:
            say(said)
    return read_index_table(gear)
