"""Last inspections that wear does not explain: a restoration without a record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.wear_paths import stretches

# A reading as many standard deviations below the line through those before it is not wear: a
# restoration that nobody recorded. At 4 one in 30,000 sound joints is named. [1]
_DROP = 4


def suggestion(life: GearLife, gear: Gear) -> str:
    """Say that the last inspection looks like an unrecorded restoration; empty if it does not."""
    if life.latest is None:
        return ""
    read = sorted(gear.joint_numbers & life.latest.inspection.clearance_in.keys())
    dropped = [n for n, found in stretches(life, read).items() if _has_dropped(found[-1].placed)]
    if not dropped:
        return ""
    return (
        f"{life.name}: {joint_list(dropped)} read much tighter than before. Restored without a"
        f" record? mlg history repair {life.name} --joint {dropped[0]} --date D"
    )


def _has_dropped(readings: Sequence[tuple[float, float, float]]) -> bool:
    """Whether the last reading lies far below the line through those before it (least squares over
    the landings; their mean where one was read before).
    """
    if len(readings) < 2 or readings[-1][1] >= readings[-2][1]:
        return False
    landings, value, u = np.transpose(readings)
    terms = np.vander(landings / max(abs(landings).max(), 1.0), min(len(readings) - 1, 2))
    weights = terms[-1] @ np.linalg.pinv(terms[:-1])
    below = float(weights @ value[:-1] - value[-1])
    return below >= _DROP * float(np.hypot(u[-1], np.linalg.norm(weights * u[:-1])))
