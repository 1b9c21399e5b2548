"""The table of indices of a gear, computed where the one in its file does not fit."""

from __future__ import annotations

import warnings
from collections.abc import Callable

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable, StaleTableError, read_index_table

# Tables that were computed by this process: nothing is written that nobody asked for.
_COMPUTED: dict[Gear, IndexTable] = {}


def load_index_table(gear: Gear, say: Callable[[str], object] | None = None) -> IndexTable:
    """Load the table of indices of a gear; where there is none of its geometry it is computed, and
    not written.

    Parameters
    ----------
    gear : Gear
        The gear.
    say : callable or None
        Takes what is said of a table that was computed; None warns.

    Returns
    -------
    IndexTable
        Its table.

    Raises
    ------
    GearFileError
        If the table is not one.
    """
    try:
        return read_index_table(gear)
    except StaleTableError as stale:
        if gear not in _COMPUTED:
            from mlg_troubleshoot.paper.study import StudyOptions, run_study

            _COMPUTED[gear] = run_study(gear, StudyOptions()).table
            said = f"{stale.message}. It was computed for this run. {stale.remedy}"
            if say is None:
                warnings.warn(said, stacklevel=2)
            else:
                say(said)
        return _COMPUTED[gear]
