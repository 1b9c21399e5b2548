"""Which causes planned columns could distinguish, before anything is measured."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.decision.columns import (
    APPROACH,
    AXIAL_FLOAT,
    CLEARANCE,
    COLUMNS,
    DATE,
    GAUGE_ID,
    LANDINGS,
    PLUNGER_POSITION,
    PRESSURE,
    SIDE,
    TAIL_NO,
    TECHNICIAN_ID,
    TEMPERATURE,
)
from mlg_troubleshoot.diagnosis.causes import CATALOGUE, Candidate
from mlg_troubleshoot.diagnosis.causes.base import offered
from mlg_troubleshoot.diagnosis.causes.together import JointFactors
from mlg_troubleshoot.diagnosis.extension import MOST_IN
from mlg_troubleshoot.diagnosis.noise import TAIL_RATIOS
from mlg_troubleshoot.diagnosis.scene import build_scene, effect_columns
from mlg_troubleshoot.diagnosis.table import ALONG, DiagnosisTable
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.design import TESTABLE, project_out
from mlg_troubleshoot.records.headers import Joints, parse_canonical
from mlg_troubleshoot.units import LengthUnit

# The planned fleet: two years of twenty aircraft (assumed), and what one row scatters, tail by tail
# [in] (docs/explanation/diagnosis.md: a gauge that repeats to 1.5 thou, and what clearances and
# pins add).
TAILS = 20
VISITS = 5
ROW_IN = 0.0025
_BELIEFS = Beliefs()
_APART = _BELIEFS.apart_from()
# Columns in addition to clearances, cheapest first: written down anyway, read off, to be measured.
FURTHER = {
    column.variable: column
    for column in sorted(COLUMNS, key=lambda column: column.effort)
    if column.effort
}
# Of what is tried for all-joint effects, the middle one: directions spread by 45°, linkages half as
# far apart.
_MIDDLE = 1
_NAMES = {column: name for name, column in FURTHER.items()} | {PLUNGER_POSITION: ALONG}
Key = tuple[str, str | None]


@dataclass(frozen=True, slots=True)
class CausePlanned:
    """What the planned columns could say about one cause.

    Attributes
    ----------
    cause, target : str
        Name of the cause, and what it acts on; no target where it acts on nothing in particular.
    found_from_in : float or None
        Root mean square from which it is detected with 80 % power; None if it cannot be tested.
        [in]
    missing_column : str or None
        Column that a test of it would need.
    nearest : str or None
        The cause that is most like it.
    told_apart_from_in : float or None
        Root mean square from which it is distinguished from that with 80 % power; None if never.
        [in]
    further_column : str or None
        Cheapest column that halves that size, or makes it finite.
    separating_reading : str
        The reading that distinguishes them whatever the columns.
    """

    cause: str
    target: str | None
    found_from_in: float | None
    missing_column: str | None
    nearest: str | None
    told_apart_from_in: float | None
    further_column: str | None
    separating_reading: str


def separable(
    gear: str = DEFAULT_GEAR, columns: Sequence[str] | None = None
) -> tuple[CausePlanned, ...]:
    """Say which causes the planned columns can distinguish; without clearance columns all joints
    are read.
    """
    model = load_gear(gear)
    recorded, joints = _planned(columns, model)
    here = _Plan(model, recorded, joints)

    access = sorted((j.access.value, j.number) for j in model.joints if j.number not in joints)
    unread = {CLEARANCE.header(number, LengthUnit.INCH): number for _min, number in access}

    @cache
    def with_column(column: str) -> _Plan:
        if column in unread:
            return _Plan(model, recorded, joints | {unread[column]})
        return _Plan(model, recorded | {column}, joints)

    further = [name for name in FURTHER if name not in {*recorded, ALONG}]
    further += [*unread, *({ALONG} - recorded)]
    with threadpool_limits(1, "blas"):
        keys = [*(key for key in here.keys if key not in here.stand_ins), *here.blocks]
        judged = tuple(_judged(here, with_column, further, key) for key in keys)
    return judged + tuple(
        CausePlanned(c.name, None, None, FURTHER[column].name, None, None, None, c.separates)
        for c in CATALOGUE
        if (column := c.lacks(recorded))
    )


def _planned(columns: Sequence[str] | None, gear: Gear) -> tuple[set[str], set[int]]:
    if columns is None:
        return set(FURTHER), set(gear.joint_numbers)
    recorded: set[str] = set()
    joints: set[int] = set()
    known = Joints.of(gear)
    for name in columns:
        field = parse_canonical(name, known)
        if field is None:
            raise UsageError(
                f"{name} is not a column of an inspection table", "see docs/reference/columns.md"
            )
        if field.column in _NAMES:
            recorded.add(_NAMES[field.column])
        elif field.column is CLEARANCE and field.number in gear.joint_numbers:
            joints.add(int(field.number))
    return recorded, joints or set(gear.joint_numbers)


class _Plan:
    """Effects of all testable causes in a planned fleet, as far as bias, slope and tails leave
    them.
    """

    def __init__(self, gear: Gear, recorded: set[str], joints: set[int]) -> None:
        table = _fleet(gear, recorded, joints)
        scene, rows = build_scene(gear.model, table, gear.discrepancies)
        found = list(offered(CATALOGUE, scene, recorded))
        effects = effect_columns(scene, found)
        effects[:, [not _speaks_for_all(c, table) for c in found]] = 0.0
        tails = TAIL_RATIOS[1] * (table.tails[:, None] == np.unique(table.tails))
        tails = np.hstack([tails, rows.along_in / ROW_IN])
        covariance = np.eye(len(table)) + tails @ tails.T
        common = np.linalg.cholesky(covariance)
        # A slope of the prediction is a cause of its own; a shift of all rows is not.

        def whitened(x: Array) -> Array:
            return np.asarray(np.linalg.solve(common, x), float)

        white = whitened(effects)
        level = whitened(np.ones((len(table), 1)))
        left, seen = project_out(white, level)
        size = np.linalg.norm(left, axis=0)
        self.sign = np.array([c.cause.sign for c in found])
        direction = np.where(self.sign == 0, 1, self.sign)
        unit = np.where(seen, left / np.where(seen, size, 1.0), 0.0)
        self.unit = unit * direction
        # Root mean square of an effect over what of it can be seen.
        visible = np.where(seen, size, np.inf)
        self.hidden = np.linalg.norm(effects, axis=0) / visible
        self.candidates = found
        self.keys: dict[Key, list[int]] = {}
        for k in np.flatnonzero(seen):
            self.keys.setdefault(_key(found[k]), []).append(int(k))
        self.stand_ins = {_key(c) for c in found if c.stands_in}
        names = {name for name, _target in self.keys}
        often = _BELIEFS.expected / (len(names) + 1.0)
        self.found = _BELIEFS.seen_from(often / 2.0, len(table))
        self.row_in = ROW_IN / float(np.sqrt(len(table)))
        causes = [c for c in CATALOGUE if isinstance(c, JointFactors)]
        tried = {(c.name, None): c.blocks(scene, gear.ensemble_models[1:]) for c in causes}
        # Another linkage is known by an ensemble only.
        self.blocks: dict[Key, Array] = {}
        for key, blocks in tried.items() if all(tried.values()) else ():
            effects = blocks[_MIDDLE].effects_in
            size = float(np.sqrt(np.sum(effects**2) / len(table)))
            self.blocks[key] = project_out(whitened(effects), level)[0] / size

    def tests(self, key: Key) -> bool:
        return key in self.keys or key in self.blocks

    def separates(self, key: Key) -> str:
        """The reading that tells it from others whatever the columns."""
        if key in self.blocks:
            return next(c.separates for c in CATALOGUE if c.name == key[0])
        return self.candidates[self.keys[key][0]].separates

    def nearest(self, key: Key) -> tuple[str | None, float]:
        """The cause that looks most like one, and the size that distinguishes them; infinite if
        never. [in]
        """
        if key in self.blocks:
            rival = next(other for other in self.blocks if other != key)
            theirs = self.blocks[rival]
            lead = partial(_divergence, true=self.blocks[key], other=theirs)
            return rival[0], _size_of(lead, 0.5 * _APART**2)
        best = 0.0
        name = None
        for other, places in self.keys.items():
            if other != key:
                mine = self.keys[key]
                cosine = self.unit[:, mine].T @ self.unit[:, places]
                # Physics allows some causes one sign only: two that push apart are not rivals.
                one_way = (self.sign[mine][:, None] * self.sign[places]) != 0
                possible = np.where(one_way, np.maximum(cosine, 0.0), cosine)
                alike = float(np.max(possible**2))
                if alike > best:
                    best = alike
                    name = " ".join(part for part in other if part)
        apart = 1.0 - best
        if apart < TESTABLE**2:
            return name, float("inf")
        return name, _APART * self._row(key) / float(np.sqrt(apart))

    def found_from(self, key: Key) -> float:
        """Size from which a cause stands out. [in]"""
        if key in self.blocks:
            lead = partial(
                _divergence, true=self.blocks[key], other=np.zeros_like(self.blocks[key])
            )
            return _size_of(lead, 0.5 * self.found**2)
        return self.found * self._row(key)

    def _row(self, key: Key) -> float:
        hidden = self.hidden[self.keys[key]]
        return self.row_in * float(np.min(hidden))


def _divergence(size_in: float, true: Array, other: Array) -> float:
    """Log-likelihood by which all-joint effects of one kind lead those of another, of the size that
    fits best. [1]

    true, other, shape (n, k): independent effects of one kind, of root mean square 1 together,
    whitened.
    """
    basis = np.linalg.qr(np.hstack([true, other]))[0]
    one, two = (basis.T @ effects / ROW_IN for effects in (true, other))
    unit = np.eye(len(one))
    truth = unit + size_in**2 * one @ one.T
    _, log_truth = np.linalg.slogdet(truth)
    least = np.inf
    for size in size_in * np.geomspace(0.2, 5.0, 15):
        wrong = unit + size**2 * two @ two.T
        excess = np.trace(np.linalg.solve(wrong, truth)) - len(one)
        _, log_wrong = np.linalg.slogdet(wrong)
        divergence = 0.5 * float(excess + log_wrong - log_truth)
        least = min(least, divergence)
    return least


def _size_of(lead: Callable[[float], float], wanted: float) -> float:
    """Size from which a lead is as large as wanted; infinite if no plunger moves as far. [in]"""
    sizes = np.geomspace(1e-4, MOST_IN, 128).tolist()
    first = bisect_left(sizes, wanted, key=lead)
    return sizes[first] if first < len(sizes) else float("inf")


def _key(candidate: Candidate) -> Key:
    target = candidate.target or ""
    return candidate.cause.name, target if target.startswith("joint") else None


def _speaks_for_all(candidate: Candidate, table: DiagnosisTable) -> bool:
    """One aircraft, gauge or technician stands for all of them, and the middle of the time for
    every date.
    """
    target = candidate.target or ""
    first = {str(texts[0]) for texts in table.factors.values()}
    day = candidate.setting.get("day")
    middle = day is None or abs(float(day) - 365.0) < 40.0
    return middle and (
        not target or target.startswith("joint") or target.split(" ", 1)[-1] in first
    )


def _judged(
    here: _Plan, with_column: Callable[[str], _Plan], further: Sequence[str], key: Key
) -> CausePlanned:
    name, apart = here.nearest(key)
    split = None
    if apart > 2.0 * here.found_from(key):
        better = (
            c
            for c in further
            if with_column(c).tests(key) and with_column(c).nearest(key)[1] < 0.5 * apart
        )
        found = next(better, None)
        split = FURTHER[found].name if found in FURTHER else found
    distinguished = max(apart, here.found_from(key)) if np.isfinite(apart) else None
    return CausePlanned(
        *key, here.found_from(key), None, name, distinguished, split, here.separates(key)
    )


def _fleet(gear: Gear, recorded: set[str], joints: set[int]) -> DiagnosisTable:
    """Rows as a planned fleet would give them: wear along landings, seasons, hand pump or not,
    people at bases.
    """
    rng = np.random.default_rng(0)
    n = TAILS * 2 * VISITS
    tail = np.repeat(np.arange(TAILS), 2 * VISITS)
    gears = np.repeat(np.arange(2 * TAILS), VISITS)
    days = rng.uniform(0.0, 730.0, (2 * TAILS, VISITS))
    day = np.sort(days, axis=1).ravel()
    landings = rng.uniform(500.0, 6000.0, 2 * TAILS)[gears] + 2.5 * day
    limits = gear.limits_in
    wear = (
        rng.lognormal(0.0, 0.4, (2 * TAILS, len(limits)))[gears]
        * limits
        * landings[:, None]
        / 8000.0
    )
    clearance = np.abs(wear + DEFAULT_GAUGE_U_IN * rng.standard_normal(wear.shape))
    clearance[:, [joint not in joints for joint in gear.joint_numbers]] = np.nan
    quantities = {
        DATE.variable: day,
        LANDINGS.variable: landings,
        TEMPERATURE.variable: (
            12.0 - 14.0 * np.cos(2.0 * np.pi * day / 365.25) + 6.0 * rng.standard_normal(n)
        ),
        PRESSURE.variable: rng.choice([1500.0, 2200.0, 2900.0, 3000.0, 3050.0], n),
    }
    if ALONG in recorded:
        quantities[ALONG] = np.full(n, np.nan)

    def mostly_own(count: int) -> Places:
        """One of so many per row: the aircraft's own in seven of ten, else any."""
        return np.where(rng.random(n) < 0.7, tail % count, rng.integers(0, count, n))

    factors = {
        TAIL_NO.variable: np.array([f"T{k:02d}" for k in tail]),
        SIDE.variable: np.where(gears % 2 == 0, "LH", "RH"),
        APPROACH.variable: rng.choice(["EXTENDING", "RETRACTING"], n),
        GAUGE_ID.variable: mostly_own(4).astype(str),
        TECHNICIAN_ID.variable: np.array([f"W{k}" for k in mostly_own(5)]),
    }
    floats = rng.uniform(0.0, 0.02, clearance.shape) if AXIAL_FLOAT.variable in recorded else None
    planned = DiagnosisTable(
        clearance_in=clearance,
        readings_in=np.full((n, 1), np.nan),
        record_id=tuple(str(k) for k in range(n)),
        row=np.arange(n),
        margin_in=np.full(n, gear.margin.value),
        gauge_u_in=np.full(n, DEFAULT_GAUGE_U_IN),
        quantities={name: values for name, values in quantities.items() if name in recorded},
        factors={name: texts for name, texts in factors.items() if name in recorded},
        axial_float_in=floats,
    )
    if ALONG not in recorded:
        return planned
    # One reading along the stroke in addition to each at mid-position.
    both = planned.take(np.tile(np.arange(n), 2))
    along = np.linspace(0.0, gear.reference.stroke[1], n)
    stroke = np.r_[np.full(n, np.nan), rng.permutation(along)]
    return replace(both, quantities={**both.quantities, ALONG: stroke})
