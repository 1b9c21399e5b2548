"""Draw a fleet, hide effects in it, write its table, and keep the label.

Every part of the randomness has a stream of its own, so that the same seed gives the same fleet,
the same pins and the same errors whatever is hidden in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import causes, departures, linkage, physics, records
from .causes import Draft
from .fleet import Design, date_text, draw_design
from .physics import Gears

Array = NDArray[np.float64]

#: Kinds of nothing-wrong fleets.
NULLS = ("iid", "heavy_tails", "tail_scatter", "confounded", "growing_noise", "n500")
#: Kinds of fleets; ``mix`` draws one of the others.
KINDS = (
    *("null", "single", "double", "off_catalogue", "aliased", "missing_column", "confounded"),
    "triple",
)
_MIX = (0.22, 0.24, 0.12, 0.22, 0.05, 0.11, 0.04, 0.0)
_ALIAS_CAUSES = {
    "gauge_technician": ("gauge_bias", "technician_bias"),
    "tail_gauge": ("rigging_offset", "gauge_bias"),
    "date_gauge": ("date_step", "gauge_bias"),
    "side_technician": ("side_difference", "technician_bias"),
    "tail_technician": ("rigging_offset", "technician_bias"),
}
_STREAMS = {
    "design": 1,
    "effects": 2,
    "scatter": 3,
    "errors": 4,
    "blanks": 5,
    "faults": 6,
    "spec": 7,
    "more": 8,
    "unread": 9,
}
_TRIES = 60
_CLOSE_ENOUGH = 0.01


@dataclass(frozen=True, slots=True)
class EffectSpec:
    """One effect that is to be hidden."""

    cause: str  # Name in ``causes.CATALOGUE`` or ``causes.OFF_CATALOGUE``
    target: str | None = None  # Target in words, for example ``joint 4``; drawn if None
    # Requested S = effect rms / noise rms x sqrt(rows); if None the physical parameter stays as
    # drawn.
    strength: float | None = None
    # Physical parameters that are not to be drawn.
    parameters: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FleetSpec:
    """What kind of fleet is wanted."""

    kind: str = "null"  # Word that the label carries
    rows: int = 200  # Number of inspections
    effects: tuple[EffectSpec, ...] = ()
    # How gauges and technicians hang on the bases: ``bases``, ``iid`` or ``confounded``.
    arrangement: str = "bases"
    alias: str | None = None  # Two causes that the fleet cannot separate, one of ``fleet.ALIASES``
    hand_pump: bool = True  # Some readings are taken on the hand pump
    # Letter of the linkage, or two letters and the share of the second as in ``A-C:0.5``.
    geometry: str = "A"
    # Standard deviation of one plunger reading; drawn between 0.0015 and 0.0020 if None [in].
    reading_noise: float | None = None
    tail_share: float = 0.5  # Standard deviation between tails, as a share of the reading's
    clearance_noise: float = 0.0005  # Standard deviation of one clearance reading [in]
    heavy: bool = False  # Errors with heavy tails
    growing: bool = False  # Errors in proportion to the displacement
    repeats: int | None = None  # Plunger readings in each row, 1 to 3; two or three if None
    blank_share: float = 0.01  # Share of blank cells
    unread_share: float = 0.0  # Share of clearances that were not read, beyond that
    drop_columns: tuple[str, ...] = ()  # Columns that the table does not have
    faults: tuple[str, ...] = ()  # Kinds of slips, one row each


@dataclass(frozen=True, slots=True)
class Effect:
    """One hidden effect as it came out."""

    cause: str
    target: str | None
    knob: str  # Physical parameter that set the size
    parameters: dict[str, Any]  # All physical parameters, units in their names
    variables: tuple[str, ...]  # Columns in which the effect can be seen
    rms_in: float  # Root mean square of the effect over the rows [in]
    strength: float  # rms / noise rms x sqrt(rows)
    requested: float | None  # The strength that was asked for
    truth: Array  # The effect alone on every row, (n,) [in]


@dataclass(frozen=True, slots=True)
class Label:
    """What is hidden in a fleet. Nothing of it is in the table."""

    kind: str
    causes: tuple[tuple[str, str | None], ...]  # (cause, target) of every hidden effect
    effects: tuple[Effect, ...]  # The same with sizes and parameters
    # (cause, target) of the causes that touch exactly the same rows as the hidden one, itself
    # included.
    aliases: tuple[tuple[str, str | None], ...]
    complements: tuple[tuple[str, str | None], ...]  # Those that touch exactly the other rows
    effect_rms_in: float  # Root mean square of all effects together [in]
    effect_sd_in: float  # The same about its mean [in]
    # Root mean square of mean reading minus worst case at the recorded clearances with nothing
    # wrong [in].
    noise_rms_in: float
    noise_sd_in: float  # The same about its mean [in]
    repeatability_in: float  # True standard deviation of one reading about the mean of its row [in]
    strength: float  # S of all effects together
    variables: tuple[str, ...]  # Columns in which the effects can be seen
    removed_columns: tuple[str, ...]  # Columns that the table does not have
    faults: tuple[records.Fault, ...]
    # All effects together on every row, before rounding: what has to be added to a prediction from
    # the recorded clearances, (n,) [in].
    truth_term: Array
    # Mean reading minus worst case of every row with nothing wrong, NaN without readings, (n,)
    # [in].
    noise_term: Array
    seed: int

    def as_dict(self) -> dict[str, Any]:
        """The label as plain values, ready for JSON."""
        plain = asdict(self)
        plain["truth_term"] = self.truth_term.tolist()
        plain["noise_term"] = [None if np.isnan(v) else float(v) for v in self.noise_term]
        for effect in plain["effects"]:
            effect["truth"] = effect["truth"].tolist()
        return plain


@dataclass(frozen=True, slots=True)
class _World:
    """What is needed to inspect the same fleet again."""

    spec: FleetSpec
    design: Design
    geometry: linkage.Geometry
    drafts: tuple[tuple[str, Draft], ...]
    noise: records.Noise
    errors: records.Errors
    repeats: int


@dataclass(frozen=True, slots=True)
class Fleet:
    """An inspection table and what is hidden in it."""

    table: records.Table
    label: Label
    spec: FleetSpec
    _world: _World


def _stream(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng([seed, _STREAMS[name]])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


class _Effects:
    """The effect of causes on the readings and on the recorded clearances of one fleet."""

    def __init__(self, gears: Gears) -> None:
        self.gears = gears
        self.base = gears.read(gears.sound())
        self._rigid: Array | None = None

    def shift(self, drafts: Sequence[tuple[str, Draft]]) -> tuple[Array, Array, Array]:
        """Effect on reading minus prediction, on the reading alone, and on the recorded
        clearances.
        """
        state = self.gears.sound()
        for name, draft in drafts:
            departures.find(name).apply(self.gears.design, state, draft)
        only_reading = not state.recorded.any() and all(
            (name not in causes.CATALOGUE and draft.knob == "amplitude_in")
            or draft.knob == "reading_shift_in"
            for name, draft in drafts
        )
        reading = state.offset if only_reading else self.gears.read(state) - self.base
        total = reading
        if state.recorded.any():
            clearance = self.gears.design.clearance
            if self._rigid is None:
                self._rigid = physics.worst_case(self.gears.geometry, clearance)
            biased = np.maximum(clearance + state.recorded, 0.0)
            total = reading + self._rigid - physics.worst_case(self.gears.geometry, biased)
        return total, reading, state.recorded

    def sized(self, name: str, draft: Draft, target_rms: float) -> tuple[Draft, float]:
        """Set the physical parameter so that the effect has the wanted rms; also what it came
        to.
        """
        knob = causes.KNOBS[draft.knob]
        value, exponent = float(draft.parameters[draft.knob]), knob.exponent
        best = (draft, 0.0)
        known: list[tuple[float, float]] = []
        for _ in range(12):
            value = float(np.clip(value, knob.low, knob.high))
            trial = replace(draft, parameters=draft.parameters | {draft.knob: value})
            try:
                size = _rms(self.shift([(name, trial)])[0])
            except linkage.ClosureError:
                size = np.inf
            if abs(size - target_rms) < abs(best[1] - target_rms):
                best = (trial, size)
            if abs(size / target_rms - 1.0) < _CLOSE_ENOUGH:
                break
            if not np.isfinite(size) or size <= 0.0:
                value *= 0.5 ** np.sign(exponent) if size > 0.0 else 2.0 ** np.sign(exponent)
                continue
            if known and known[-1][0] != value and known[-1][1] != size:
                slope = np.log(size / known[-1][1]) / np.log(value / known[-1][0])
                exponent = knob.exponent * float(np.clip(slope / knob.exponent, 0.25, 3.0))
            known.append((value, size))
            if (value, size) in known[:-1]:
                break
            value *= float(np.clip((target_rms / size) ** (1.0 / exponent), 0.02, 50.0))
        return best


def _draw_effect(
    rng: np.random.Generator,
    effects: _Effects,
    spec: EffectSpec,
    noise_rms: float,
    *,
    alias: str | None,
    taken: set[tuple[str, str | None]],
) -> Draft:
    """Draw a target and parameters that reach the requested strength, or come nearest to it."""
    cause = departures.find(spec.cause)
    design = effects.gears.design
    best: tuple[Draft, float] | None = None
    for _ in range(_TRIES * (10 if spec.target is not None else 1)):
        draft = cause.draw(rng, design)
        if spec.target is not None and draft.target != spec.target:
            continue
        if (spec.cause, draft.target) in taken:
            continue
        if alias is not None:
            if draft.knob not in ("reading_shift_in", "rod_change_in"):
                continue
            if spec.cause == "rigging_offset":
                draft = replace(draft, parameters=draft.parameters | {"from_date": None})
        unknown = sorted(set(spec.parameters) - set(draft.parameters))
        if unknown:
            if any(name in causes.KNOBS for name in unknown):
                continue
            raise KeyError(f"{spec.cause} has no parameter {', '.join(unknown)}.")
        draft = replace(draft, parameters=draft.parameters | spec.parameters)
        if spec.strength is None:
            return draft
        target_rms = spec.strength * noise_rms / np.sqrt(design.rows)
        draft, size = effects.sized(spec.cause, draft, target_rms)
        miss = abs(size / target_rms - 1.0)
        if best is None or miss < best[1]:
            best = (draft, miss)
        if miss < 0.05:
            break
    if best is None:
        raise ValueError(f"No draw of {spec.cause} has the target {spec.target!r} in this fleet.")
    return best[0]


def _alias_target(spec: FleetSpec, design: Design, effect: EffectSpec) -> EffectSpec:
    """Aim an effect at the identities that the arrangement ties together."""
    first, second = design.alias_names
    targets = {
        "gauge_bias": f"gauge {second if spec.alias in ('tail_gauge', 'date_gauge') else first}",
        "technician_bias": f"technician {second}",
        "rigging_offset": f"tail {first}",
    }
    return replace(effect, target=targets.get(effect.cause))


def _touched(design: Design, cause: str, draft: Draft) -> NDArray[np.bool_] | None:
    if cause == "rigging_offset":
        return causes.rigged_rows(design, draft)
    if cause == "date_step":
        days = np.array([date_text(day) for day in design.day])
        return np.asarray(days >= draft.parameters["from_date"], dtype=bool)
    column = {"gauge_bias": design.gauge, "technician_bias": design.technician}.get(cause)
    if column is not None:
        return np.asarray(column == draft.where, dtype=bool)
    return np.asarray(design.side == "RH", dtype=bool) if cause == "side_difference" else None


def _same_rows(
    design: Design, drafts: Sequence[tuple[str, Draft]]
) -> tuple[list[tuple[str, str | None]], list[tuple[str, str | None]]]:
    """Causes that touch exactly the rows of the only hidden one, and those that touch exactly the
    others.
    """
    if len(drafts) != 1:
        return [], []
    name, draft = drafts[0]
    rows = _touched(design, name, draft)
    if rows is None:
        return [(name, draft.target)], []
    rivals: dict[tuple[str, str | None], NDArray[np.bool_]] = {}
    for cause, word, column in (
        ("gauge_bias", "gauge", design.gauge),
        ("technician_bias", "technician", design.technician),
        ("rigging_offset", "tail", design.tail),
    ):
        rivals |= {(cause, f"{word} {value}"): column == value for value in sorted(set(column))}
    rivals[("side_difference", None)] = design.side == "RH"
    if np.isfinite(design.alias_day):
        rivals[("date_step", None)] = design.day >= design.alias_day
    rivals[(name, draft.target)] = rows
    same = [key for key, value in rivals.items() if np.array_equal(value, rows)]
    other = [
        key for key, value in rivals.items() if np.array_equal(~np.asarray(value, dtype=bool), rows)
    ]
    return same, other


def simulate_fleet(spec: FleetSpec, seed: int) -> Fleet:
    """Simulate a fleet; the same seed and specification give the same one."""
    geometry = linkage.load(spec.geometry)
    design = draw_design(
        _stream(seed, "design"), spec.rows, spec.arrangement, spec.alias, spec.hand_pump
    )
    scatter = (
        _stream(seed, "scatter").normal(size=(spec.rows, 10))
        * physics.scatter_size(design)[:, None]
    )
    effects = _Effects(Gears(geometry, design, scatter))
    rng = _stream(seed, "errors")
    single = (
        spec.reading_noise if spec.reading_noise is not None else float(rng.uniform(0.0015, 0.0020))
    )
    repeats = spec.repeats if spec.repeats is not None else int(rng.integers(2, 4))
    set_up = 1.0 if spec.heavy else 0.35
    noise = records.Noise(
        reading=single * float(np.sqrt(1.0 - min(set_up, 0.35) ** 2)),
        set_up=single * set_up,
        tail=single * spec.tail_share,
        clearance=spec.clearance_noise,
        heavy=spec.heavy,
        growing=spec.growing,
    )
    errors = records.draw_errors(rng, design, noise, effects.base, repeats=repeats)
    whole = ("gauge_id", "technician_id", "inspection_date") if spec.alias is not None else ()
    blank = records.draw_blanks(_stream(seed, "blanks"), spec.rows, spec.blank_share, whole)
    if spec.unread_share:
        unread = _stream(seed, "unread").random((10, spec.rows)) < spec.unread_share
        blank |= {
            name: blank[name] | own for name, own in zip(records.CLEARANCES, unread, strict=True)
        }
    noise_term = _noise_term(effects, errors, blank)
    noise_rms = float(np.sqrt(np.nanmean(noise_term**2)))

    rng = _stream(seed, "effects")
    drafts: list[tuple[str, Draft]] = []
    for wanted in spec.effects:
        aimed = _alias_target(spec, design, wanted) if spec.alias is not None else wanted
        taken = {(name, draft.target) for name, draft in drafts}
        drafts.append(
            (
                wanted.cause,
                _draw_effect(rng, effects, aimed, noise_rms, alias=spec.alias, taken=taken),
            )
        )
    total, on_reading, on_record = effects.shift(drafts)

    clearance = records.recorded_clearances(design, errors, on_record)
    readings = records.recorded_readings(design, errors, effects.base + on_reading)
    table = records.write_table(design, noise, clearance, readings, errors, blank=blank)
    for column in spec.drop_columns:
        table.pop(column, None)
    gain = linkage.plunger_gradient(
        linkage.Build.nominal(geometry, 1), np.zeros((1, 10, 2)), geometry.start[None, :]
    )[0]
    weights = np.hypot(gain[:, 0], gain[:, 1])
    faults = records.add_faults(_stream(seed, "faults"), table, spec.faults, weights, noise_rms)

    world = _World(spec, design, geometry, tuple(drafts), noise, errors, repeats)
    requested = [wanted.strength for wanted in spec.effects]
    outcomes = _outcomes(effects, drafts, requested, noise_rms)
    same, other = _same_rows(design, drafts)
    scale = np.sqrt(spec.rows) / noise_rms
    label = Label(
        kind=spec.kind,
        causes=tuple((effect.cause, effect.target) for effect in outcomes),
        effects=outcomes,
        aliases=tuple(same),
        complements=tuple(other),
        effect_rms_in=_rms(total),
        effect_sd_in=float(np.std(total)),
        noise_rms_in=noise_rms,
        noise_sd_in=float(np.nanstd(noise_term)),
        repeatability_in=noise.reading,
        strength=_rms(total) * float(scale),
        variables=tuple(dict.fromkeys(v for effect in outcomes for v in effect.variables)),
        removed_columns=spec.drop_columns,
        faults=tuple(faults),
        truth_term=total,
        noise_term=noise_term,
        seed=seed,
    )
    return Fleet(table, label, spec, world)


def _noise_term(
    effects: _Effects, errors: records.Errors, blank: dict[str, NDArray[np.bool_]]
) -> Array:
    """Mean reading minus worst case at the recorded clearances with nothing wrong, (n,) [in]."""
    design = effects.gears.design
    clearance = records.recorded_clearances(design, errors)
    hidden = np.stack([blank[name] for name in records.CLEARANCES], axis=1)
    clearance = np.where(hidden, np.median(clearance, axis=0), clearance)
    readings = records.recorded_readings(design, errors, effects.base)
    absent = np.stack([blank[name] for name in records.DISPLACEMENTS[: readings.shape[1]]], axis=1)
    count = (~absent).sum(axis=1)
    mean: Array = np.where(absent, 0.0, readings).sum(axis=1) / np.maximum(count, 1)
    mean[count == 0] = np.nan
    return mean - physics.worst_case(effects.gears.geometry, clearance)


def _outcomes(
    effects: _Effects,
    drafts: Sequence[tuple[str, Draft]],
    requested: Sequence[float | None],
    noise_rms: float,
) -> tuple[Effect, ...]:
    outcomes = []
    for (name, draft), asked in zip(drafts, requested, strict=True):
        truth = effects.shift([(name, draft)])[0]
        size = _rms(truth)
        strength = size / noise_rms * float(np.sqrt(truth.size))
        outcomes.append(
            Effect(
                name,
                draft.target,
                draft.knob,
                draft.parameters,
                draft.variables,
                size,
                strength,
                asked,
                truth,
            )
        )
    return tuple(outcomes)


def draw_spec(
    seed: int,
    kind: str = "mix",
    *,
    strength: float | None = None,
    cause: str | None = None,
    target: str | None = None,
    null: str | None = None,
    rows: int | None = None,
    faults: bool = True,
    geometry: str = "A",
) -> FleetSpec:
    """Draw what is to be hidden: what is None, and the targets of further causes, is drawn."""
    rng = _stream(seed, "spec")
    if kind == "mix":
        kind = str(rng.choice(KINDS, p=_MIX))
    if kind not in KINDS:
        raise ValueError(f"Unknown kind {kind!r}: expected mix or one of {', '.join(KINDS)}.")
    count = int(rng.choice(4, p=(0.4, 0.3, 0.2, 0.1))) if faults else 0
    slips = tuple(str(word) for word in rng.choice(records.FAULT_KINDS, size=count, replace=False))
    spec = FleetSpec(
        kind=kind,
        rows=rows if rows is not None else 200,
        hand_pump=bool(rng.random() < 0.65),
        faults=slips,
        geometry=geometry,
    )
    size = strength if strength is not None else float(rng.choice([5.0, 7.0, 10.0, 15.0, 25.0]))
    if kind == "null":
        return _null_spec(spec, null if null is not None else str(rng.choice(NULLS)), rows)
    if kind == "off_catalogue":
        name = cause if cause is not None else str(rng.choice(list(causes.OFF_CATALOGUE)))
        return _with_pump(replace(spec, effects=(EffectSpec(name, target, size),)), name)
    if kind == "aliased":
        alias = str(rng.choice(list(_ALIAS_CAUSES)))
        if cause is not None:
            alias = str(rng.choice([key for key, names in _ALIAS_CAUSES.items() if cause in names]))
        name = cause if cause is not None else str(rng.choice(_ALIAS_CAUSES[alias]))
        return replace(spec, alias=alias, effects=(EffectSpec(name, None, size),))
    names = list(causes.CATALOGUE)
    if kind == "missing_column":
        names = [name for name in names if causes.CATALOGUE[name].columns]
    name = cause if cause is not None else str(rng.choice(names))
    spec = replace(spec, effects=(EffectSpec(name, target, size),))
    if kind == "missing_column":
        spec = replace(spec, drop_columns=causes.CATALOGUE[name].columns)
    if kind == "confounded":
        spec = replace(spec, arrangement="confounded")
    if kind in ("double", "triple"):
        second = str(rng.choice([other for other in names if other != name]))
        size = strength if strength is not None else float(rng.choice([10.0, 15.0, 25.0]))
        spec = replace(
            spec, effects=(EffectSpec(name, target, size), EffectSpec(second, None, size))
        )
    if kind == "triple":
        third = str(rng.choice([other for other in names if other not in (name, second)]))
        spec = replace(spec, effects=(*spec.effects, EffectSpec(third, None, size)))
    for effect in spec.effects:
        spec = _with_pump(spec, effect.cause)
    return spec


def _with_pump(spec: FleetSpec, cause: str) -> FleetSpec:
    """A cause that lives on the pressure needs a fleet in which the pressure differs."""
    needs = cause in (
        "elastic_compliance",
        "pressure_kink",
        "cold_oil_under_load",
        "lost_motion_under_load",
    )
    return replace(spec, hand_pump=True) if needs else spec


def _null_spec(spec: FleetSpec, null: str, rows: int | None) -> FleetSpec:
    changes: dict[str, dict[str, Any]] = {
        "iid": {"arrangement": "iid", "tail_share": 0.0},
        "heavy_tails": {"heavy": True},
        "tail_scatter": {"tail_share": 1.6},
        "confounded": {"arrangement": "confounded"},
        "growing_noise": {"growing": True, "reading_noise": 0.0028},
        "n500": {"rows": rows if rows is not None else 500},
    }
    if null not in changes:
        raise ValueError(f"Unknown null {null!r}: expected one of {', '.join(NULLS)}.")
    return replace(spec, kind=f"null:{null}", **changes[null])


def draw_fleet(
    seed: int,
    kind: str = "mix",
    *,
    strength: float | None = None,
    cause: str | None = None,
    target: str | None = None,
    null: str | None = None,
    rows: int | None = None,
    faults: bool = True,
    geometry: str = "A",
) -> Fleet:
    """Draw what is to be hidden and simulate the fleet."""
    spec = draw_spec(
        seed,
        kind,
        strength=strength,
        cause=cause,
        target=target,
        null=null,
        rows=rows,
        faults=faults,
        geometry=geometry,
    )
    return simulate_fleet(spec, seed)


_OVERRIDES = {
    "tail_no": "tail",
    "side": "side",
    "gauge_id": "gauge",
    "technician_id": "technician",
    "approach": "approach",
    "gear_landings": "landings",
    "temperature_c": "temperature",
    "hydraulic_pressure_psi": "pressure",
    "inspection_date": "day",
}


def follow_up(fleet: Fleet, readings: Sequence[dict[str, Any]], seed: int) -> Fleet:
    """Inspect the same fleet again, under chosen circumstances: one further row for each of the
    readings, of which what is not chosen comes from a row of the same tail and side. Old rows come
    first; noise and S are as before.
    """
    world, old = fleet._world, fleet._world.design
    rng = _stream(seed, "more")
    index = []
    for chosen in readings:
        fits = np.ones(old.rows, dtype=bool)
        for column in ("tail_no", "side"):
            if (
                column in chosen
                and (getattr(old, _OVERRIDES[column])[fits] == chosen[column]).any()
            ):
                fits &= getattr(old, _OVERRIDES[column]) == chosen[column]
        index.append(int(rng.choice(np.flatnonzero(fits))))
    design = old.take(np.array(index, dtype=np.intp))
    design.clearance[:] = np.minimum(
        design.clearance * rng.lognormal(0.0, 0.15, design.clearance.shape), 0.0145
    )
    for row, chosen in enumerate(readings):
        for column, value in chosen.items():
            if column in records.CLEARANCES:
                design.clearance[row, records.CLEARANCES.index(column)] = value
            elif column in records.FLOATS:
                design.floats[row, records.FLOATS.index(column)] = value
            else:
                getattr(design, _OVERRIDES[column])[row] = value
    scatter = rng.normal(size=(design.rows, 10)) * physics.scatter_size(design)[:, None]
    effects = _Effects(Gears(world.geometry, design, scatter))
    total, on_reading, on_record = effects.shift(world.drafts)
    errors = records.draw_errors(
        rng, design, world.noise, effects.base, repeats=world.repeats, tails=world.errors.tails
    )
    clearance = records.recorded_clearances(design, errors, on_record)
    displacement = records.recorded_readings(design, errors, effects.base + on_reading)
    blank = records.draw_blanks(rng, design.rows, 0.0)
    more = records.write_table(
        design, world.noise, clearance, displacement, errors, blank=blank, first_record=old.rows + 1
    )
    table = {column: [*values, *more[column]] for column, values in fleet.table.items()}
    truth = np.concatenate([fleet.label.truth_term, total])
    noise = np.concatenate([fleet.label.noise_term, _noise_term(effects, errors, blank)])
    label = replace(fleet.label, truth_term=truth, noise_term=noise)
    return replace(fleet, table=table, label=label)


def write_csv(fleet: Fleet, path: Path) -> None:
    """Write the table of a fleet, and nothing of its label."""
    records.write_csv(fleet.table, path)
