"""Clearances that one technician, gauge or aircraft has in the other convention: twice or half of
what was meant.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene, levels
from mlg_troubleshoot.diagnosis.causes.reading import change_date
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import likely_clearances
from mlg_troubleshoot.gear.adjustment import Adjustment

# Rows from which a group can show a convention of its own.
_LEAST_ROWS = 6
# Measured over predicted in the rows of a group, over that of the fleet, from which its convention
# is in doubt. Read clearances are drawn to what wear makes expect: a slip of a factor 2 shows as
# 1.4 to 2, and scatter stays below. [1]
_DOUBT = 1.25
_LABELS = {"technician_id": "technician", "gauge_id": "gauge", "tail_no": "tail"}


class ConventionSlip(Cause):
    """Diametral or total play written as radial in the rows of one technician, gauge or aircraft,
    all of them or for a time, or the reverse.
    """

    name = "convention_slip"
    parameter = "share_of_slip"
    sized = False
    trial = 1.0
    sign = 1
    exact = 1.0
    extends = False
    sentence = (
        "The clearances of {target} stand in another convention than they say (radial against"
        " diametral or total play)"
    )
    inspect = "How those clearances were read and written; the file is left as it is"
    separates = "one joint measured again by another technician with another gauge"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield each group whose readings are far off the fleet's share of their prediction; any
        other group might have been.
        """
        measured = scene.table.measured_in / np.maximum(scene.over_in, 1e-3)
        usual = float(np.median(measured))
        if usual <= 0.0:
            return
        groups = [
            (column, label, value)
            for column, label in _LABELS.items()
            for value in levels(scene.table.texts(column), _LEAST_ROWS)
        ]
        found: list[Candidate] = []
        for column, label, value in groups:
            group = scene.table.factors[column] == value
            own = float(np.median(measured[group])) / usual
            setting = {"column": column, "value": value}
            target = f"{label} {value}"
            if own * _DOUBT < 1.0 or own > _DOUBT:
                factor = 2.0 if own < 1.0 else 0.5
                found.append(Candidate(self, target, setting | {"written_factor": factor}))
            for stretch, rarity in _stretches(scene, group, measured / usual):
                found.append(Candidate(self, target, setting | stretch, rarity=rarity))
        offered = len({candidate.target for candidate in found})
        for candidate in found:
            yield replace(candidate, rarity=candidate.rarity + float(np.log(offered / len(groups))))

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Take the group's clearances as they were meant, and what wear makes expect of all rows
        with them.
        """
        right = likely_clearances(as_meant(scene.table, candidate.setting)).likely_in
        return Adjustment(
            np.maximum(scene.clearance_in + value * (right - scene.clearance_in), 0.0)
        )


def _stretches(
    scene: Scene, group: Mask, over_usual: Array
) -> Iterator[tuple[dict[str, Any], float]]:
    """The days between which a group's readings are furthest off, either way, and the logarithm of
    the share that these are of all that may be chosen.

    Of all stretches the one with the largest sum of how far each row is beyond doubt, in the
    logarithm: it ends where rows are as usual.
    """
    day = scene.table.numbers("day")
    rows = np.flatnonzero(group & np.isfinite(day) & (over_usual > 0.0))
    rows = rows[np.argsort(day[rows], kind="stable")]
    for factor, way in ((2.0, -1.0), (0.5, 1.0)):
        beyond = way * np.log(over_usual[rows]) - np.log(_DOUBT)
        total = np.r_[0.0, np.cumsum(beyond)]
        end = int(np.argmax(total - np.minimum.accumulate(total)))
        first = int(np.argmin(total[: end + 1]))
        days = np.unique(day[rows[first:end]])
        # One visit alone is more likely misread.
        if len(days) > 1 and end - first < len(rows):
            yield (
                {
                    "written_factor": factor,
                    "days": (days[0], days[-1]),
                    "since": change_date(scene, days[0]),
                    "until": change_date(scene, days[-1]),
                },
                -float(np.log(0.5 * len(rows) * (len(rows) + 1))),
            )


def _rows_of(table: DiagnosisTable, setting: Any) -> Mask:
    """Rows of the group, within its days if it has some, shape (n,)."""
    rows = np.asarray(table.factors[setting["column"]] == setting["value"])
    if "days" in setting:
        first, last = setting["days"]
        rows &= (table.quantities["day"] >= first) & (table.quantities["day"] <= last)
    return rows


def as_meant(table: DiagnosisTable, setting: Any) -> DiagnosisTable:
    """The table with the clearances of the group as they were meant."""
    rows = _rows_of(table, setting)
    factor = np.where(rows, 1.0 / setting["written_factor"], 1.0)
    return replace(
        table,
        clearance_in=table.clearance_in * factor[:, None],
        gauge_u_in=table.gauge_u_in * factor,
    )
