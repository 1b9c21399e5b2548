"""The log of a gear as a log book: one line per fact, in the order of time."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from itertools import groupby
from typing import Any

from mlg_troubleshoot.decision.inspection import Inspection, Outcome, RiggingCheck
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.life.folding import ENTERED, GearLife
from mlg_troubleshoot.store import Record, RecordKind, cells_of, said_of
from mlg_troubleshoot.units import Length, LengthUnit, Sentence

_RERIGGED = "rigging corrected"


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line of a log book.

    date: ISO 8601, None if it is not known. value_in: a radial clearance, the signed displacement
    of the plunger, or the worst case of a verdict. [in] counts: false where it was voided.
    """

    json_names = """
        kind text=full date joints value_in verdict gear_landings record_id hash counts
    """
    kind: str
    text: str
    how: str = ""
    date: str | None = None
    joints: tuple[int, ...] = ()
    value_in: float | None = None
    verdict: str | None = None
    gear_landings: float | None = None
    record_id: str | None = None
    hash: str = ""
    counts: bool = True
    is_over_limit: bool = False

    @property
    def full(self) -> str:
        return Sentence.of("{}, {}", self.text, self.how) if self.how else self.text


def shortened(lines: Iterable[LogLine]) -> Iterator[LogLine]:
    """Lines with the readings of one visit that are within their limits together."""
    for (_hash, _how, plain), same in groupby(
        lines, lambda x: (x.hash, x.how, x.kind == "reading" and not x.is_over_limit)
    ):
        together = list(same)
        if plain:
            text = ", ".join(line.text for line in together)
            together = [replace(together[0], text=text)]
        yield from together


AsFoundAsLeft = tuple[str, str, str]


def as_found_as_left(lines: Iterable[LogLine]) -> list[AsFoundAsLeft]:
    """Outcome, plunger and each joint before and after the last repair of a gear; nothing without
    one. Repairs between which the gear failed or was found outside are one.
    """
    known = [line for line in lines if line.counts]
    repairs = [n for n, line in enumerate(known) if _is_repair(line)]
    if not repairs:
        return []
    first = repairs[-1]
    for before in reversed(repairs[:-1]):
        between = {line.kind for line in known[before:first]}
        if Outcome.RETRACTED.value in between or Outcome.FAILED.value not in between:
            break
        first = before
    found, left = newest_values(known[:first]), newest_values(known[first:])
    restored: set[int] = set()
    for line in known[first:]:
        if _is_repair(line):
            restored.update(line.joints)
        elif line.kind == "reading" and line.joints[0] not in restored:
            found.setdefault(line.joints[0], _value(line))
    joints = {n for each in (found, left) for n in each if isinstance(n, int)}
    done = [
        f"{line.text} on {line.date}" if line.date else line.text
        for line in known[first:]
        if _is_repair(line) or line.kind == "signed_off"
    ]
    return [
        ("Repair", "", "; ".join(done)),
        ("Outcome", found.get("outcome", "not tried"), left.get("outcome", "not tried")),
        ("Plunger", found.get("plunger", "not read"), left.get("plunger", "not read")),
        *(
            (
                f"#{n}",
                found.get(n, "not read"),
                left.get(n, "restored, not read" if n in restored else "as found"),
            )
            for n in sorted(joints | restored)
        ),
    ]


def _is_repair(line: LogLine) -> bool:
    return line.kind in ("restored", "other_repair") or line.text == _RERIGGED


def _value(line: LogLine) -> str:
    return line.text.partition(" ")[2]


def newest_values(lines: Iterable[LogLine]) -> dict[str | int, str]:
    """What was last said of the outcome and the plunger, and on its last day of each joint."""
    found: dict[str | int, str] = {}
    days: dict[int, str | None] = {}
    for line in lines:
        if line.kind == "reading":
            joint = line.joints[0]
            same_day = [found[joint]] if joint in found and days[joint] == line.date else []
            found[joint] = ", ".join([*same_day, _value(line)])
            days[joint] = line.date
        elif line.kind == "plunger":
            found["plunger"] = _signed(line.value_in or 0.0)
        elif line.kind == "restored":
            found = {what: said for what, said in found.items() if what not in line.joints}
        elif line.kind in tuple(Outcome):
            found["outcome"] = line.text
    return found


def log_of(life: GearLife, gear: Gear, joints: Collection[int] | None = None) -> list[LogLine]:
    """Every fact of a gear, and what was corrected or voided, in the order of time; what has no
    day stands where it was entered. `joints`: without readings of others.
    """
    lines: list[LogLine] = []
    newest = {entry.record: entry.row for entry in life.entries}
    rows = {entry.record.key: newest.get(entry.newest) for entry in life.entries}
    for entry in life.entries:
        record = entry.record
        about: dict[str, Any] = {
            "record_id": record.record_id or None,
            "hash": record.digest,
            "counts": entry.counts,
        }
        found = [*_corrected(*entry.correction)] if entry.correction else []
        if entry.row is not None:
            about["gear_landings"] = entry.row.gear_landings
            found += visit_lines(entry.row, gear, joints) + _verdict(life, record)
        elif record.kind not in ENTERED:
            about["gear_landings"] = record.body.get("landings")
            found = _other_lines(record)
            if record.kind is RecordKind.VOID and (void := rows.get(record.body["voids"])):
                text = Sentence.of("void: {}: {}", in_words(void, gear), record.body["why"])
                found = [LogLine("void", text, date=record.day or None)]
        lines += [replace(line, **about) for line in found]
    return _in_time(lines)


def _verdict(life: GearLife, record: Record) -> list[LogLine]:
    """What the program says today of an inspection that counts."""
    said = life.judged.get(record.digest)
    if said is None or said.verdict is None:
        return []
    # It is zero only where no joint has play, or none was read.
    worst = said.predicted_displacement_in
    how = Sentence.of("worst case {}", Length(worst)) if worst else ""
    text = f"verdict: {said.title}"
    day = record.day or None
    return [LogLine("verdict", text, how, day, value_in=worst, verdict=said.verdict.value)]


def up_to(lines: Iterable[LogLine], row: Inspection) -> list[LogLine]:
    """What was found or done until the last day of a visit, in the order of time."""
    dates = row.inspection_date, row.repair_date, row.plunger_date, row.outcome_date
    last = max((day for day in map(_day, dates) if day), default="9999")
    return _in_time([line for line in lines if (line.date or "") <= last])


def _in_time(lines: Sequence[LogLine]) -> list[LogLine]:
    """Sort lines by day; one without a day stays behind the line that it follows."""
    days: list[str] = []
    for line in lines:
        days.append(line.date or (days[-1] if days else ""))
    order = sorted(range(len(lines)), key=lambda n: days[n])
    return [lines[n] for n in order]


def _other_lines(record: Record) -> list[LogLine]:
    body = record.body
    day = record.day or None
    match record.kind:
        case RecordKind.REPAIR if "stated_by" not in body:
            joints = tuple(body["joints"])
            return [LogLine("restored", f"restored {joint_list(joints)}", date=day, joints=joints)]
        case RecordKind.RERIG if "stated_by" not in body:
            return [LogLine("rigging", _RERIGGED, date=day)]
        case RecordKind.VOID:
            return [LogLine("void", f"void: {body['why']}", date=day)]
        case RecordKind.OUTCOME:
            joints = () if body["joint"] is None else (body["joint"],)
            where = f" ({joint_list(joints)})" if joints else ""
            return [LogLine("finding", f"found: {body['found']}{where}", date=day, joints=joints)]
    return []


def visit_lines(
    row: Inspection, gear: Gear, joints: Collection[int] | None = None
) -> list[LogLine]:
    """The facts of a visit. `joints`: without readings of others."""
    read = row.clearance_in if joints is None else row.clearance_in.keys() & joints
    left = {n for n in read if row.is_left or n in row.restored_joints}
    found: list[LogLine] = []
    after = [*_readings(row, gear, left)]
    for reading in row.readings_in:
        (after if _is_after(row, gear, reading) else found).append(_plunger(row, reading))
    if row.outcome is not None:
        day = _day(row.outcome_date or row.inspection_date)
        tried = LogLine(row.outcome.value, row.outcome.value, date=day)
        newer = row.is_since_repair(row.outcome_date)
        newer = row.is_repaired and (newer or row.outcome is Outcome.RETRACTED)
        after.append(tried) if newer else found.insert(0, tried)
    found += _readings(row, gear, {*read} - left)
    day = _day(row.repair_date or row.inspection_date)
    if restored := row.restored_joints:
        text = f"restored {joint_list(restored)}"
        found.append(LogLine("restored", text, date=day, joints=restored))
    if row.rigging_checked not in (None, RiggingCheck.NO):
        corrected = row.rigging_checked is RiggingCheck.CORRECTED
        text = _RERIGGED if corrected else "rigging checked"
        found.append(LogLine("rigging", text, date=day))
    if row.other_repair:
        found.append(LogLine("other_repair", f"repaired {row.other_repair}", date=day))
    if row.signed_off:
        text = f"signed off by {row.signed_off}"
        after.append(LogLine("signed_off", text, date=_day(row.inspection_date)))
    return [*found, *after]


def in_words(row: Inspection, gear: Gear) -> Sentence:
    """The facts of a visit in one sentence."""
    return Sentence.joined((line.text for line in shortened(visit_lines(row, gear))), ", ")


def _plunger(row: Inspection, reading: float) -> LogLine:
    text = Sentence.of("plunger {}", _signed(reading))
    day = _day(row.plunger_date or row.inspection_date)
    return LogLine("plunger", text, date=day, value_in=reading)


def _signed(value_in: float) -> Sentence:
    return Sentence.of("{}", replace(Length.brief(value_in), sign=True))


def _is_after(row: Inspection, gear: Gear, reading: float) -> bool:
    """Whether a plunger reading follows the repair of its visit; where no day says so, one within
    the margin does.
    """
    if not row.is_repaired:
        return False
    newer = row.is_since_repair(row.plunger_date)
    margin = gear.margin.value if row.margin_in is None else row.margin_in
    return abs(reading) <= margin + ROUNDING_IN if newer is None else newer


def _corrected(old: Inspection, row: Inspection) -> Iterator[LogLine]:
    """What a later version of a visit says instead of the one before."""
    was, now = (cells_of(said_of(each)) for each in (old, row))
    day = _day(row.inspection_date)
    for what in dict.fromkeys((*was, *now)):
        if was.get(what) != now.get(what):
            both = (each.get(what, "blank") for each in (was, now))
            text = Sentence.of("correction: {} {} → {}", what, *both)
            yield LogLine("correction", text, date=day)


def _entered(row: Inspection, joint: int) -> str:
    """A reading as it was entered, or in inches where that is not known."""
    return str(row.entered.get(joint) or f"{row.clearance_in[joint]:.4f} in")


def _readings(row: Inspection, gear: Gear, joints: Collection[int]) -> Iterator[LogLine]:
    """Readings as they were entered, with the limit as it would read where it is exceeded."""
    by = f"measured by {row.technician_id}" if row.technician_id else ""
    how = ", ".join(filter(None, (row.convention.words, by)))
    # What is over its limit stands first.
    over_first = {n: not gear.joint(n).is_over_limit(row.clearance_in[n]) for n in sorted(joints)}
    for joint in sorted(over_first, key=over_first.__getitem__):
        value = row.clearance_in[joint]
        text = f"#{joint} {_entered(row, joint)}"
        limit = gear.joint(joint)
        over = limit.is_over_limit(value)
        if over:
            unit = row.entered[joint].unit if joint in row.entered else LengthUnit.INCH
            shown = unit.from_inches(limit.limit.value * row.convention.per_radial)
            text += f" (limit {round(shown, unit.decimals):g})"
        day = _day(row.inspection_date)
        yield LogLine("reading", text, how, day, (joint,), value, is_over_limit=over)


def _day(at: date | None) -> str | None:
    return None if at is None else at.isoformat()[:10]
