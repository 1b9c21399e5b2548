"""Fleets as they are really written down: gears with histories, and one blemish in the table.

Both sides are read at a visit, joints wear with landings from a level at a rate of their own, and
an overhaul gives new bushings. A blemish changes the gears, the reading or the sheet; what is true
stands apart from the table.
"""

from __future__ import annotations

import csv
import datetime
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import linkage, physics
from .departures import find
from .fleet import Design, date_text
from .generate import EffectSpec, _draw_effect, _Effects
from .physics import Gears, State
from .records import CLEARANCES, DISPLACEMENTS, FLOATS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = list[dict[str, Any]]

PLUNGER = DISPLACEMENTS[0]
#: The size of a blemish.
FORMS = ("mild", "strong")
#: Rows of the same tails that the table does not show [-].
UNSEEN = 400
#: Landings between two overhauls [-].
OVERHAUL = 2400.0
#: Standard deviations of a clearance reading and of a plunger reading, and their step [in].
READING_IN = 0.0003
PLUNGER_NOISE_IN = 0.0015
STEP_IN = 0.0005
#: Strength of the one listed cause beside a blemish, and of a strong creep or a learner [-].
BESIDE = 14.0
CREEP = 12.0
_YEAR = 365.0
_LOW_IN = 0.002
_LIMIT_IN = 0.004


@dataclass(slots=True)
class Scene:
    """A fleet before and while it is written down, n rows in the order of their dates."""

    rng: np.random.Generator
    strong: bool
    design: Design  # True circumstances of every row
    base: NDArray[np.intp]  # Where each row was read, (n,)
    bushings: NDArray[np.intp]  # Which set of bushings each row has, (n,)
    seen: Mask  # Rows that stand in the table, (n,)
    noise: Array  # Errors of the plunger readings, (n,) [in]
    # Standard deviation of measured minus predicted in a sound fleet [in].
    row_noise: float = PLUNGER_NOISE_IN
    # Further columns of the table, (n,) each.
    columns: dict[str, list[str]] = field(default_factory=dict)
    # Rows whose worst joint was restored between the two readings, (n,).
    repaired: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    def size(self, mild: float, strong: float) -> float:
        """The one of two sizes that the form asks for."""
        return strong if self.strong else mild

    def usual(self, values: NDArray[Any]) -> Any:
        """The identity with the most rows in the table."""
        names, counts = np.unique(values[self.seen].astype(str), return_counts=True)
        return names[np.argmax(counts)]

    def to_strength(self, shape: Array, strength: float) -> Array:
        """A shape scaled to a strength in the rows of the table."""
        rms = float(np.sqrt(np.mean(shape[self.seen] ** 2)))
        return np.asarray(shape * strength * self.row_noise / np.sqrt(self.seen.sum()) / rms)


Hidden = tuple[tuple[str, str | None], ...]
Act = Callable[[Scene, State], Hidden]
Write = Callable[[Scene, Rows], Rows]


@dataclass(frozen=True, slots=True)
class Blemish:
    """What is wrong with a table."""

    name: str  # Name of the case
    # Words for it in the condition of the data, any of them right; empty: none is due.
    kinds: tuple[str, ...] = ()
    # Changes the gears or the readings; returns the listed causes that this makes true.
    act: Act | None = None
    write: Write | None = None  # Changes the sheet
    near: tuple[str, ...] = ()  # Names of causes that are partly true
    interval: float = OVERHAUL  # Landings between two overhauls, strong form


@dataclass(frozen=True, slots=True)
class Truth:
    """What is true of a table, and nobody who reads it knows."""

    case: str
    form: str
    kinds: tuple[str, ...]  # Words for it, any of them right
    causes: Hidden  # Listed causes with their targets
    near: tuple[str, ...]  # Names of causes that are partly true
    # Further rows of the same tails: clearances properly read, the plunger without noise.
    unseen: Rows
    seed: int
    # Records whose worst joint was restored after its reading and before that of the plunger.
    repaired: tuple[str, ...] = ()


def draw_history(
    rng: np.random.Generator, rows: int, tails: int, interval: float = OVERHAUL
) -> tuple[Design, NDArray[np.intp], NDArray[np.intp]]:
    """Draw visits of a fleet over three years."""
    first = datetime.date(2021, 1, 1).toordinal() + int(rng.integers(0, 700))
    numbers = np.sort(rng.choice(np.arange(100, 999), tails, replace=False))
    names = np.array([f"N{number}" for number in numbers], dtype=object)
    home = rng.integers(0, 3, tails)
    per_day = rng.uniform(1.0, 3.0, tails)
    age = rng.uniform(0.0, OVERHAUL, tails)

    visits = rows // 2
    slots = rng.choice(tails * 1000, visits, replace=False)
    slots = slots[np.argsort(slots % 1000, kind="stable")]
    aircraft, day = np.repeat(slots // 1000, 2), np.repeat(first + slots % 1000, 2)
    base = np.where(rng.random(visits) < 0.8, home[slots // 1000], rng.integers(0, 3, visits))
    gauge = np.where(rng.random(visits) < 0.85, 2 * base + rng.integers(0, 2, visits), 6)
    technician = 2 * base + rng.integers(0, 2, visits)
    base = np.repeat(base, 2)

    flown = age[aircraft] + per_day[aircraft] * (day - first)
    bushings = (flown // interval).astype(np.intp)
    landings = np.rint(flown % interval)
    left = rng.random(visits) < 0.5
    is_left = np.column_stack([left, ~left]).ravel()
    clearance, floats = _worn(rng, 2 * aircraft + is_left, bushings, landings)

    season = -np.cos(2.0 * np.pi * (day - 15.0) / 365.25)
    local = np.repeat(rng.normal(0.0, 6.0, visits), 2)
    temperature = rng.uniform(-2.0, 22.0, 3)[base] + 12.0 * season + local
    design = Design(
        tail=names[aircraft],
        side=np.where(is_left, "LH", "RH").astype(object),
        gauge=np.array([f"G-{number + 1:02d}" for number in np.repeat(gauge, 2)], dtype=object),
        technician=np.array(
            [f"T-{number + 1:02d}" for number in np.repeat(technician, 2)], dtype=object
        ),
        approach=np.where(rng.random(rows) < 0.5, "EXTENDING", "RETRACTING").astype(object),
        day=day.astype(float),
        landings=landings,
        temperature=np.clip(temperature, -30.0, 45.0),
        pressure=rng.uniform(2600.0, 3100.0, rows),
        clearance=clearance,
        floats=floats,
        margin=np.full(rows, 0.03),
    )
    return design, base, bushings


def _worn(
    rng: np.random.Generator, gear: NDArray[np.intp], bushings: NDArray[np.intp], landings: Array
) -> tuple[Array, Array]:
    """Clearances and end floats: a level and a rate of each joint for each set of bushings."""
    level = np.zeros((len(gear), 10))
    rate = np.zeros((len(gear), 10))
    typical = rng.uniform(0.0005, 0.0012, 10)
    for one in sorted(set(zip(gear.tolist(), bushings.tolist(), strict=True))):
        rows = (gear == one[0]) & (bushings == one[1])
        level[rows] = rng.uniform(0.0003, 0.0012, 10)
        rate[rows] = typical * rng.lognormal(0.0, 0.4, 10)
    clearance = np.minimum(level + rate * landings[:, None] / 1000.0, 0.0145)
    return clearance, 0.003 + 4.0 * clearance


def _grid(values: Array, step: float) -> Array:
    return np.round(np.rint(values / step) * step, 6)


# What changes the gears or the reading


def _creep(scene: Scene) -> Array:
    """Saw-tooth of every gauge within its calibration year, (n,) [-]."""
    names = sorted(set(scene.design.gauge))
    start = dict(zip(names, scene.rng.uniform(0.0, _YEAR, len(names)), strict=True))
    since = scene.design.day - np.array([start[name] for name in scene.design.gauge])
    return np.asarray((since % _YEAR) / _YEAR)


def _drift_all(scene: Scene, state: State) -> Hidden:
    state.offset += scene.size(0.0015, 0.006) * _creep(scene)
    return ()


def _drift_one(scene: Scene, state: State) -> Hidden:
    gauge = scene.usual(scene.design.gauge)
    shape = _creep(scene) * (scene.design.gauge == gauge)
    state.offset += scene.to_strength(shape, CREEP) if scene.strong else 0.002 * shape
    return ()


def _learn(scene: Scene, state: State) -> Hidden:
    person = scene.usual(scene.design.technician)
    own = scene.design.technician == person
    done = np.cumsum(own) / own.sum()
    shape = np.where(own, np.exp(-done / 0.25), 0.0)
    state.offset += scene.to_strength(shape, CREEP) if scene.strong else 0.002 * shape
    return ()


def _hysteresis(scene: Scene, state: State) -> Hidden:
    state.offset += scene.size(0.0004, 0.004) * (scene.design.approach == "RETRACTING")
    return (("approach_hysteresis", None),)


def _hysteresis_of_one(scene: Scene, state: State) -> Hidden:
    person = scene.usual(scene.design.technician)
    own = scene.design.technician == person
    state.offset += scene.size(0.0008, 0.0048) * own * (scene.design.approach == "RETRACTING")
    return (("approach_hysteresis", f"technician {person}"),)


def _modified(scene: Scene) -> Mask:
    """Rows after the modification of half of the tails, each at its own date."""
    design = scene.design
    tails = np.unique(design.tail[scene.seen].astype(str))
    chosen = np.sort(scene.rng.choice(tails, len(tails) // 2, replace=False))
    after = np.zeros(design.rows, dtype=bool)
    for tail in chosen:
        own = design.tail == tail
        after |= own & (design.day >= np.quantile(design.day[own], scene.rng.uniform(0.3, 0.7)))
    return after


def _modification(scene: Scene, state: State) -> Hidden:
    state.offset += scene.size(0.0008, 0.004) * _modified(scene)
    return ()


def _modification_column(scene: Scene, state: State) -> Hidden:
    after = _modified(scene)
    state.offset += scene.size(0.0008, 0.004) * after
    scene.columns["mod_status"] = np.where(after, "POST", "PRE").tolist()
    return (("modification", "mod_status POST"),)


def _season(scene: Scene, state: State) -> Hidden:
    wave = np.sin(2.0 * np.pi * (scene.design.day - 105.0) / 365.25)
    state.offset += scene.size(0.0004, 0.006) * wave
    return ()


def _heavy(scene: Scene, state: State) -> Hidden:
    freedom = scene.size(6.0, 3.0)
    errors = scene.rng.standard_t(freedom, scene.design.rows) / np.sqrt(freedom / (freedom - 2.0))
    scene.noise[:] = PLUNGER_NOISE_IN * errors
    return ()


def _grow(scene: Scene, state: State) -> Hidden:
    total = scene.design.clearance.sum(axis=1)
    scene.noise *= 1.0 + scene.size(0.3, 1.5) * (total / total.mean() - 1.0).clip(-0.6)
    return ()


def _walk(scene: Scene, state: State) -> Hidden:
    months = 40
    for tail in sorted(set(scene.design.tail)):
        own = scene.design.tail == tail
        path = np.cumsum(scene.rng.normal(0.0, scene.size(0.0001, 0.0006), months))
        month = (scene.design.day[own] - scene.design.day.min()) // 30
        state.offset[own] += path[month.astype(int)]
    return ()


def _read_as_diameters(scene: Scene, state: State) -> Hidden:
    """What `_diametral` makes true of the sheet."""
    return (("convention_slip", f"gauge {scene.usual(scene.design.gauge)}"),)


def _repair(scene: Scene, state: State) -> Hidden:
    scene.repaired = scene.seen & (scene.rng.random(scene.seen.size) < scene.size(0.04, 0.16))
    rows = np.flatnonzero(scene.repaired)
    state.clearance[rows, scene.design.clearance[rows].argmax(axis=1)] = 0.0008
    return ()


def _worn_repair(scene: Scene, state: State) -> Hidden:
    """Gears come in with a joint over its limit: it is read, restored, and only then is the plunger
    read.
    """
    scene.repaired = scene.seen & (scene.rng.random(scene.seen.size) < scene.size(0.04, 0.16))
    rows = np.flatnonzero(scene.repaired)
    joint = scene.design.clearance[rows].argmax(axis=1)
    scene.design.clearance[rows, joint] = scene.rng.uniform(0.0075, 0.012, len(rows))
    state.clearance[rows, joint] = 0.0008
    return ()


def _zero_by_base(scene: Scene, state: State) -> Hidden:
    zero = scene.size(0.0005, 0.003) * scene.rng.permutation([-1.0, 0.0, 1.0])
    state.offset += zero[scene.base]
    scene.columns["base"] = [f"B{number + 1}" for number in scene.base]
    return tuple(("modification", f"base B{number + 1}") for number in np.flatnonzero(zero))


def _cold_first(scene: Scene, state: State) -> Hidden:
    place = scene.design.day * 3 + scene.base
    first = np.zeros(scene.design.rows, dtype=bool)
    first[np.unique(place, return_index=True)[1]] = True
    state.offset -= scene.size(0.0005, 0.003) * first
    return ()


def _shared_id(scene: Scene, state: State) -> Hidden:
    own = scene.design.technician == scene.usual(scene.design.technician)
    second = np.repeat(scene.rng.random(scene.design.rows // 2) < 0.5, 2)
    state.offset += scene.size(0.001, 0.005) * (own & second)
    return ()


# What changes the sheet


def _share(scene: Scene, rows: Rows, share: float) -> list[int]:
    """Row numbers of a share of the sheet, one at least."""
    count = max(1, round(share * len(rows)))
    return sorted(scene.rng.choice(len(rows), count, replace=False).tolist())


def _rounded(*columns: str) -> Write:
    def write(scene: Scene, rows: Rows) -> Rows:
        step = scene.size(0.001, 0.005)
        for row in rows:
            for column in columns:
                row[column] = float(_grid(np.array(row[column]), step))
        return rows

    return write


def _low_cells(scene: Scene, rows: Rows, share: float, written: object) -> Rows:
    for row in rows:
        for column in CLEARANCES:
            if row[column] < _LOW_IN and scene.rng.random() < share:
                row[column] = written
    return rows


def _gonogo(scene: Scene, rows: Rows) -> Rows:
    return _low_cells(scene, rows, scene.size(0.05, 1.0), f"<{_LOW_IN}")


def _gonogo_number(scene: Scene, rows: Rows) -> Rows:
    return _low_cells(scene, rows, scene.size(0.3, 1.0), _LOW_IN)


def _only_worn(scene: Scene, rows: Rows) -> Rows:
    person = scene.usual(scene.design.technician)
    for row in rows:
        if scene.strong or row["technician_id"] == person:
            for column in CLEARANCES:
                row[column] = row[column] if row[column] >= 0.0025 else None
    return rows


def _until_over(scene: Scene, rows: Rows) -> Rows:
    for number in _share(scene, rows, scene.size(0.15, 1.0)):
        over = False
        for column in CLEARANCES:
            value = rows[number][column]
            if over:
                rows[number][column] = None
            over = over or value > _LIMIT_IN
    return rows


def _only_worn_of_one(scene: Scene, rows: Rows) -> Rows:
    least = scene.size(0.0025, _LIMIT_IN)
    person = scene.usual(scene.design.technician)
    for row in rows:
        if row["technician_id"] == person:
            for column in CLEARANCES:
                row[column] = row[column] if row[column] >= least else None
    return rows


def _until_over_of_one(scene: Scene, rows: Rows) -> Rows:
    """One technician stops at the first joint over its limit, or half as worn; blanks of the others
    are at random.
    """
    over_in = scene.size(_LIMIT_IN, 0.5 * _LIMIT_IN)
    person = scene.usual(scene.design.technician)
    for row in rows:
        over = False
        for column in CLEARANCES:
            value = row[column]
            own = row["technician_id"] == person
            if over if own else scene.rng.random() < 0.02:
                row[column] = None
            over = over or value > over_in
    return rows


def _selected(mild: float, strong: float) -> Write:
    def write(scene: Scene, rows: Rows) -> Rows:
        for row in rows:
            failed = row[PLUNGER] > row["margin_in"]
            if not failed and scene.rng.random() > scene.size(mild, strong):
                row[PLUNGER] = None
        return rows

    return write


def _copied(scene: Scene, rows: Rows) -> Rows:
    last: dict[tuple[str, str], dict[str, Any]] = {}
    for row in rows:
        gear = (row["tail_no"], row["side"])
        if gear in last and scene.rng.random() < scene.size(0.05, 0.4):
            row.update({column: last[gear][column] for column in CLEARANCES})
        last[gear] = row
    return rows


def _limits_written(scene: Scene, rows: Rows) -> Rows:
    person = scene.usual(scene.design.technician)
    for row in rows:
        if row["technician_id"] == person and scene.rng.random() < scene.size(0.1, 1.0):
            row.update(dict.fromkeys(CLEARANCES, 0.004))
    return rows


def _duplicated(scene: Scene, rows: Rows) -> Rows:
    twice = _share(scene, rows, scene.size(0.05, 0.25))
    new = [rows[k] | {"record_id": f"R{len(rows) + i + 1:04d}"} for i, k in enumerate(twice)]
    return rows + new


def _swapped(scene: Scene, rows: Rows) -> Rows:
    for number in _share(scene, rows, scene.size(0.01, 0.06)):
        one, two = scene.rng.choice(CLEARANCES, 2, replace=False).tolist()
        rows[number][one], rows[number][two] = rows[number][two], rows[number][one]
    return rows


def _pairs(rows: Rows) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """The two sides of every visit."""
    return [
        (one, two)
        for one, two in pairwise(rows)
        if (one["tail_no"], one["inspection_date"]) == (two["tail_no"], two["inspection_date"])
    ]


def _some_pairs(scene: Scene, rows: Rows, share: float) -> Rows:
    pairs = _pairs(rows)
    count = max(1, round(share * len(pairs)))
    return [r for k in scene.rng.choice(len(pairs), count, replace=False) for r in pairs[k]]


def _swapped_plunger(scene: Scene, rows: Rows) -> Rows:
    chosen = _some_pairs(scene, rows, scene.size(0.02, 0.12))
    for one, two in zip(chosen[::2], chosen[1::2], strict=True):
        one[PLUNGER], two[PLUNGER] = two[PLUNGER], one[PLUNGER]
    return rows


def _landings_typed(scene: Scene, rows: Rows) -> Rows:
    later = [k for k, row in enumerate(rows) if row["gear_landings"] >= 1000]
    count = min(len(later), 1 if not scene.strong else max(2, round(0.03 * len(rows))))
    for number in scene.rng.choice(later, count, replace=False):
        rows[number]["gear_landings"] //= 10
    return rows


def _millimetres(scene: Scene, rows: Rows) -> Rows:
    base = scene.usual(scene.base)
    here = scene.base[scene.seen].astype(str) == base
    for row, own in zip(rows, here, strict=True):
        if own and scene.rng.random() < scene.size(0.03, 1.0):
            row.update({column: round(row[column] * 25.4, 4) for column in CLEARANCES})
    return rows


def _year_off(scene: Scene, rows: Rows) -> Rows:
    for row in _some_pairs(scene, rows, scene.size(0.01, 0.08)):
        day = datetime.date.fromisoformat(row["inspection_date"])
        row["inspection_date"] = (day - datetime.timedelta(days=365)).isoformat()
    return rows


def _diametral(scene: Scene, rows: Rows) -> Rows:
    gauge = scene.usual(scene.design.gauge)
    own = [row for row in rows if row["gauge_id"] == gauge]
    start = datetime.date.fromisoformat(own[len(own) // 3]["inspection_date"])
    end = (start + datetime.timedelta(days=scene.size(30.0, 300.0))).isoformat()
    for row in own:
        if start.isoformat() <= row["inspection_date"] < end:
            row.update({column: round(2.0 * row[column], 4) for column in CLEARANCES})
    return rows


def _chopped(scene: Scene, rows: Rows) -> Rows:
    person = scene.usual(scene.design.technician)
    for row in rows:
        if scene.strong or row["technician_id"] == person:
            row.update({column: int(row[column] * 1000.0 + 1e-6) / 1000.0 for column in CLEARANCES})
    return rows


def _sides_reversed(scene: Scene, rows: Rows) -> Rows:
    for row in _some_pairs(scene, rows, scene.size(0.02, 0.3)):
        row["side"] = "RH" if row["side"] == "LH" else "LH"
    return rows


def _clamped(scene: Scene, rows: Rows) -> Rows:
    end = scene.size(0.005, 0.003)
    for row in rows:
        row.update({column: min(row[column], end) for column in CLEARANCES})
    return rows


def _renumbered(scene: Scene, rows: Rows) -> Rows:
    tails = sorted({row["tail_no"] for row in rows})
    count = 1 if not scene.strong else len(tails) // 3
    middle = rows[len(rows) // 2]["inspection_date"]
    for old in scene.rng.choice(tails, count, replace=False).tolist():
        for row in rows:
            if row["tail_no"] == old and row["inspection_date"] >= middle:
                row["tail_no"] = f"{old}A"
    return rows


_BLANK = ("blank_not_at_random",)

#: The blemishes of the review.
LISTED = (
    *(Blemish("sound"), Blemish("round", ("rounded",), write=_rounded(*CLEARANCES, PLUNGER))),
    Blemish("round_clear", ("rounded",), write=_rounded(*CLEARANCES)),
    Blemish("round_plunger", ("rounded",), write=_rounded(PLUNGER)),
    Blemish("gonogo", ("censored",), write=_gonogo),
    Blemish("gonogo_num", ("censored", "limit_written"), write=_gonogo_number),
    *(Blemish("mnar", _BLANK, write=_only_worn), Blemish("stop", _BLANK, write=_until_over)),
    Blemish("sel_failed", ("selected",), write=_selected(0.6, 0.25)),
    Blemish("sel_fail_only", ("selected",), write=_selected(0.25, 0.0)),
    Blemish("copy", ("copied",), write=_copied),
    Blemish("limits", ("limit_written", "identical_cells"), write=_limits_written),
    Blemish("dup", ("duplicate",), write=_duplicated),
    Blemish("overhaul", ("landings_fall",), interval=900.0),
    Blemish("drift_all", act=_drift_all),
    Blemish("drift_one", act=_drift_one, near=("gauge_bias",)),
    *(Blemish("learn", act=_learn, near=("technician_bias",)), Blemish("hyst", act=_hysteresis)),
    Blemish("hyst_tech", act=_hysteresis_of_one, near=("technician_bias",)),
    Blemish("modification", act=_modification),
    Blemish("modification_col", act=_modification_column),
    *(Blemish("season", act=_season, near=("thermal_growth",)), Blemish("heavy", act=_heavy)),
    *(Blemish("grow", act=_grow), Blemish("walk", act=_walk), Blemish("repair", act=_repair)),
    *(Blemish("swap", write=_swapped), Blemish("swap_plunger", write=_swapped_plunger)),
    Blemish("landings_typed", ("landings_fall",), write=_landings_typed),
)
#: Ten more, listed before anything else was looked at.
FURTHER = (
    Blemish("unit_mixed", write=_millimetres, near=("convention_slip",)),
    Blemish("year_off", write=_year_off),
    Blemish("diametral_month", act=_read_as_diameters, write=_diametral),
    Blemish("chopped", ("rounded",), write=_chopped),
    Blemish("sides_reversed", write=_sides_reversed),
    Blemish("zero_by_base", act=_zero_by_base),
    Blemish("clamp", ("censored", "limit_written"), write=_clamped),
    Blemish("cold_first", act=_cold_first),
    Blemish("shared_id", act=_shared_id, near=("technician_bias",)),
    Blemish("renumbered", write=_renumbered),
)
#: One that acts more strongly than its like in the review, and habits of one technician.
ADDED = (
    Blemish("worn_repair", act=_worn_repair),
    Blemish("mnar_one", _BLANK, write=_only_worn_of_one),
    Blemish("stop_one", _BLANK, write=_until_over_of_one),
)
BLEMISHES = {blemish.name: blemish for blemish in (*LISTED, *FURTHER, *ADDED)}


def blemished_fleet(
    case: str, form: str, seed: int, *, beside: str | None = None, rows: int | None = None
) -> tuple[Rows, Truth]:
    """Draw a fleet with one blemish."""
    if form not in FORMS:
        raise ValueError(f"Unknown form {form!r}: expected one of {', '.join(FORMS)}.")
    blemish = BLEMISHES[case]
    rng = np.random.default_rng([seed, 1])
    count = (
        rows
        if rows is not None
        else 2 * round(float(np.exp(rng.uniform(np.log(30.0), np.log(200.0)))))
    )
    tails = int(rng.integers(10, min(40, max(11, count // 5)) + 1))
    total = count + UNSEEN
    interval = blemish.interval if form == "strong" else OVERHAUL
    design, base, bushings = draw_history(rng, total, tails, interval)
    seen = np.repeat(rng.permutation(total // 2) < count // 2, 2)
    scatter = rng.normal(size=(total, 10)) * physics.scatter_size(design)[:, None]
    noise = PLUNGER_NOISE_IN * rng.normal(size=total)
    errors = READING_IN * rng.normal(size=(total, 10))

    geometry = linkage.load()
    gears = Gears(geometry, design, scatter)
    written = _grid(np.maximum(design.clearance + errors, 0.0), STEP_IN)
    misfit = gears.read(gears.sound()) + noise - physics.worst_case(geometry, written)
    scene = Scene(
        np.random.default_rng([seed, 2]),
        form == "strong",
        design,
        base,
        bushings,
        seen,
        noise,
        float(np.sqrt(np.mean(misfit**2))),
    )
    state = gears.sound()
    scene.repaired = np.zeros(total, dtype=bool)
    hidden: Hidden = blemish.act(scene, state) if blemish.act is not None else ()
    if beside is not None:
        hidden += (_hide(beside, scene, state, scatter, geometry),)
    written = _grid(np.maximum(design.clearance + state.recorded + errors, 0.0), STEP_IN)
    clean = gears.read(state)
    table = _sheet(scene, written, _grid(clean + scene.noise, STEP_IN), seen)
    if beside is not None and set(find(beside).columns) & set(FLOATS):
        for row, floats in zip(table, _grid(design.floats[seen], STEP_IN).tolist(), strict=True):
            row.update(zip(FLOATS, floats, strict=True))
    proper = _grid(np.maximum(design.clearance + errors, 0.0), STEP_IN)
    unseen = _sheet(scene, proper, clean, ~seen)
    if blemish.write is not None:
        table = blemish.write(scene, table)
    repaired = tuple(f"R{k + 1:04d}" for k in np.flatnonzero(scene.repaired[seen]).tolist())
    return table, Truth(case, form, blemish.kinds, hidden, blemish.near, unseen, seed, repaired)


def _hide(
    cause: str, scene: Scene, state: State, scatter: Array, geometry: linkage.Geometry
) -> tuple[str, str | None]:
    """Hide a listed cause, sized in the rows of the table."""
    index = np.flatnonzero(scene.seen)
    effects = _Effects(Gears(geometry, scene.design.take(index), scatter[index]))
    wanted = EffectSpec(cause, strength=BESIDE)
    draft = _draw_effect(scene.rng, effects, wanted, scene.row_noise, alias=None, taken=set())
    find(cause).apply(scene.design, state, draft)
    return cause, draft.target


def _sheet(scene: Scene, clearance: Array, plunger: Array, which: Mask) -> Rows:
    """Rows of the inspection table."""
    design = scene.design
    rows = []
    for number, k in enumerate(np.flatnonzero(which).tolist()):
        rows.append(
            {
                "record_id": f"R{number + 1:04d}",
                "tail_no": design.tail[k],
                "side": design.side[k],
                **dict(zip(CLEARANCES, clearance[k].tolist(), strict=True)),
                "clearance_convention": "RADIAL",
                "inspection_date": date_text(design.day[k]),
                "gear_landings": int(design.landings[k]),
                "temperature_c": round(float(design.temperature[k]), 1),
                "hydraulic_pressure_psi": round(float(design.pressure[k])),
                "approach": design.approach[k],
                "gauge_id": design.gauge[k],
                "technician_id": design.technician[k],
                "gauge_u_in": READING_IN,
                "plunger_gauge_u_in": PLUNGER_NOISE_IN,
                PLUNGER: round(float(plunger[k]), 6),
                "margin_in": float(design.margin[k]),
                **{name: column[k] for name, column in scene.columns.items()},
            }
        )
    return rows


def write_rows(rows: Rows, path: Path) -> None:
    """Write rows as CSV, blanks as empty cells."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
