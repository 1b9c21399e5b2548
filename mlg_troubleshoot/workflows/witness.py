"""Reports as witnesses of the log: what each states of it, and whether that still holds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import judge_lives, lives_of
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.reporting.html import ReportedGear, Witness, program_version, read_witness
from mlg_troubleshoot.store import Record, Store
from mlg_troubleshoot.workflows.check import load_index_table
from mlg_troubleshoot.workflows.history import verify


class Standing(StrEnum):
    """Whether a report still says what the log says."""

    HOLDS = "HOLDS"
    STALE = "STALE"
    VIOLATED = "VIOLATED"


@dataclass(frozen=True, slots=True)
class ReportCheck:
    """What became of a report, and why."""

    standing: Standing
    why: tuple[str, ...]


def witness_of(
    store: Store,
    gear: Gear,
    verdicts: Mapping[GearKey, str | None],
    extension: str | None = None,
) -> Witness:
    """State the log behind a report of some gears, each with its verdict where the report is about
    what stands of it.
    """
    count, head = store.head()
    newest: dict[GearKey, Record] = {}
    for record in store.of_gears(verdicts):
        if record.seq <= count:
            newest[record.tail_no, record.side] = record
    gears = tuple(
        ReportedGear(*key, newest[key].digest, said)
        for key, said in verdicts.items()
        if key in newest
    )
    return Witness(count, head, program_version(), gear.geometry_sha256, gears, extension)


def compare_report(store: Store, gear: Gear, file: Path) -> ReportCheck:
    """Compare a report with the log: VIOLATED if the log no longer holds what the report was made
    from, STALE if facts were added or the verdict is another one today.
    """
    printed = read_witness(file)
    lost = _lost(store, printed)
    if lost:
        return ReportCheck(Standing.VIOLATED, lost)
    changed = tuple(_changed(store, gear, printed))
    return ReportCheck(Standing.STALE if changed else Standing.HOLDS, changed)


def _lost(store: Store, printed: Witness) -> tuple[str, ...]:
    found = verify(store, printed.head)
    if found.broken is not None:
        return (f"record {found.broken.seq} does not fit the chain: {found.broken.why}",)
    if printed.count and found.expected != printed.count:
        return (
            f"the report was made from {printed.count} records, the last with hash"
            f" {printed.head[:10]}; this log of {found.count} records does not hold that one",
        )
    return tuple(found.wrong)


def _changed(store: Store, gear: Gear, printed: Witness) -> Iterable[str]:
    keys = [(each.tail_no, each.side) for each in printed.gears]
    lives = judge_lives(lives_of(store, keys).values(), gear, load_index_table(gear))
    today = {life.key: life.now.verdict for life in lives}
    made = [f"program {printed.program}, now {program_version()}"]
    made += ["another gear file"] * (printed.geometry != gear.geometry_sha256)
    changed = printed.program != program_version() or len(made) > 1
    for each, key in zip(printed.gears, keys, strict=True):
        added = sum(record.seq > printed.count for record in store.of_gears([key]))
        if added:
            yield f"{' '.join(key)}: {added} {'record' if added == 1 else 'records'} added since"
        now = today.get(key)
        if each.verdict not in (None, now) and printed.extension is None:
            why = f" ({', '.join(made)})" if changed else ""
            yield f"{' '.join(key)}: the verdict was {each.verdict}, it is {now} today{why}"
