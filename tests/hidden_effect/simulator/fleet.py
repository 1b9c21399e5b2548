"""Who was inspected when, where, by whom and with what: the fleet before anything is measured.

Rows come in visits of one tail to one base, both gears of the tail on the same day more often than
not. Wear follows the landings of each gear with an exponent of its own for each joint: clearances
are correlated.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Texts = NDArray[np.object_]

#: Ways in which gauges, technicians and covariates hang on the bases.
ARRANGEMENTS = ("bases", "iid", "confounded")
#: Pairs of causes that a fleet can be arranged to make inseparable.
ALIASES = ("gauge_technician", "tail_gauge", "date_gauge", "side_technician", "tail_technician")

_DAYS = 730
_MAX_CLEARANCE_IN = 0.0145
_MAX_FLOAT_IN = 0.06


@dataclass(frozen=True, slots=True)
class Design:
    """True circumstances of every inspection, n rows in the order of their dates."""

    tail: Texts
    side: Texts
    gauge: Texts
    technician: Texts
    approach: Texts
    day: Array  # Date as proleptic ordinal, (n,) [d]
    landings: Array  # Landings since overhaul, (n,)
    temperature: Array  # Temperature of the gear, (n,) [degC]
    pressure: Array  # Hydraulic pressure during the reading, (n,) [psi]
    clearance: Array  # True radial clearances, (n, 10) [in]
    floats: Array  # True end floats, (n, 10) [in]
    margin: Array  # Margin found at rigging, (n,) [in]
    alias_day: float = float("nan")  # Day on which the gauges changed, NaN unless so arranged [d]
    # The two identities that an aliased arrangement ties together.
    alias_names: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """Number of inspections [-]."""
        return len(self.tail)

    def take(self, index: NDArray[np.intp]) -> Design:
        """The same fleet with the given rows."""
        arrays = {
            field.name: getattr(self, field.name)[index].copy()
            for field in fields(self)
            if not field.name.startswith("alias")
        }
        return replace(self, **arrays)


def date_text(day: float) -> str:
    """ISO date of an ordinal."""
    return datetime.date.fromordinal(int(day)).isoformat()


def draw_design(
    rng: np.random.Generator,
    rows: int,
    arrangement: str = "bases",
    alias: str | None = None,
    hand_pump: bool = True,
) -> Design:
    """Draw a fleet in one of ``ARRANGEMENTS``, with two identities tied together by one of
    ``ALIASES``; on the ``hand_pump`` some readings are taken at any pressure below the system's.
    """
    fleet = _identities(rng, rows, arrangement)
    if alias is not None:
        fleet |= _tie(rng, alias, fleet)
    tail, side, base, day = fleet["tail"], fleet["side"], fleet["base"], fleet["day"]
    climate = rng.uniform(-2.0, 22.0, 3)
    season = -np.cos(2.0 * np.pi * (day - 15.0) / 365.25)
    days, position = np.unique(day, return_inverse=True)
    local = rng.normal(0.0, 6.0, days.size)[position]
    temperature = np.clip(
        climate[base] + 12.0 * season + local + rng.normal(0.0, 1.5, rows), -30.0, 45.0
    )
    pressure = rng.uniform(2600.0, 3100.0, rows) + rng.uniform(-40.0, 40.0, 3)[base]
    if hand_pump:
        share = 0.45 if arrangement != "confounded" else np.array([0.15, 0.45, 0.75])[base]
        pumped = rng.random(rows) < share
        pressure[pumped] = rng.uniform(300.0, 2900.0, int(pumped.sum()))
    gear = np.array([f"{t} {s}" for t, s in zip(tail, side, strict=True)], dtype=object)
    landings, worn = _landings(rng, gear, base, day, arrangement)
    clearance, floats = _wear(rng, gear, landings, worn)
    margins = {key: round(float(rng.uniform(0.025, 0.040)), 3) for key in sorted(set(gear))}
    approach = np.where(
        rng.random(rows) < rng.uniform(0.45, 0.65), "EXTENDING", "RETRACTING"
    ).astype(object)
    return Design(
        tail=tail,
        side=side,
        gauge=fleet["gauge"],
        technician=fleet["technician"],
        approach=approach,
        day=day,
        landings=landings,
        temperature=temperature,
        pressure=np.clip(pressure, 0.0, 3500.0),
        clearance=clearance,
        floats=floats,
        margin=np.array([margins[key] for key in gear]),
        alias_day=float(fleet.get("alias_day", np.nan)),
        alias_names=fleet.get("alias_names", ()),
    )


def _names(rng: np.random.Generator, prefix: str, count: int, width: int) -> list[str]:
    numbers = rng.choice(np.arange(1, 10**width), size=count, replace=False)
    return [f"{prefix}{number:0{width}d}" for number in sorted(numbers)]


def _homes(rng: np.random.Generator, count: int) -> NDArray[np.intp]:
    return rng.permutation(np.concatenate([np.arange(3), rng.integers(0, 3, count - 3)]))


def _identities(rng: np.random.Generator, rows: int, arrangement: str) -> dict[str, Any]:
    tails = _names(
        rng, "N" if rng.random() < 0.8 else "", int(rng.integers(12, 21) + rows // 100 - 2), 3
    )
    gauges = _names(rng, "G-", int(rng.integers(4, 7)), 2)
    technicians = _names(rng, "T-", int(rng.integers(4, 7)), 2)
    tail_home = _homes(rng, len(tails))
    gauge_home, technician_home = _homes(rng, len(gauges)), _homes(rng, len(technicians))
    if arrangement == "confounded":
        # A base with one gauge and one technician would make the two inseparable: give it a second
        # gauge.
        technician_home = _homes(rng, len(technicians))
        for home in range(3):
            if (gauge_home == home).sum() == 1 and (technician_home == home).sum() == 1:
                gauges.append(f"G-X{home + 1}")
                gauge_home = np.append(gauge_home, home)
    first = datetime.date(2021, 1, 1).toordinal() + int(rng.integers(0, 900))
    busy = rng.dirichlet(np.full(len(tails), 6.0))
    keys = ("tail", "side", "gauge", "technician", "base", "day")
    columns: dict[str, list[Any]] = {key: [] for key in keys}
    visited: set[tuple[int, int]] = set()
    while len(columns["tail"]) < rows:
        tail = int(rng.choice(len(tails), p=busy))
        home = int(tail_home[tail])
        day = first + int(rng.integers(0, _DAYS))
        if (tail, day) in visited:
            continue
        visited.add((tail, day))
        gauge = _assign(rng, gauges, gauge_home, home, arrangement)
        technician = _assign(rng, technicians, technician_home, home, arrangement)
        sides = ["LH", "RH"] if rng.random() < 0.9 else [str(rng.choice(["LH", "RH"]))]
        for side in sides[: rows - len(columns["tail"])]:
            for key, value in zip(
                columns, (tails[tail], side, gauge, technician, home, day), strict=True
            ):
                columns[key].append(value)
    order = np.argsort(np.array(columns["day"]), kind="stable")
    fleet: dict[str, Any] = {
        key: np.array(columns[key], dtype=object)[order]
        for key in ("tail", "side", "gauge", "technician")
    }
    fleet["base"] = np.array(columns["base"])[order]
    fleet["day"] = np.array(columns["day"], dtype=float)[order]
    fleet["gauges"], fleet["technicians"] = gauges, technicians
    return fleet


def _assign(
    rng: np.random.Generator, names: list[str], homes: NDArray[np.intp], home: int, arrangement: str
) -> str:
    local = [name for name, at in zip(names, homes, strict=True) if at == home]
    away = 0.0 if arrangement == "confounded" else 0.18
    if arrangement == "iid" or rng.random() < away:
        local = names
    return str(rng.choice(local))


def _tie(rng: np.random.Generator, alias: str, fleet: dict[str, Any]) -> dict[str, Any]:
    """Rearrange gauges, technicians or sides so that two causes cannot be distinguished."""
    tail, side, day = fleet["tail"], fleet["side"], fleet["day"]
    gauge, technician = fleet["gauge"].copy(), fleet["technician"].copy()
    result: dict[str, Any] = {}
    tails, counts = np.unique(tail, return_counts=True)
    usual = str(tails[np.argsort(counts)[rng.integers((3 * len(tails)) // 4, len(tails))]])
    if alias == "gauge_technician":
        used, number = np.unique(gauge, return_counts=True)
        one = str(used[np.argmax(number * rng.uniform(0.7, 1.0, len(used)))])
        people, shared = np.unique(technician[gauge == one], return_counts=True)
        other = str(people[np.argmax(shared)])
        together = gauge == one
        elsewhere = (technician == other) & ~together
        technician[elsewhere] = rng.choice(
            [t for t in fleet["technicians"] if t != other], elsewhere.sum()
        )
        technician[together] = other
        result["alias_names"] = (one, other)
    elif alias in ("tail_gauge", "tail_technician"):
        names = fleet["gauges"] if alias == "tail_gauge" else fleet["technicians"]
        column = gauge if alias == "tail_gauge" else technician
        own = str(rng.choice(names))
        stray = (column == own) & (tail != usual)
        column[stray] = rng.choice([name for name in names if name != own], stray.sum())
        column[tail == usual] = own
        result["alias_names"] = (usual, own)
    elif alias == "date_gauge":
        change = float(np.ceil(np.quantile(day, rng.uniform(0.35, 0.65))))
        old, new = fleet["gauges"][:2]
        gauge[:] = np.where(day >= change, new, old)
        result |= {"alias_day": change, "alias_names": (old, new)}
    elif alias == "side_technician":
        own = str(rng.choice(fleet["technicians"]))
        stray = (technician == own) & (side == "LH")
        technician[stray] = rng.choice([t for t in fleet["technicians"] if t != own], stray.sum())
        technician[side == "RH"] = own
        result["alias_names"] = ("RH", own)
    else:
        raise ValueError(f"Unknown alias {alias!r}: expected one of {', '.join(ALIASES)}.")
    return result | {"gauge": gauge, "technician": technician}


def _landings(
    rng: np.random.Generator, gear: Texts, base: NDArray[np.intp], day: Array, arrangement: str
) -> tuple[Array, Array]:
    """Landings since overhaul and how hard each gear is used."""
    age = {key: rng.uniform(50.0, 2500.0) for key in sorted(set(gear))}
    hard = {key: float(rng.lognormal(0.0, 0.25)) for key in age}
    rate = {key: rng.uniform(0.5, 2.5) for key in age}
    start = day.min()
    total = np.array([age[g] + rate[g] * (d - start) for g, d in zip(gear, day, strict=True)])
    landings = 50.0 + total % 2950.0
    if arrangement == "confounded":
        landings = np.clip(landings * np.array([0.55, 0.8, 1.0])[base], 50.0, 3000.0)
    return np.rint(landings), np.array([hard[g] for g in gear])


def _wear(
    rng: np.random.Generator, gear: Texts, landings: Array, hard: Array
) -> tuple[Array, Array]:
    """True clearances and end floats."""
    rows = len(gear)
    exponent = rng.uniform(0.85, 1.2, 10)
    kilo = landings[:, None] / 1000.0
    own = {key: rng.lognormal(0.0, 0.45, 10) for key in sorted(set(gear))}
    play = {key: rng.uniform(0.15, 1.0, 10) for key in own}
    single = np.array([own[key] for key in gear])
    rate = rng.uniform(0.0009, 0.0021, 10)
    clearance = rng.uniform(0.0003, 0.0011, (rows, 10)) + rate * hard[
        :, None
    ] * single * kilo**exponent * (rng.lognormal(0.0, 0.35, (rows, 10)))
    used = 0.35 + 0.65 * kilo / 3.0
    ends = np.array([play[key] for key in gear]) * used * rng.lognormal(-0.1, 0.3, (rows, 10))
    floats = 0.003 + 0.055 * ends
    return np.minimum(clearance, _MAX_CLEARANCE_IN), np.minimum(floats, _MAX_FLOAT_IN)
