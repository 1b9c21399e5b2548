"""Keep what a check found: inspections with their assessments, and corrections."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

from mlg_troubleshoot.decision.assessment import Assessment, Judgement
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    RowSource,
    plain_tail,
    surely_later,
)
from mlg_troubleshoot.decision.judge_rows import AT_ONCE
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, find, life_of, warnings_of
from mlg_troubleshoot.life.since_repairs import key_of, stated_repair
from mlg_troubleshoot.parallel import Progress
from mlg_troubleshoot.records.rows import place_in_file
from mlg_troubleshoot.store import (
    Record,
    RecordKind,
    Store,
    StoreError,
    inspection_from,
    inspection_record,
    packed,
    same_inspection,
)
from mlg_troubleshoot.workflows.check import CheckOptions, CheckResult

_ENTERED = (RecordKind.INSPECTION, RecordKind.CORRECTION, RecordKind.ASSESSMENT)


@dataclass(frozen=True, slots=True)
class Kept:
    """How many inspections were new, and how many stood there already; and which records of these
    gears now disagree in dates and landings.
    """

    new: int
    known: int
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class JudgedEntry:
    """An inspection that was judged, and its assessment as it is kept."""

    inspection: Inspection
    assessment: bytes


def entries(by: Mapping[str, Any], judgements: Iterable[Judgement]) -> list[JudgedEntry]:
    """What is kept of judgements; nothing of a row that was not judged."""
    return [
        JudgedEntry(j.inspection, packed_assessment(by, j))
        for j in judgements
        if isinstance(j, Assessment)
    ]


def keep(
    result: CheckResult,
    options: CheckOptions,
    store: Store,
    same_tail: Callable[[str, str], bool] | None = None,
    progress: Progress = lambda _done, _total: None,
    judged: Sequence[JudgedEntry] | None = None,
) -> Kept:
    """Add the judged inspections of a check and their assessments, all or none.

    ``same_tail`` answers whether two spellings of a tail number mean one aircraft; without it they
    are refused. ``judged``: the entries of a result that does not hold its judgements.
    """
    by = judged_by(result.gear, options)
    if judged is None:
        judged = entries(by, result.judgements)
    tails = _settled_tails((entry.inspection.tail_no for entry in judged), store, same_tail)

    def written() -> Iterator[Inspection]:
        for entry in judged:
            tail = entry.inspection.tail_no
            yield (
                replace(entry.inspection, tail_no=tails[tail])
                if tail in tails
                else (entry.inspection)
            )

    records: list[Record] = []
    first: dict[bytes, bytes] = {}
    stood = done = 0
    made_records = map(inspection_record, _under_first_ids(written(), store))
    each = zip(judged, written(), _under_first_days(made_records, store), strict=True)
    while block := list(islice(each, AT_ONCE)):
        known = store.known([record.identity_hash for _entry, _row, record in block])
        stood += len(known.keys() - first.keys())
        first.update({i: kept.packed for i, kept in known.items() if i not in first})
        for entry, row, record in block:
            # Before what was read after it.
            records += _repairs_of(row, store)
            # Wherever an inspection was entered again, it is the first entry that was assessed.
            of = first.setdefault(record.identity_hash, record.packed)
            records += [record, assessment_record(by, entry.assessment, record, of)]
            done += 1
            progress(done, len(judged))
    store.add(
        records,
        lambda kept, new: new.kind is not RecordKind.INSPECTION or _agrees(store, kept, new),
    )
    gears = {(record.tail_no, record.side) for record in records}
    new = len(first) - stood
    return Kept(new, len(judged) - new, tuple(warnings_of(store, gears)))


def under_a_free_id(made: Inspection, store: Store) -> Inspection:
    """An inspection whose id was made from the second of its entry: with a number behind it where
    the gear has another inspection of that id.
    """
    records = store.of_gear(*key_of(made))
    kept = [r for r in records if r.kind is RecordKind.INSPECTION]
    by_id = {record.record_id: record for record in kept}
    free = made
    number = 1
    while (other := by_id.get(free.record_id)) and not same_inspection(
        other, inspection_record(free)
    ):
        number += 1
        free = replace(made, record_id=f"{made.record_id}-{number}")
    return free


def _repairs_of(row: Inspection, store: Store) -> list[Record]:
    """The repair that a row states, as records; none that the store keeps already."""
    repair = stated_repair(row)
    if repair is None:
        return []
    known = [
        record for record in store.of_gear(*key_of(row)) if record.day == repair.day.isoformat()
    ]
    body = {"landings": None, "work_order": None}
    kinds = {RecordKind.REPAIR: sorted(repair.joints), RecordKind.RERIG: repair.rerigged}
    return [
        Record(kind, "", *key_of(row), repair.day.isoformat(), packed(body | more))
        for kind, said in kinds.items()
        if said
        for more in ({"joints": said} if kind is RecordKind.REPAIR else {},)
        if not any(r.kind is kind and r.body.get("joints") == more.get("joints") for r in known)
    ]


def row_of(store: Store, record_id: str, result: CheckResult) -> tuple[Record, CheckResult]:
    """The record that is wrong, and what a check found of the row that is to take its place: the
    only one of a table, or that with its id and gear.
    """
    wrong = find(store, record_id)
    if len(result.judgements) == 1:
        return wrong, result
    of_wrong = wrong.record_id, wrong.tail_no, wrong.side
    own: list[Judgement] = []
    places: list[RowSource] = []
    for judged in result.judgements:
        row = judged.inspection if isinstance(judged, Assessment) else judged.row
        if of_wrong == (row.record_id, row.tail_no, row.side):
            own.append(judged)
            places.append(row.source)
    problems = [p for p in result.problems if RowSource(p.file, p.sheet, p.row) in places]
    return wrong, replace(result, judgements=tuple(own), problems=tuple(problems))


def correct(store: Store, wrong: Record, result: CheckResult, options: CheckOptions) -> Record:
    """Append the right inspection for a wrong one; the wrong one stays readable in the chain."""
    judged = [j for j in result.judgements if isinstance(j, Assessment)]
    if len(judged) != 1 or len(result.judgements) != 1:
        raise UsageError(
            f"a correction needs one valid inspection {wrong.record_id} of {wrong.tail_no}"
            f" {wrong.side}, and the file has {len(judged)}",
            "Give a file with the corrected row alone, or a table in which it has this record_id.",
        )
    return supersede(store, wrong, result, options)


def is_same(kept: Record, result: CheckResult) -> bool:
    """Whether a check found what is kept already."""
    return all(
        isinstance(j, Assessment) and same_inspection(kept, inspection_record(j.inspection))
        for j in result.judgements
    )


def supersede(store: Store, wrong: Record, result: CheckResult, options: CheckOptions) -> Record:
    """Append what takes the place of a kept inspection, with the repair that it states; one that
    only the former stated is void.
    """
    (judged,) = (j for j in result.judgements if isinstance(j, Assessment))
    right = judged.inspection
    if (right.tail_no, right.side.value) != (wrong.tail_no, wrong.side):
        raise UsageError(
            f"the correction is for {right.tail_no} {right.side}, the record for {wrong.tail_no}"
            f" {wrong.side}",
            "Void the record (mlg history void) and keep the corrected one: mlg check FILE --keep",
        )
    record = inspection_record(right, RecordKind.CORRECTION, supersedes=wrong.digest)
    repairs = [*_repairs_taken_back(store, wrong, right), *_repairs_of(right, store)]
    by = judged_by(result.gear, options)
    judgement = assessment_record(by, packed_assessment(by, judged), record, record.packed)
    store.add([*repairs, record, judgement])
    return record


def take_back_repair(store: Store, wrong: Record, right: Inspection) -> None:
    """Void the repair that only a kept inspection states, before what takes its place is judged."""
    store.add(_repairs_taken_back(store, wrong, right))


def _repairs_taken_back(store: Store, wrong: Record, right: Inspection) -> list[Record]:
    """Void the repair that came with an inspection which states it no longer; a later one that it
    states is a second repair.
    """
    kept = inspection_from(wrong)
    was, stands = stated_repair(kept), stated_repair(right)
    if was is None or was == stands:
        return []
    if stands is not None and surely_later(right.repair_date, kept.repair_date):
        return []
    life = life_of(store, wrong.tail_no, wrong.side)
    entered = [record.seq for record in life.records if record.kind in _ENTERED]
    stating = {
        version.seq
        for version in life.versions(wrong)
        if (repair := stated_repair(inspection_from(version))) is not None
        and (stands is None or repair == was)
    }
    return [
        Record(
            RecordKind.VOID,
            "",
            wrong.tail_no,
            wrong.side,
            "",
            packed({"voids": repair.digest, "why": "taken back with the answer that stated it"}),
        )
        for repair in life.repairs
        if min((seq for seq in entered if seq > repair.seq), default=0) in stating
    ]


def judged_by(gear: Gear, options: CheckOptions) -> dict[str, Any]:
    """What an assessment was made with."""
    from mlg_troubleshoot.reporting.provenance import program_version

    return {
        "program_version": program_version(),
        "geometry_sha256": gear.geometry_sha256,
        "extension": None if options.extension is None else options.extension.describe(),
    }


def packed_assessment(by: Mapping[str, Any], assessment: Assessment) -> bytes:
    from mlg_troubleshoot.reporting.json_form import kept_as_json

    return packed({**by, "result": kept_as_json(assessment)})


def assessment_record(by: Mapping[str, Any], body: bytes, of: Record, first: bytes) -> Record:
    """An assessment as a record: of an inspection, which is known by its first entry."""
    identity = (of.identity_hash.hex(), *map(str, by.values()), first.hex())
    return replace(of, kind=RecordKind.ASSESSMENT, packed=body, identity=identity)


def _under_first_ids(inspections: Iterable[Inspection], store: Store) -> Iterator[Inspection]:
    """The same row of a renamed file has another made id: it is the inspection that was kept
    first.
    """
    gears: set[GearKey] = set()
    first: dict[tuple[str, ...], Record] = {}
    for inspection in inspections:
        row = place_in_file(inspection.record_id)
        key = (inspection.tail_no, inspection.side.value)
        if not row:
            yield inspection
            continue
        if key not in gears:
            gears.add(key)
            for kept in store.of_gear(*key):
                if kept.kind is RecordKind.INSPECTION:
                    first.setdefault((*key, kept.day, place_in_file(kept.record_id)), kept)
        record = inspection_record(inspection)
        kept = first.setdefault((*key, record.day, row), record)
        renamed = replace(inspection, record_id=kept.record_id)
        yield renamed if same_inspection(kept, inspection_record(renamed)) else inspection


def _under_first_days(records: Iterable[Record], store: Store) -> Iterator[Record]:
    """A record is a kept one of its id, with its day corrected, if that one has none, or if it says
    what that one says, or what that was corrected to.
    """
    every = iter(records)
    gears = set(store.gears())
    ids: dict[GearKey, set[str]] = {}
    while block := list(islice(every, AT_ONCE)):
        known = store.known([record.identity_hash for record in block])
        for record in block:
            key = record.tail_no, record.side
            if record.identity_hash in known or key not in gears:
                yield record
                continue
            if key not in ids:
                ids[key] = {kept.record_id for kept in store.of_gear(*key)}
            first = _redated(store, record) if record.record_id in ids[key] else None
            yield (
                record
                if first is None
                else replace(record, identity=(record.record_id, *key, first.day))
            )


def _redated(store: Store, record: Record) -> Record | None:
    """The first entry of the inspection that a record is with another day."""
    own = _versions_by_id(store, (record.tail_no, record.side)).get(record.record_id, [])
    redated = (
        versions[0]
        for versions in own
        if not versions[-1].day
        or any(same_inspection(each, record, "inspection_date") for each in versions)
    )
    return next(redated, None)


def _versions_by_id(store: Store, key: GearKey) -> dict[str, list[list[Record]]]:
    """Each kept inspection of a gear, from its first entry to what it was last corrected to."""
    life = life_of(store, *key)
    found: dict[str, list[list[Record]]] = {}
    for each in life.inspections:
        versions = life.versions(each.record)
        found.setdefault(versions[0].record_id, []).append(versions)
    return found


def _agrees(store: Store, kept: Record, new: Record) -> bool:
    """The same as kept, or as what the kept one was corrected to."""
    if same_inspection(kept, new):
        return True
    every = _versions_by_id(store, (kept.tail_no, kept.side)).get(kept.record_id, [])
    return any(
        same_inspection(each, new)
        for versions in every
        if versions[0].digest == kept.digest
        for each in versions
    )


def _settled_tails(
    tails: Iterable[str], store: Store, same_tail: Callable[[str, str], bool] | None
) -> dict[str, str]:
    """Spellings that differ only in case, blanks, dashes or O for 0: never one aircraft without
    being asked.
    """
    known = dict.fromkeys(tail for tail, _side in store.gears())
    by_spelling: dict[str, str] = {}
    for tail in known:
        by_spelling.setdefault(plain_tail(tail), tail)
    settled: dict[str, str] = {}
    for tail in dict.fromkeys(tails):
        other = by_spelling.setdefault(plain_tail(tail), tail)
        if tail in known or other == tail:
            continue
        if same_tail is None:
            raise StoreError(
                f"tail {tail!r} differs from {other!r} only in case, blanks, dashes or O for 0;"
                " nothing was kept",
                "Correct it, or pass --tails same (one aircraft) or --tails apart (two).",
            )
        if same_tail(tail, other):
            settled[tail] = other
    return settled
