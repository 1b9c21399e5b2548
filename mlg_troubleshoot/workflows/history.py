"""A gear's life: keep what was found, show it again, forecast it, and correct what was wrong."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cached_property, partial
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Rejected, Verdict
from mlg_troubleshoot.decision.chronology import Moment, contradictions, in_order
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.order import WORST_FIRST
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.outputs import SCHEMA_VERSION
from mlg_troubleshoot.records import ReadOptions, admit
from mlg_troubleshoot.records.gate import judge_text
from mlg_troubleshoot.records.rows import place_in_file
from mlg_troubleshoot.store import (
    Added,
    Broken,
    Kind,
    Record,
    Store,
    StoreError,
    inspection_from,
    inspection_record,
    packed,
    same_inspection,
)
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.wear import Samples, WearModel, WearPath, fit_wear
from mlg_troubleshoot.workflows.check import CheckOptions, CheckResult

if TYPE_CHECKING:
    from mlg_troubleshoot.reporting import WrittenReport

GearKey = tuple[str, str]
# Letters of a hash by which a record may be named. [1]
_LEAST_OF_A_HASH = 6
# An exported chain, which is judged in 5 s, and its longest line. [bytes, characters]
_MOST_BYTES, _LONGEST_LINE = 120_000_000, 4_000_000
# Where a forecast stands between the last inspection and the horizon. [1]
_AHEAD = np.concatenate([[0.0], np.geomspace(0.00125, 1.0, 28)])
# Where the gear's model is asked about the worst case of clearances that go on to wear. [landings]
_ASKED = _AHEAD[[0, 8, 14, 18, 22, 25, 28]]
_GEARS_AT_ONCE = 100
# Stands for the worst case of a linkage that does not close: beyond any margin. [in]
_NOT_CLOSING_IN = 1e3
# A drop of this many forecast standard deviations is not wear: a restoration that nobody recorded.
# [1]
_DROP = 4.0
# Two gears that both fit their own wear as badly as this share of sound ones, and each other's
# better by this much of the log likelihood, were exchanged. [1]
_POOR, _EXCHANGED = 0.02, 8.0
# An inspection that fits another gear's wear as badly as this was not taken there: without it a
# restored gear passed for exchanged in 3 of 20 fleets of 100. [1]
_NO_FIT = 0.001


@dataclass(frozen=True)
class Seen:
    """An inspection as it stands after corrections, with the last assessment of it; unpacked when
    it is asked for.
    """

    record: Record
    assessed: Record | None = None

    @cached_property
    def inspection(self) -> Inspection:
        return inspection_from(self.record)

    @cached_property
    def result(self) -> Mapping[str, Any]:
        """What the check said, in the form of its JSON; empty if it was never judged."""
        return {} if self.assessed is None else self.assessed.body["result"]


@dataclass(frozen=True)
class GearLife:
    """What stands of one gear: inspections and repairs in the order of time, outcomes, and every
    record as it came.

    warnings: the records whose dates and landings disagree, and how to correct them; with any there
    is no forecast.
    """

    key: GearKey
    records: tuple[Record, ...]
    events: tuple[Seen | Record, ...]
    outcomes: tuple[Record, ...]
    warnings: tuple[str, ...]

    @cached_property
    def inspections(self) -> tuple[Seen, ...]:
        return tuple(event for event in self.events if isinstance(event, Seen))

    @cached_property
    def repairs(self) -> tuple[Record, ...]:
        return tuple(event for event in self.events if isinstance(event, Record))

    @property
    def latest(self) -> Seen | None:
        return self.inspections[-1] if self.inspections else None


@dataclass(frozen=True, slots=True)
class Forecast:
    """Landings that remain from a gear's last inspection, of the joints ever read; infinite beyond
    the horizon.

    limit_joint: the joint that most often is the first at its limit.
    due_now: why nothing remains, in words; empty where something may.
    """

    joints: Mapping[int, Samples] = field(default_factory=dict)
    limit: Samples | None = None
    limit_joint: int | None = None
    margin: Samples | None = None
    next_inspection: float | None = None
    due_now: str = ""


@dataclass(frozen=True, slots=True)
class Advice:
    """How often the joint that was found stood in the advice, with a 90 % interval (Jeffreys)."""

    right: int
    asked: int

    @property
    def interval(self) -> tuple[float, float]:
        from scipy.special import betaincinv

        a, b = self.right + 0.5, self.asked - self.right + 0.5
        low, high = (float(betaincinv(a, b, p)) for p in (0.05, 0.95))
        return (0.0 if self.right == 0 else low), (1.0 if self.right == self.asked else high)

    @property
    def words(self) -> str:
        if not self.asked:
            return "No outcome was recorded against the advice yet."
        low, high = self.interval
        return (
            f"The advice was right in {self.right} of {self.asked} outcomes that name a joint "
            f"({low:.0%} to {high:.0%} with 90 % confidence)."
        )

    def describe(self) -> dict[str, int | float | None]:
        """The hit rate as JSON; its interval is null where no outcome names a joint."""
        low, high = self.interval if self.asked else (None, None)
        return {"right": self.right, "outcomes": self.asked, "p05": low, "p95": high}


@dataclass(frozen=True, slots=True)
class Kept(Added):
    """What was added, and which records of these gears now disagree in dates and landings."""

    warnings: tuple[str, ...]


def keep(
    result: CheckResult,
    options: CheckOptions,
    store: Store,
    same_tail: Callable[[str, str], bool] | None = None,
) -> Kept:
    """Add the judged inspections of a check and their assessments, all or none.

    ``same_tail`` answers whether two spellings of a tail number mean one aircraft; without it they
    are refused.
    """
    judged = [j for j in result.judgements if isinstance(j, Assessment)]
    tails = _settled_tails(judged, store, same_tail)
    written = [
        replace(j.inspection, tail_no=tails.get(j.inspection.tail_no, j.inspection.tail_no))
        for j in judged
    ]
    found = [inspection_record(inspection) for inspection in _under_first_ids(written, store)]
    known = store.known([record.identity_hash for record in found])
    records: list[Record] = []
    for assessment, record in zip(judged, found, strict=True):
        # Wherever an inspection was entered again, it is the first entry that was assessed.
        first = known.setdefault(record.identity_hash, record)
        records += [record, _assessment(result.gear, options, assessment, record, first)]
    added = store.add(
        records, lambda kept, new: new.kind is not Kind.INSPECTION or _agrees(store, kept, new)
    )
    return Kept(
        added.new, added.known, tuple(warnings_of(store, {(r.tail_no, r.side) for r in records}))
    )


def _under_first_ids(inspections: Sequence[Inspection], store: Store) -> list[Inspection]:
    """The same row of a renamed file has another made id: it is the inspection that was kept
    first.
    """
    gears: set[GearKey] = set()
    first: dict[tuple[str, ...], Record] = {}

    def under_first_id(inspection: Inspection) -> Inspection:
        row, key = place_in_file(inspection.record_id), (inspection.tail_no, inspection.side.value)
        if not row:
            return inspection
        if key not in gears:
            gears.add(key)
            for kept in store.of_gear(*key):
                if kept.kind is Kind.INSPECTION:
                    first.setdefault((*key, kept.day, place_in_file(kept.record_id)), kept)
        record = inspection_record(inspection)
        kept = first.setdefault((*key, record.day, row), record)
        renamed = replace(inspection, record_id=kept.record_id)
        return renamed if same_inspection(kept, inspection_record(renamed)) else inspection

    return [under_first_id(inspection) for inspection in inspections]


def _agrees(store: Store, kept: Record, new: Record) -> bool:
    """The same as kept, or as what the kept one was corrected to."""
    return same_inspection(kept, new) or any(
        record.kind is Kind.CORRECTION
        and record.body["supersedes"] == kept.digest
        and same_inspection(record, new)
        for record in store.of_gear(kept.tail_no, kept.side)
    )


def _assessment(
    gear: Gear,
    options: CheckOptions,
    assessment: Assessment,
    of: Record,
    first: Record | None = None,
) -> Record:
    from mlg_troubleshoot.reporting.json_form import kept_as_json
    from mlg_troubleshoot.reporting.provenance import program_version

    extension = None if options.extension is None else options.extension.describe()
    by = {
        "program_version": program_version(),
        "geometry_sha256": gear.geometry_sha256,
        "extension": extension,
    }
    body = packed({**by, "result": kept_as_json(assessment)})
    identity = (
        of.identity_hash.hex(),
        *(str(value) for value in by.values()),
        (first or of).packed.hex(),
    )
    return replace(of, kind=Kind.ASSESSMENT, packed=body, identity=identity)


def _settled_tails(
    judged: Sequence[Assessment], store: Store, same_tail: Callable[[str, str], bool] | None
) -> dict[str, str]:
    """Spellings that differ only in case, blanks or dashes: never one aircraft without being
    asked.
    """
    known = dict.fromkeys(tail for tail, _side in store.gears())
    by_key: dict[str, str] = {}
    for tail in known:
        by_key.setdefault(_tail_key(tail), tail)
    settled: dict[str, str] = {}
    for tail in dict.fromkeys(a.inspection.tail_no for a in judged):
        other = by_key.setdefault(_tail_key(tail), tail)
        if tail in known or other == tail:
            continue
        if same_tail is None:
            raise StoreError(
                f"tail {tail!r} differs from {other!r} only in case, blanks or dashes; nothing was"
                " kept",
                "Correct it, or say --tails same (one aircraft) or --tails apart (two).",
            )
        if same_tail(tail, other):
            settled[tail] = other
    return settled


def _tail_key(tail: str) -> str:
    return re.sub(r"[\s_‐-―−-]+", "", tail).casefold()


def lives(
    store: Store, tail: str | None = None, side: str | None = None
) -> dict[GearKey, GearLife]:
    """Every gear's life, or those of one aircraft."""
    found: dict[GearKey, list[Record]] = {}
    for record in store.all() if tail is None else store.of_gear(tail, side):
        found.setdefault((record.tail_no, record.side), []).append(record)
    return {key: _life(key, records) for key, records in sorted(found.items())}


def life_of(store: Store, tail: str, side: str) -> GearLife:
    """One gear's life; a gear without records is a usage error that names near spellings."""
    side = Side.parse(side).value
    found = lives(store, tail, side).get((tail, side))
    if found is None:
        near = [f"{t} {s}" for t, s in store.gears() if _tail_key(t) == _tail_key(tail)]
        raise UsageError(
            f"no records of {tail} {side} in {store.place}",
            f"There is {', '.join(near)}." if near else "See which gears are kept: mlg history",
        )
    for seen in found.inspections:
        # What stands there and cannot be read is named before anything is added to it.
        _ = seen.inspection
    return found


def _life(key: GearKey, records: Sequence[Record]) -> GearLife:
    seen: dict[str, Seen] = {}
    events: dict[str, Record] = {}
    records = _readable_or_not_void(records)
    for record in records:
        if record.kind is Kind.INSPECTION:
            seen[record.digest] = Seen(record)
        elif record.kind is Kind.CORRECTION:
            first = next(
                (k for k, s in seen.items() if record.body["supersedes"] in (k, s.record.digest)),
                None,
            )
            if first is not None:
                seen[first] = Seen(record)
        elif record.kind is Kind.VOID:
            gone = record.body["voids"]
            seen = {k: s for k, s in seen.items() if gone not in (k, s.record.digest)}
            events.pop(gone, None)
        elif record.kind is Kind.ASSESSMENT:
            same = [
                k
                for k, s in seen.items()
                if (s.record.record_id, s.record.day) == (record.record_id, record.day)
            ]
            if same:
                seen[same[-1]] = replace(seen[same[-1]], assessed=record)
        else:
            events[record.digest] = record
    repairs = [r for r in events.values() if r.kind in (Kind.REPAIR, Kind.RERIG)]
    unordered: list[Seen | Record] = [*seen.values(), *repairs]
    counted = sorted(unordered, key=lambda event: _record_of(event).seq)
    moments = [_moment(event) for event in counted]
    return GearLife(
        key,
        tuple(records),
        tuple(counted[place] for place in in_order(moments)),
        tuple(r for r in events.values() if r.kind is Kind.OUTCOME),
        _disagreements(key, counted, moments),
    )


def _readable_or_not_void(records: Sequence[Record]) -> list[Record]:
    """Leave out what is void and cannot be read: that is how such a record is put aside."""
    void: set[str] = set()
    kept = []
    # A record is void by a later one.
    for record in reversed(records):
        if record.digest not in void or _is_readable(record):
            kept.append(record)
            if record.kind is Kind.VOID:
                void.add(record.body["voids"])
    return kept[::-1]


def _is_readable(record: Record) -> bool:
    try:
        return bool(record.body)
    except StoreError:
        return False


def _record_of(event: Seen | Record) -> Record:
    return event.record if isinstance(event, Seen) else event


def _moment(event: Seen | Record) -> Moment:
    if isinstance(event, Seen):
        return Moment.of(event.inspection)
    return Moment(event.day, event.body.get("landings"))


def _disagreements(
    key: GearKey, counted: Sequence[Seen | Record], moments: Sequence[Moment]
) -> tuple[str, ...]:
    """Name the records whose dates and landings disagree, each with how to correct it."""

    def name(place: int) -> str:
        record = _record_of(counted[place])
        what = "" if isinstance(counted[place], Seen) else f"{record.kind} "
        return f"{what}{record.record_id}, ".lstrip(", ") + record.digest[:10]

    by_sentence: dict[str, list[int]] = {}
    for place, said in contradictions(moments, name).items():
        by_sentence.setdefault(said, []).append(place)
    warnings = []
    for said, places in by_sentence.items():
        record = _record_of(counted[places[0]]).digest[:10] if len(places) == 1 else "RECORD"
        voids = f"mlg history void {record} --why TEXT"
        repaired = any(isinstance(counted[place], Record) for place in places)
        corrects = (
            f"{voids}, then mlg history repair"
            if repaired
            else f"mlg history correct {record} FILE, or {voids}"
        )
        warnings.append(f"{' '.join(key)}: {said}. No forecast until this is corrected: {corrects}")
    return tuple(warnings)


def warnings_of(store: Store, keys: Collection[GearKey]) -> list[str]:
    """The records of some gears whose dates and landings disagree."""
    if len(keys) > _GEARS_AT_ONCE:
        found = lives(store)
    else:
        found = {key: life for wanted in keys for key, life in lives(store, *wanted).items()}
    return [warning for key, life in found.items() if key in keys for warning in life.warnings]


def find(store: Store, record_id: str) -> Record:
    """Find the record that a command names: by its id, or by the first letters of its hash where an
    id is not one.
    """
    live = [
        record
        for life in lives(store).values()
        for record in (*(s.record for s in life.inspections), *life.repairs, *life.outcomes)
    ]
    found = [
        r for r in live if r.record_id == record_id and r.kind in (Kind.INSPECTION, Kind.CORRECTION)
    ]
    found = found or [
        r
        for r in live
        if len(record_id) >= _LEAST_OF_A_HASH and r.digest.startswith(record_id.lower())
    ]
    if len(found) == 1:
        return found[0]
    if not found:
        raise UsageError(
            f"no record {record_id!r} stands in {store.place}",
            "See the records: mlg history TAIL SIDE",
        )
    named = ", ".join(
        f"{r.digest[:10]} ({r.tail_no} {r.side} {r.day or 'no date'})" for r in found[:6]
    )
    raise UsageError(
        f"{len(found)} records are called {record_id!r}: {named}",
        "Name one by the start of its hash.",
    )


def key_of(tail: str, side: str) -> GearKey:
    """Judge which gear is meant as a table would: a tail number, and a side in any spelling."""
    found = admit({**_ANY, "tail_no": tail, "side": side}, ReadOptions())
    return found.tail_no, found.side.value


def work(
    store: Store,
    kind: Kind,
    gear: GearKey,
    day: date | str,
    work_order: str | None,
    landings: float | str | None = None,
    joints: Sequence[int] | None = None,
) -> Record:
    """Record that joints were restored, or the reversing valve re-rigged: the joints wear on, the
    plunger moved.
    """
    key = key_of(*gear)
    said = {"inspection_date": day, "gear_landings": landings, "work_order": work_order}
    flags = {
        "inspection_date": "--date",
        "gear_landings": "--landings",
        "work_order": "--work-order",
    }
    labels = {column: f"{flags[column]} {str(value)!r}" for column, value in said.items()}
    found = admit({**_ANY, **said}, ReadOptions(), labels)
    done = found.inspection_date
    if done is None:
        raise UsageError(
            f"{labels['inspection_date']} says no day", "Give the day on which it was done."
        )
    life_of(store, *key)
    body: dict[str, Any] = {"landings": found.gear_landings, "work_order": work_order}
    if joints is not None:
        body["joints"] = list(joints)
    return _added(store, Record(kind, work_order or "", *key, done.isoformat(), packed(body)))


# What a row must have besides what is to be judged.
_ANY = {"record_id": "-", "tail_no": "-", "side": "LH", "clearance_convention": "RADIAL"}


def correct(store: Store, record_id: str, result: CheckResult, options: CheckOptions) -> Record:
    """Append the right inspection for a wrong one; the wrong one stays readable in the chain."""
    wrong = find(store, record_id)
    judged = [j for j in result.judgements if isinstance(j, Assessment)]
    if len(judged) != 1 or len(result.judgements) != 1:
        raise UsageError(
            f"a correction is one inspection, and the file holds {len(result.judgements)}"
            f" ({len(judged)} sound)",
            "Give a file with the one right row.",
        )
    right = judged[0].inspection
    if (right.tail_no, right.side.value) != (wrong.tail_no, wrong.side):
        raise UsageError(
            f"the correction is of {right.tail_no} {right.side}, the record of {wrong.tail_no}"
            f" {wrong.side}",
            "Void the record (mlg history void) and keep the right one: mlg check FILE --keep",
        )
    record = inspection_record(right, Kind.CORRECTION, supersedes=wrong.digest)
    store.add([record, _assessment(result.gear, options, judged[0], record)])
    return record


def void(store: Store, record_id: str, why: str) -> Record:
    """Append that a record does not count."""
    judge_text("--why", why, "Say why the record does not count.")
    wrong = _unreadable(store, record_id) or find(store, record_id)
    body = {"voids": wrong.digest, "why": why}
    return _added(store, replace(wrong, kind=Kind.VOID, packed=packed(body), identity=()))


def _unreadable(store: Store, digest: str) -> Record | None:
    """The record of which the hash begins so, if its content cannot be read."""
    if len(digest) < _LEAST_OF_A_HASH:
        return None
    found = [record for record in store.all() if record.digest.startswith(digest.lower())]
    return found[0] if len(found) == 1 and not _is_readable(found[0]) else None


def outcome(store: Store, record_id: str, found: str, joint: int | None) -> Record:
    """Record what was found after the advice."""
    judge_text("--found", found, "Say what was found.")
    of = find(store, record_id)
    if of.kind not in (Kind.INSPECTION, Kind.CORRECTION):
        raise UsageError(
            f"{record_id!r} is a {of.kind}", "Give the record of the inspection that advised."
        )
    body = {"of": of.digest, "found": found, "joint": joint}
    return _added(store, replace(of, kind=Kind.OUTCOME, packed=packed(body), identity=()))


def _added(store: Store, record: Record) -> Record:
    store.add([record])
    return record


def advice(found: Iterable[GearLife]) -> Advice:
    """Count outcomes that name a joint, and those whose joint was advised first."""
    right = asked = 0
    for life in found:
        for record in life.outcomes:
            joint = record.body["joint"]
            seen = next(
                (s for s in life.inspections if s.record.record_id == record.record_id), None
            )
            if joint is not None and seen is not None and seen.result:
                advised = (seen.result.get("next_action") or {}).get("joints") or ()
                asked, right = asked + 1, right + (joint in (worst_joint(seen), *advised))
    return Advice(right, asked)


def _landings_of(record: Record, life: GearLife) -> float | None:
    """Landings at a repair: as recorded, else between the inspections about it, by their days."""
    stated = record.body.get("landings")
    if stated is not None:
        return float(stated)
    dated = _placed_in_time(life)
    if not dated or not record.day:
        return None
    days, landings = zip(*dated, strict=True)
    return float(np.interp(date.fromisoformat(record.day).toordinal(), days, landings))


def _placed_in_time(life: GearLife) -> list[tuple[int, float]]:
    """Day and landings of the inspections that state both."""
    return [
        (date.fromisoformat(s.record.day).toordinal(), s.inspection.gear_landings)
        for s in life.inspections
        if s.record.day and s.inspection.gear_landings is not None
    ]


@dataclass(slots=True)
class _Stretch:
    """What was read of a joint between two restorations: landings (None: not stated), clearance and
    its uncertainty.
    """

    begun: float
    readings: list[tuple[float | None, float, float]]

    @property
    def placed(self) -> list[tuple[float, float, float]]:
        """The readings whose landings are known."""
        return [(at, value, u) for at, value, u in self.readings if at is not None]


def _stretches(life: GearLife, joints: Sequence[int]) -> dict[int, list[_Stretch]]:
    """Readings of each joint between its restorations, in the order of time."""
    found = {joint: [_Stretch(0.0, [])] for joint in joints}
    for event in life.events:
        if isinstance(event, Seen):
            seen = event.inspection
            for joint in found.keys() & seen.clearance_in.keys():
                reading = (seen.gear_landings, seen.clearance_in[joint], seen.gauge_u_of(joint))
                found[joint][-1].readings.append(reading)
        elif event.kind is Kind.REPAIR:
            at = _landings_of(event, life)
            for joint in found.keys() & set(event.body["joints"]):
                found[joint].append(_Stretch(found[joint][-1].begun if at is None else at, []))
    return found


def wear_paths(life: GearLife, joints: Sequence[int]) -> dict[int, tuple[list[WearPath], float]]:
    """Paths of each joint between its restorations, and the landings at which the current one
    began.
    """
    found = {}
    for joint, stretches in _stretches(life, joints).items():
        paths = []
        reading_u: float | None = None
        for stretch in stretches:
            placed = stretch.placed
            reading_u = placed[-1][2] if placed else reading_u
            usage = [max(at - stretch.begun, 0.0) for at, _value, _u in placed]
            paths.append(
                WearPath(
                    unit_of(life.key, joint), usage, [value for _at, value, _u in placed], reading_u
                )
            )
        found[joint] = paths, stretches[-1].begun
    return found


def unit_of(key: GearKey, joint: int) -> str:
    """Name of a joint of a gear for the forecasts."""
    return f"{key[0]} {key[1]} #{joint}"


def fit_fleet(found: Iterable[GearLife], gear: Gear) -> WearModel | None:
    """Learn the wear of all joints of all gears whose dates and landings agree; None if none states
    its landings.
    """
    paths = [
        path
        for life in found
        if not life.warnings
        for own, _begun in wear_paths(life, gear.joint_numbers).values()
        for path in own
        if len(own) > 1 or len(np.asarray(path.usage))
    ]
    return fit_wear(paths) if any(len(np.asarray(path.usage)) for path in paths) else None


def forecast(
    found: Sequence[GearLife],
    model: WearModel | None,
    gear: Gear,
    progress: Callable[[str, int, int], None] = lambda _name, _done, _total: None,
) -> dict[GearKey, Forecast]:
    """Forecast gears from their last inspection on.

    Nothing remains to one that is due now, whatever else is wrong with its records. Another one
    without landings, or whose dates and landings disagree, has no forecast.
    """
    forecasts = {life.key: _due_now(life, gear) or Forecast() for life in found if life.latest}
    known = [
        life
        for life in found
        if life.key in forecasts
        and not (forecasts[life.key].due_now or life.warnings)
        and life.inspections[-1].inspection.gear_landings is not None
    ]
    if model is not None:
        done = 0
        parts = [
            known[first : first + _GEARS_AT_ONCE] for first in range(0, len(known), _GEARS_AT_ONCE)
        ]
        # NumPy lets others work meanwhile.
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for part, some in zip(
                parts, pool.map(lambda p: [*_forecast_some(p, model, gear)], parts), strict=True
            ):
                forecasts.update(zip((life.key for life in part), some, strict=True))
                done += len(part)
                progress("Looking ahead", done, len(known))
    return {life.key: forecasts.get(life.key, Forecast()) for life in found}


def _due_now(life: GearLife, gear: Gear) -> Forecast | None:
    """The forecast of a gear that is outside its margin or has a joint over its limit: nothing
    remains of anything.
    """
    last = {n: s[-1].readings[-1:] for n, s in _stretches(life, gear.joint_numbers).items()}
    over = {
        n: read[0][1]
        for n, read in last.items()
        if read and gear.joint(n).is_over_limit(read[0][1])
    }
    outside = life.inspections[-1].result.get("verdict") == Verdict.OUTSIDE_MARGIN.value
    reasons = ["outside the margin at the last inspection"] * outside
    # Nobody can say that an inspection without a date is an earlier one, unless the gear was
    # restored after it.
    restored = max((record.seq for record in life.repairs), default=-1)
    undated = [
        seen for seen in life.inspections[:-1] if not seen.record.day and seen.record.seq > restored
    ]
    for seen in undated:
        read_over = {
            n: c for n, c in seen.inspection.clearance_in.items() if gear.joint(n).is_over_limit(c)
        }
        over.update(read_over)
        if read_over or seen.result.get("verdict") == Verdict.OUTSIDE_MARGIN.value:
            reasons.append(
                f"inspection {seen.record.record_id} has no date and may be the last one"
            )
    if not (over or reasons):
        return None
    listed = ", ".join(f"#{n}" for n in over)
    why = ", and ".join([*reasons, *[f"{listed} over the limit when last read"] * bool(over)])
    nothing = Samples(np.zeros(1))
    worst = max(over, key=lambda n: over[n] / gear.joint(n).limit.value, default=None)
    return Forecast(dict.fromkeys(over, nothing), nothing, worst, nothing, 0.0, why)


def _forecast_some(part: Sequence[GearLife], model: WearModel, gear: Gear) -> Iterator[Forecast]:
    numbers = gear.joint_numbers
    now = np.array([life.inspections[-1].inspection.gear_landings for life in part], float)
    begun = np.array(
        [[start for _own, start in wear_paths(life, numbers).values()] for life in part]
    )
    ahead = gear.horizon.value * _AHEAD
    usage = np.maximum(now[:, None, None] + ahead - begun[:, :, None], 0.0)
    # Gear by gear, each from the model's seed: the forecast of a gear is the same whoever else is
    # asked for.
    asked_of = [[unit_of(life.key, number) for number in numbers] for life in part]
    wear = np.stack(
        [
            model.forecast(u, at, reading=False).samples
            for u, at in zip(asked_of, usage, strict=True)
        ]
    )
    wear = np.maximum(wear, 0.0)
    amplification = gear.model.plunger_amplification()
    read = np.array(
        [
            [any(n in s.inspection.clearance_in for s in life.inspections) for n in numbers]
            for life in part
        ]
    )
    # A joint that was never read counts as it does in the prediction: not at all.
    wear = np.where(read[:, :, None, None], wear, 0.0)
    straight = np.einsum("j,gjts->gts", amplification, wear)
    # The model itself says how far the worst case departs from the sum of amplified clearances as
    # they wear.
    asked = np.searchsorted(_AHEAD, _ASKED)
    middle = np.median(wear[:, :, asked, :], axis=3)
    predicted = worst_case(
        gear.model, np.moveaxis(middle, 1, 2).reshape(-1, len(numbers))
    ).magnitude_in
    summed = np.einsum("j,gjt->gt", amplification, middle)
    # A linkage that does not close is outside any margin.
    ratio = np.where(np.isnan(predicted), _NOT_CLOSING_IN, predicted).reshape(
        summed.shape
    ) / np.maximum(summed, 1e-12)
    for g, life in enumerate(part):
        stated = life.inspections[-1].inspection.margin_in
        margin = gear.margin.value if stated is None else stated
        displacement = straight[g] * np.interp(_AHEAD, _ASKED, ratio[g])[:, None]
        to_limit = np.stack(
            [_first_passage(ahead, wear[g, j], gear.limits_in[j]) for j in range(len(numbers))]
        )
        of_joints = {number: Samples(to_limit[j]) for j, number in enumerate(numbers) if read[g, j]}
        to_margin, to_any = _first_passage(ahead, displacement, margin), to_limit.min(axis=0)
        due = float(Samples(np.minimum(to_any, to_margin)).quantile(gear.accepted_chance.value))
        first = to_limit.argmin(axis=0)[np.isfinite(to_any)]
        joint = numbers[int(np.bincount(first).argmax())] if len(first) else None
        yield Forecast(
            of_joints, Samples(to_any), joint, Samples(to_margin), due if np.isfinite(due) else None
        )


def _first_passage(ahead: Array, paths: Array, limit: float) -> Array:
    """Landings at which each simulated path (ahead, samples) first passes a limit, infinite beyond
    the horizon.
    """
    over = paths > limit
    k = np.argmax(over, axis=0)
    sample = np.arange(paths.shape[1])
    high, low = paths[k, sample], paths[np.maximum(k - 1, 0), sample]
    with np.errstate(invalid="ignore"):
        part = np.where(
            np.isfinite(high), (limit - low) / np.where(high > low, high - low, 1.0), 1.0
        )
    at = ahead[np.maximum(k - 1, 0)] + part * (ahead[k] - ahead[np.maximum(k - 1, 0)])
    return np.where(over.any(axis=0), np.where(k == 0, 0.0, at), np.inf)


def suggestions(found: Sequence[GearLife], model: WearModel | None, gear: Gear) -> list[str]:
    """Name last inspections that look like a restoration nobody recorded, or like two gears
    exchanged.
    """
    if model is None:
        return []
    # Seen twice, the last time with its landings.
    kept = [
        life
        for life in found
        if len(life.inspections) > 1
        and not life.warnings
        and life.inspections[-1].inspection.gear_landings is not None
    ]
    off = _departures([(life, life) for life in kept], model, gear)
    said: list[str] = []
    swapped: set[int] = set()
    poor = [i for i, z in enumerate(off) if _fit(z) < _POOR]
    # Gears are exchanged on one aircraft, or by those who entered one day's sheets.
    days = [life.inspections[-1].record.day for life in kept]
    pairs = [
        (i, j)
        for i, j in combinations(poor, 2)
        if kept[i].key[0] == kept[j].key[0] or days[i] == days[j]
    ]
    crossed = _departures(
        [(kept[a], kept[b]) for i, j in pairs for a, b in ((i, j), (j, i))], model, gear
    )
    gains = []
    for n, (i, j) in enumerate(pairs):
        others = crossed[2 * n : 2 * n + 2]
        gain = (_square(off[i], off[j]) - _square(*others)) / 2.0
        if gain > _EXCHANGED and min(map(_fit, others)) > _NO_FIT:
            gains.append((gain, i, j))
    # The clearest pair first: a gear was exchanged with one other at most.
    for _gain, i, j in sorted(gains, reverse=True):
        if not {i, j} & swapped:
            swapped |= {i, j}
            one, two = (" ".join(kept[k].key) for k in (i, j))
            said.append(
                f"The last inspections of {one} and {two} fit each other's wear: were they"
                " exchanged?"
            )
    for i, (life, z) in enumerate(zip(kept, off, strict=True)):
        dropped = [
            number for number, score in zip(gear.joint_numbers, z, strict=True) if score <= -_DROP
        ]
        if dropped and i not in swapped:
            listed = ", ".join(f"#{number}" for number in dropped)
            said.append(
                f"{' '.join(life.key)}: {listed} read much tighter than before. Restored without a"
                f" record? mlg history repair {' '.join(life.key)} --joint {dropped[0]} --date D"
            )
    return said


def _fit(scores: Array) -> float:
    """Chance that an inspection of a gear lies as far from its forecasts as these scores do. [1]"""
    from scipy.special import chdtrc

    return float(chdtrc(np.sum(np.isfinite(scores)), _square(scores)))


def _square(*scores: Array) -> float:
    return float(sum(np.nansum(z**2) for z in scores))


def _departures(
    pairs: Sequence[tuple[GearLife, GearLife]], model: WearModel, gear: Gear
) -> list[Array]:
    """How far the newest inspections of gears lie from what others' histories promised, in standard
    deviations.
    """
    numbers = gear.joint_numbers
    paths: dict[str, tuple[WearPath, ...]] = {}
    at: list[tuple[int, int]] = []
    ahead, read = [], []
    for n, (history, newest) in enumerate(pairs):
        last = newest.inspections[-1].inspection
        landings = last.gear_landings or 0.0
        before = replace(
            history, events=tuple(event for event in history.events if event is not history.latest)
        )
        for j, (own, begun) in enumerate(wear_paths(before, numbers).values()):
            if numbers[j] in last.clearance_in and len(np.asarray(own[-1].usage)):
                paths[f"{n} {j}"] = tuple(own)
                at.append((n, j))
                ahead.append(max(landings - begun, 0.0))
                read.append(last.clearance_in[numbers[j]])
    scores = np.full((len(pairs), len(numbers)), np.nan)
    if at:
        samples = (
            replace(model, paths=paths)
            .forecast(list(paths), np.array(ahead)[:, None])
            .samples[:, 0]
        )
        scores[tuple(np.array(at).T)] = (np.array(read) - samples.mean(axis=1)) / samples.std(
            axis=1
        )
    return list(scores)


def quantiles(samples: Samples | None) -> dict[str, float | None] | None:
    """The 5, 50 and 95 % quantiles; null beyond the horizon."""
    if samples is None:
        return None
    ends = samples.quantile([0.05, 0.5, 0.95])
    return {
        n: float(end) if np.isfinite(end) else None
        for n, end in zip(("p05", "p50", "p95"), ends, strict=True)
    }


def span(ends: Mapping[str, float | None] | None, gear: Gear) -> str:
    """Median and 90 % interval of landings, the horizon standing for what lies beyond it."""
    if ends is None:
        return "-"
    low, middle, high = (landings_shown(end, gear) for end in ends.values())
    return middle if low == high else f"{middle} ({low} to {high})"


def landings_shown(count: float | None, gear: Gear) -> str:
    """Landings to two digits: a forecast has no more; None lies beyond the horizon."""
    return f"> {gear.horizon.value:.0f}" if count is None else f"{float(f'{count:.2g}'):.0f}"


def outlook_words(life: GearLife, ahead: Forecast, gear: Gear) -> str:
    """Say how many landings a gear has left, to which margin and by which joint; empty where
    nothing was forecast.
    """
    if ahead.due_now:
        return f"No landings left: {ahead.due_now}. Next inspection due now."
    if life.latest is not None and life.latest.inspection.gear_landings is None:
        return "No forecast: the last inspection does not state its landings (gear_landings)."
    if ahead.limit is None:
        return ""
    told = _outlook(life, ahead)
    joint = (
        ""
        if ahead.limit_joint is None
        else f", where #{ahead.limit_joint} most likely reaches its limit first"
    )
    after, day = ahead.next_inspection, told["due_date"]
    due = "beyond the horizon" if after is None else f"in {landings_shown(after, gear)} landings"
    return (
        "Landings left from the last inspection: to a joint's limit"
        f" {span(told['landings_to_limit'], gear)}{joint}; to the margin, by the worst-case bound,"
        f" {span(told['landings_to_margin'], gear)}. Next inspection due"
        f" {due}{f', about {day}' if day else ''} (accepted chance"
        f" {gear.accepted_chance.value:.0%})."
    )


def worst_joint(seen: Seen) -> int | None:
    """The joint to look at first."""
    return next(
        (joint["joint"] for joint in seen.result.get("joints", ()) if joint["rank"] == 1), None
    )


def fleet_as_json(
    found: Sequence[GearLife], forecasts: Mapping[GearKey, Forecast]
) -> dict[str, Any]:
    """One line per gear, worst first: verdict, then landings to its next inspection."""
    lines = []
    for life in found:
        if (seen := life.latest) is None:
            continue
        ahead = forecasts.get(life.key, Forecast())
        lines.append(
            {
                "tail_no": life.key[0],
                "side": life.key[1],
                "record_id": seen.record.record_id,
                "inspection_date": seen.record.day or None,
                "gear_landings": seen.inspection.gear_landings,
                "verdict": seen.result.get("verdict"),
                "worst_joint": worst_joint(seen),
                **_outlook(life, ahead),
                "repairs": len(life.repairs),
            }
        )
    lines.sort(key=_urgency)
    warnings = [warning for life in found for warning in life.warnings]
    return {
        "schema_version": SCHEMA_VERSION,
        "gears": lines,
        "advice": advice(found).describe(),
        "warnings": warnings,
    }


def _outlook(life: GearLife, ahead: Forecast) -> dict[str, Any]:
    """The landings that a gear has left, the same in its life and in the fleet."""
    return {
        "landings_to_limit": quantiles(ahead.limit),
        "limit_joint": ahead.limit_joint,
        "landings_to_margin": quantiles(ahead.margin),
        "next_inspection_landings": ahead.next_inspection,
        "due_date": _due_date(life, ahead),
    }


def _due_date(life: GearLife, ahead: Forecast) -> str | None:
    """The day on which the next inspection is due if the gear goes on landing as often as between
    its inspections.
    """
    last = life.latest
    if last is None or not last.record.day or ahead.next_inspection is None:
        return None
    latest = date.fromisoformat(last.record.day).toordinal()
    days = 0.0
    if not ahead.due_now:
        placed = _placed_in_time(life)
        flown, passed = (
            (placed[-1][1] - placed[0][1], placed[-1][0] - placed[0][0]) if placed else (0.0, 0)
        )
        if flown <= 0.0 or passed <= 0:
            return None
        days = ahead.next_inspection * passed / flown
    return (
        date.fromordinal(latest + int(days)).isoformat()
        if latest + days < date.max.toordinal()
        else None
    )


def _urgency(line: Mapping[str, Any]) -> tuple[int, float, str, str]:
    due = line["next_inspection_landings"]
    verdict = line["verdict"]
    rank = WORST_FIRST.index(verdict) if verdict in WORST_FIRST else len(WORST_FIRST)
    return rank, float("inf") if due is None else due, line["tail_no"], line["side"]


def life_as_json(life: GearLife, ahead: Forecast, gear: Gear) -> dict[str, Any]:
    """One gear's events in the order of the chain, and each joint's readings since it was last
    restored.
    """
    current = {s.record.digest: s for s in life.inspections}
    events = []
    for record in life.records:
        body = record.body
        event: dict[str, Any] = {
            "kind": record.kind.value,
            "record_id": record.record_id or None,
            "date": record.day or None,
            "gear_landings": body.get("landings", body.get("inspection", {}).get("gear_landings")),
            "hash": record.digest,
        }
        if record.kind is Kind.ASSESSMENT:
            result = body["result"]
            event |= {
                name: result.get(name)
                for name in ("verdict", "predicted_displacement_in", "margin_in")
            }
            event |= {
                name: body.get(name) for name in ("program_version", "geometry_sha256", "extension")
            }
        elif record.kind in (Kind.INSPECTION, Kind.CORRECTION):
            event |= {"counts": record.digest in current, "supersedes": body.get("supersedes")}
            event["clearance_in"] = body["inspection"].get("clearance_in", {})
        else:
            event |= {name: value for name, value in body.items() if name != "landings"}
        events.append(event)
    joints = []
    for number, stretches in _stretches(life, gear.joint_numbers).items():
        joints.append(
            {
                "joint": number,
                "limit_in": gear.joint(number).limit.value,
                "readings": [
                    [landings, clearance] for landings, clearance, _u in stretches[-1].placed
                ],
                "landings_to_limit": quantiles(ahead.joints.get(number)),
            }
        )
    tail, side = life.key
    told = {
        "schema_version": SCHEMA_VERSION,
        "tail_no": tail,
        "side": side,
        "events": events,
        "joints": joints,
    }
    return {
        **told,
        **_outlook(life, ahead),
        "advice": advice([life]).describe(),
        "warnings": list(life.warnings),
    }


def import_file(store: Store, file: Path) -> Added:
    """Add an exported chain from a regular file of sane size."""
    remedy = "Give a file written by: mlg history export"
    try:
        # A pipe that nobody writes to would be waited for.
        with os.fdopen(
            os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), encoding="utf-8"
        ) as chain:
            found = os.fstat(chain.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise UsageError(f"{file} is not a regular file", remedy)
            if found.st_size > _MOST_BYTES:
                raise UsageError(
                    f"{file} has {found.st_size} bytes, at most {_MOST_BYTES} are read", remedy
                )
            return store.restore(_lines(chain, file.name), file.name)
    except (OSError, ValueError) as error:
        raise UsageError(f"{file} cannot be read: {error}", remedy) from error


def _lines(chain: TextIO, name: str) -> Iterator[str]:
    for number, line in enumerate(iter(partial(chain.readline, _LONGEST_LINE), ""), 1):
        if len(line) == _LONGEST_LINE:
            raise StoreError(
                f"{name}, line {number} has more than {_LONGEST_LINE} characters; nothing was"
                " imported",
                "Export again.",
            )
        yield line


@dataclass(frozen=True, slots=True)
class Verified:
    """What a walk along the chain showed.

    ``count`` records fit, the hash of the last of them is ``last``, and that of number ``expected``
    is the one that was asked for (None if there is none); ``wrong`` says what else departs from a
    store as it should be.
    """

    count: int
    last: str
    broken: Broken | None
    expected: int | None
    wrong: tuple[str, ...]


def verify(store: Store, expect: str | None = None) -> Verified:
    """Walk the chain, read every content that is not void, and look whether a hash noted before
    still stands there.
    """
    last, expected = "", None
    wrong: dict[str, str] = {}

    def visit(record: Record) -> None:
        nonlocal last, expected
        last = record.digest
        expected = record.seq if last == expect else expected
        try:
            if record.body and record.kind is Kind.VOID:
                wrong.pop(record.body["voids"], None)
        except StoreError as error:
            wrong[last] = error.message

    count, broken = store.verify(visit)
    return Verified(count, last, broken, expected, (*store.departures(), *wrong.values()))


# Inspections that stand side by side on the page of a gear's life.
_SIDE_BY_SIDE = 4


def side_by_side(life: GearLife, now: Assessment | None = None) -> list[dict[str, Any]]:
    """The last inspections of a gear, up to one that is not kept yet, each with what was restored
    since the one before.

    Nothing where that one has none before it.
    """
    rows = [
        (
            s.inspection,
            (s.record.day, s.record.seq),
            s.result.get("predicted_displacement_in"),
            s.result.get("verdict"),
        )
        for s in life.inspections
    ]
    if now is not None:
        found = now.inspection
        day = found.inspection_date.isoformat() if found.inspection_date else ""
        at = (day or "9999", life.records[-1].seq + 1)
        rows = [r for r in rows if r[0].record_id != found.record_id and r[1] < at]
        rows += [(found, at, now.predicted_displacement_in, now.verdict.value)] if rows else []
    steps: list[dict[str, Any]] = []
    before: tuple[str, int] | None = None
    for inspection, at, worst_in, verdict in rows:
        since = [r for r in life.repairs if before and before < (r.day, r.seq) < at]
        steps.append(
            {
                "record_id": inspection.record_id,
                "date": (
                    inspection.inspection_date.isoformat() if inspection.inspection_date else ""
                ),
                "gear_landings": inspection.gear_landings,
                "clearance_in": inspection.clearance_in,
                "restored": sorted({joint for r in since for joint in r.body.get("joints", ())}),
                "rerigged": any(r.kind is Kind.RERIG for r in since),
                "worst_in": worst_in,
                "verdict": verdict,
            }
        )
        before = max(before or at, at)
    return steps[-_SIDE_BY_SIDE:]


def seen_before(judgements: Sequence[Judgement], store: Store) -> list[list[dict[str, Any]]]:
    """What each judged gear was like before, side by side with what it is now; empty for one that
    is new.
    """
    known = set(store.gears())

    def of(judgement: Judgement) -> list[dict[str, Any]]:
        if isinstance(judgement, Rejected):
            return []
        key = (judgement.inspection.tail_no, judgement.inspection.side.value)
        return side_by_side(life_of(store, *key), judgement) if key in known else []

    return [of(judgement) for judgement in judgements]


def write_pages(
    found: Sequence[GearLife],
    forecasts: Mapping[GearKey, Forecast],
    gear: Gear,
    directory: Path,
    *,
    fleet: bool,
    page: str = "A4",
    unit: LengthUnit = LengthUnit.INCH,
    remembered: str | None = None,
) -> list[WrittenReport]:
    """Write the page of each gear's life and, for a fleet, the page that links them."""
    from mlg_troubleshoot.reporting import fleet_report, provenance_of, publish

    last = max(
        (record for life in found for record in life.records), key=lambda r: r.seq, default=None
    )
    hashes = {} if last is None else {f"store up to record {last.seq}": last.digest}
    made = provenance_of(gear, hashes, remembered=remembered)
    written = []
    if fleet:
        series = {
            life.key: (
                [seen.result.get("predicted_displacement_in") for seen in life.inspections],
                life.latest.result.get("margin_in") if life.latest else None,
            )
            for life in found
        }
        told, words = fleet_as_json(found, forecasts), advice(found).words
        document = fleet_report.fleet_document(told, series, words, gear, made, unit)
        written.append(publish(document, directory, page=page))
    for life in found:
        # The pages behind the lines of a fleet are for the screen.
        formats = ("html",) if fleet else ("html", "pdf")
        told = life_as_json(life, forecasts.get(life.key, Forecast()), gear)
        outlook = outlook_words(life, forecasts.get(life.key, Forecast()), gear)
        document = fleet_report.life_document(told, outlook, side_by_side(life), gear, made, unit)
        written.append(publish(document, directory, formats=formats, page=page))
    return written
