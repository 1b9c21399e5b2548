"""Last inspections that wear does not explain: a restoration without a record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.life.forecast import Forecast
from mlg_troubleshoot.life.state import GearKey

# A reading as many forecast standard deviations below its forecast is not wear: a restoration that
# nobody recorded. Lower ones name sound joints, one in 30,000 of a normal distribution at 4. [1]
_DROP = 4


def suggestions(keys: Iterable[GearKey], forecasts: Mapping[GearKey, Forecast]) -> list[str]:
    """Name last inspections that look like an unrecorded restoration."""
    sentences = []
    for key in keys:
        dropped = [n for n, z in forecasts[key].departures.items() if z <= -_DROP]
        if dropped:
            name, listed = " ".join(key), joint_list(dropped)
            sentences.append(
                f"{name}: {listed} read much tighter than before. Restored without a"
                f" record? mlg history repair {name} --joint {dropped[0]} --date D"
            )
    return sentences
