"""Tables of gears whose rows come in any order, with what each gear's evidence says.

Nothing here knows the program. A gear has visits: a day or moment (or none, or one that cannot be
read), some clearances, perhaps a plunger reading, an outcome, a repair. The truth follows one rule:
evidence that a gear is not in order (a plunger beyond the margin, FAILED, a joint over its limit)
stands unless something that is *surely* later, and about the same thing, replaces it.
"""

from __future__ import annotations

import csv
import io
import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone

MARGIN_IN = 0.030
LIMIT_IN = 0.0075
COLUMNS = (
    *("record_id", "tail_no", "side", "clearance_convention", "inspection_date"),
    *(f"clearance_{joint}_in" for joint in range(1, 11)),
    *("plunger_displacement_in", "plunger_gauge_u_in", "plunger_date", "outcome", "outcome_date"),
    *("restored_joints", "repair_date", "gear_landings"),
)


@dataclass(frozen=True)
class When:
    """A point in time as it is written: a day, perhaps with a time and a zone; or nothing known."""

    text: str
    earliest: datetime | None = None
    latest: datetime | None = None

    def surely_before(self, other: When) -> bool:
        return (
            self.latest is not None and other.earliest is not None and self.latest < other.earliest
        )


UNKNOWN = When("")
# The widest difference between two clocks that state no zone.


def day(of: datetime) -> When:
    start = of.replace(hour=0, minute=0)
    # Whatever zone the day is meant in: two days that differ are in order.
    return When(f"{of:%Y-%m-%d}", start, start + timedelta(hours=23, minutes=59))


def moment(of: datetime, offset_hours: int | None) -> When:
    if offset_hours is None:
        return When(f"{of:%Y-%m-%dT%H:%M}", of, of)
    zone = timezone(timedelta(hours=offset_hours))
    there = of.replace(tzinfo=zone)
    universal = there.astimezone(UTC).replace(tzinfo=None)
    text = there.isoformat(timespec="minutes")
    return When(text, universal, universal)


def drawn_when(rng: random.Random, of: datetime, kind: str) -> When:
    """One spelling of a moment. In a table either every time has a zone or none has."""
    if kind == "days":
        return day(of)
    if kind == "unreadable":
        return rng.choice(
            [UNKNOWN, When("2026-02-30"), When("31/31/2026"), When("soon"), day(of), day(of)]
        )
    if kind == "times":
        return rng.choice([moment(of, None), day(of)])
    return moment(of, rng.choice([-7, 0, 1, 9]))


@dataclass
class Visit:
    """One row. `clearance_in` by joint [in], `plunger_in` [in]."""

    when: When
    clearance_in: dict[int, float] = field(default_factory=dict)
    plunger_in: float | None = None
    plunger_when: When = UNKNOWN
    outcome: str = ""
    outcome_when: When = UNKNOWN
    restored: tuple[int, ...] = ()
    repaired: When = UNKNOWN
    # Landings order nothing: two numbers of one day contradict each other.
    landings: str = ""

    def of_plunger(self) -> When:
        return self.plunger_when if self.plunger_when.text else self.when

    def of_outcome(self) -> When:
        return self.outcome_when if self.outcome_when.text else self.when

    def row(self, record: str, tail: str) -> dict[str, str]:
        written = {
            "record_id": record,
            "tail_no": tail,
            "side": "LH",
            "clearance_convention": "RADIAL",
            "inspection_date": self.when.text,
            "outcome": self.outcome,
            "outcome_date": self.outcome_when.text,
            "plunger_date": self.plunger_when.text,
            "restored_joints": " ".join(map(str, self.restored)),
            "repair_date": self.repaired.text,
            "gear_landings": self.landings,
        }
        if self.plunger_in is not None:
            written["plunger_displacement_in"] = f"{self.plunger_in:.4f}"
            written["plunger_gauge_u_in"] = "0.0005"
        for joint, value in self.clearance_in.items():
            written[f"clearance_{joint}_in"] = f"{value:.4f}"
        return written


@dataclass(frozen=True)
class Aircraft:
    """A gear and what stands against it."""

    tail: str
    visits: tuple[Visit, ...]

    @property
    def standing(self) -> tuple[str, ...]:
        """Evidence that nothing surely later replaced."""
        return (*self._plungers(), *self._failures(), *self._joints())

    def _repairs(self) -> Iterable[tuple[When, tuple[int, ...]]]:
        return ((v.repaired, v.restored) for v in self.visits if v.restored)

    def _plungers(self) -> Iterable[str]:
        for visit in self.visits:
            read, when = visit.plunger_in, visit.of_plunger()
            if read is None or abs(read) <= MARGIN_IN:
                continue
            again = (
                other.of_plunger()
                for other in self.visits
                if other.plunger_in is not None and abs(other.plunger_in) <= MARGIN_IN
            )
            later = (*again, *(repaired for repaired, _ in self._repairs()))
            if not any(when.surely_before(other) for other in later):
                yield f"plunger {read:.4f}"

    def _failures(self) -> Iterable[str]:
        for visit in self.visits:
            when = visit.of_outcome()
            if visit.outcome == "FAILED" and not any(
                when.surely_before(repaired) for repaired, _ in self._repairs()
            ):
                yield "FAILED"

    def _joints(self) -> Iterable[str]:
        for visit in self.visits:
            for joint, value in visit.clearance_in.items():
                if value <= LIMIT_IN:
                    continue
                again = (
                    other.when
                    for other in self.visits
                    if other.clearance_in.get(joint, LIMIT_IN + 1) <= LIMIT_IN
                )
                restored = (when for when, joints in self._repairs() if joint in joints)
                if not any(visit.when.surely_before(other) for other in (*again, *restored)):
                    yield f"joint {joint}"


def drawn_visit(rng: random.Random, of: datetime, kind: str, worn: int) -> Visit:
    visit = Visit(drawn_when(rng, of, kind), landings=rng.choice(["", "100", "500"]))
    if rng.random() < 0.9:
        # Tight everywhere: without evidence against it the gear is within its margin.
        joints = range(1, 11) if rng.random() < 0.9 else rng.sample(range(1, 11), 3)
        visit.clearance_in = {joint: rng.choice([0.0002, 0.0005]) for joint in joints}
        if rng.random() < 0.2:
            visit.clearance_in[worn] = 0.0121
    if rng.random() < 0.35:
        visit.plunger_in = rng.choice([0.004, -0.006, 0.002, 0.06])
        if rng.random() < 0.3:
            visit.plunger_when = drawn_when(rng, of + timedelta(hours=rng.randint(-2, 2)), kind)
    if rng.random() < 0.3:
        visit.outcome = rng.choice(["FAILED", "RETRACTED", "RETRACTED", "RETRACTED"])
        if rng.random() < 0.3:
            visit.outcome_when = drawn_when(rng, of + timedelta(hours=rng.randint(-2, 2)), kind)
    if rng.random() < 0.45:
        visit.restored = (rng.choice([worn, 1 + worn % 10]),)
        moved = timedelta(days=rng.choice([-31, -1, 0, 0, 1]), hours=rng.choice([-3, 0, 3]))
        visit.repaired = drawn_when(rng, of + moved, kind)
    return visit


def drawn_aircraft(rng: random.Random, tail: str) -> Aircraft:
    kind = rng.choice(["days", "days", "times", "zones", "unreadable"])
    start = datetime(2026, 1, 5, 9, 0) + timedelta(days=rng.randrange(60))
    worn = rng.choice([6, 7, 8, 9])
    visits = []
    for _ in range(rng.choice([1, 2, 2, 3])):
        start += rng.choice([timedelta(0), timedelta(hours=2), timedelta(days=1, hours=1)])
        visits.append(drawn_visit(rng, start, kind, worn))
    rng.shuffle(visits)
    return Aircraft(tail, tuple(visits))


def table(aircraft: Sequence[Aircraft], part: int | None = None) -> str:
    """All visits as CSV; of `part` only the rows of that number of each gear."""
    out = io.StringIO()
    writer = csv.DictWriter(out, COLUMNS, restval="")
    writer.writeheader()
    for gear in aircraft:
        for number, visit in enumerate(gear.visits):
            if part is None or number == part:
                writer.writerow(visit.row(f"{gear.tail}-{number}", gear.tail))
    return out.getvalue()
