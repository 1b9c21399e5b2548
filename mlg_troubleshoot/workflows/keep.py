"""Keep what a check found: inspections with their assessments, and corrections."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, find, life_of, warnings_of, without_dashes
from mlg_troubleshoot.life.since_repairs import key_of, stated_repair
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


def keep(
    result: CheckResult,
    options: CheckOptions,
    store: Store,
    same_tail: Callable[[str, str], bool] | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
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
    inspections = [inspection_record(each) for each in _under_first_ids(written, store)]
    known = store.known([record.identity_hash for record in inspections])
    stood = len(known)
    records: list[Record] = []
    each = zip(judged, written, inspections, strict=True)
    for done, (assessment, row, record) in enumerate(each, 1):
        # Before what was read after it.
        records += _repairs_of(row, store)
        # Wherever an inspection was entered again, it is the first entry that was assessed.
        first = known.setdefault(record.identity_hash, record)
        records += [record, assessment_record(result.gear, options, assessment, record, first)]
        progress(done, len(judged))
    store.add(
        records,
        lambda kept, new: new.kind is not RecordKind.INSPECTION or _agrees(store, kept, new),
    )
    gears = {(record.tail_no, record.side) for record in records}
    new = len(known) - stood
    return Kept(new, len(inspections) - new, tuple(warnings_of(store, gears)))


def under_a_free_id(made: Inspection, store: Store) -> Inspection:
    """An inspection whose id was made from the second of its entry: with a number behind it where
    the gear has another inspection of that id.
    """
    kept = [r for r in store.of_gear(*key_of(made)) if r.kind is RecordKind.INSPECTION]
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
    body: dict[str, Any] = {"landings": None, "work_order": None}
    kinds = {RecordKind.REPAIR: sorted(repair.joints), RecordKind.RERIG: repair.rerigged}
    return [
        Record(kind, "", *key_of(row), repair.day.isoformat(), packed(body | more))
        for kind, said in kinds.items()
        if said
        for more in ({"joints": said} if kind is RecordKind.REPAIR else {},)
        if not any(r.kind is kind and r.body.get("joints") == more.get("joints") for r in known)
    ]


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
            f"the correction is of {right.tail_no} {right.side}, the record of {wrong.tail_no}"
            f" {wrong.side}",
            "Void the record (mlg history void) and keep the right one: mlg check FILE --keep",
        )
    record = inspection_record(right, RecordKind.CORRECTION, supersedes=wrong.digest)
    repairs = [*_repairs_taken_back(store, wrong, right), *_repairs_of(right, store)]
    judgement = assessment_record(result.gear, options, judged, record, record)
    store.add([*repairs, record, judgement])
    return record


def _repairs_taken_back(store: Store, wrong: Record, right: Inspection) -> list[Record]:
    """Void the repair that came with an inspection which states it no longer."""
    was, stands = (stated_repair(row) for row in (inspection_from(wrong), right))
    if was is None or (stands and (was.day, was.joints) == (stands.day, stands.joints)):
        return []
    life = life_of(store, wrong.tail_no, wrong.side)
    before = max(
        (r.seq for r in life.records if r.kind in _ENTERED and r.seq < wrong.seq), default=0
    )
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
        if before < repair.seq < wrong.seq
    ]


def assessment_record(
    gear: Gear, options: CheckOptions, assessment: Assessment, of: Record, first: Record
) -> Record:
    """An assessment as a record: of an inspection, which is known by its first entry."""
    from mlg_troubleshoot.reporting.json_form import kept_as_json
    from mlg_troubleshoot.reporting.provenance import program_version

    by = {
        "program_version": program_version(),
        "geometry_sha256": gear.geometry_sha256,
        "extension": None if options.extension is None else options.extension.describe(),
    }
    return replace(
        of,
        kind=RecordKind.ASSESSMENT,
        packed=packed({**by, "result": kept_as_json(assessment)}),
        identity=(of.identity_hash.hex(), *map(str, by.values()), first.packed.hex()),
    )


def _under_first_ids(inspections: Sequence[Inspection], store: Store) -> list[Inspection]:
    """The same row of a renamed file has another made id: it is the inspection that was kept
    first.
    """
    gears: set[GearKey] = set()
    first: dict[tuple[str, ...], Record] = {}

    def under_first_id(inspection: Inspection) -> Inspection:
        row = place_in_file(inspection.record_id)
        key = (inspection.tail_no, inspection.side.value)
        if not row:
            return inspection
        if key not in gears:
            gears.add(key)
            for kept in store.of_gear(*key):
                if kept.kind is RecordKind.INSPECTION:
                    first.setdefault((*key, kept.day, place_in_file(kept.record_id)), kept)
        record = inspection_record(inspection)
        kept = first.setdefault((*key, record.day, row), record)
        renamed = replace(inspection, record_id=kept.record_id)
        return renamed if same_inspection(kept, inspection_record(renamed)) else inspection

    return [under_first_id(inspection) for inspection in inspections]


def _agrees(store: Store, kept: Record, new: Record) -> bool:
    """The same as kept, or as what the kept one was corrected to."""
    return same_inspection(kept, new) or any(
        record.kind is RecordKind.CORRECTION
        and record.body["supersedes"] == kept.digest
        and same_inspection(record, new)
        for record in store.of_gear(kept.tail_no, kept.side)
    )


def _settled_tails(
    judged: Sequence[Assessment], store: Store, same_tail: Callable[[str, str], bool] | None
) -> dict[str, str]:
    """Spellings that differ only in case, blanks or dashes: never one aircraft without being
    asked.
    """
    known = dict.fromkeys(tail for tail, _side in store.gears())
    by_spelling: dict[str, str] = {}
    for tail in known:
        by_spelling.setdefault(without_dashes(tail), tail)
    settled: dict[str, str] = {}
    for tail in dict.fromkeys(a.inspection.tail_no for a in judged):
        other = by_spelling.setdefault(without_dashes(tail), tail)
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
