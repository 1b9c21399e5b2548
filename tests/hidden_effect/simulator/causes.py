"""Physical causes: each changes the state of the gears before the linkage is closed, or the reading
after it.

Every cause has one physical parameter, the knob, that sets its size. The other parameters are
drawn. Nothing here knows how large the effect on the plunger will be: that is what the closed
linkage says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import physics
from .fleet import Design, date_text
from .physics import State

Array = NDArray[np.float64]
Parameters = dict[str, Any]

#: Joints that share a part, so that one may keep the other from taking up its clearance.
ADJACENT = ((1, 2), (2, 3), (3, 5), (4, 5), (5, 6), (6, 7), (7, 8), (7, 9), (9, 10))
#: Clearance at which the ovality is given [in].
REFERENCE_CLEARANCE_IN = 0.004
#: Rigid part to which each distance of ``linkage.LENGTHS`` belongs: crank, actuator, release lever,
#: locking
#: lever, short link, link 6-7, bellcrank, plunger link.
_PART = (0, 0, 1, 2, 3, 3, 4, 5, 6, 6, 7)
#: Piston area of the actuator [in2].
PISTON_AREA_IN2 = 1.1


@dataclass(frozen=True, slots=True)
class Draft:
    """A cause with its target and parameters."""

    target: str | None  # Target in words, as it is reported
    where: Any  # The same for the program: a joint's number, a pair, a name or None
    knob: str  # Name of the parameter that sets the size
    parameters: Parameters  # All parameters, units in their names
    variables: tuple[str, ...] = ()  # Columns of the table in which the effect can be seen


@dataclass(frozen=True, slots=True)
class Knob:
    """Range of a physical parameter."""

    exponent: float  # Power with which the effect grows, roughly
    low: float  # Smallest value it may be set to [unit of the parameter]
    high: float  # And the largest


@dataclass(frozen=True, slots=True)
class Cause:
    """One physical cause."""

    name: str
    # Draws target and parameters from a generator and a design.
    draw: Callable[[np.random.Generator, Design], Draft]
    apply: Callable[[Design, State, Draft], None]
    # Columns without which the cause cannot be tested (empty: none that can be missing).
    columns: tuple[str, ...] = ()


KNOBS = {
    "bearing_span_in": Knob(-2.0, 0.02, 200.0),
    "short_link_ea_lb": Knob(-1.0, 1e3, 1e12),
    "mismatch_factor": Knob(1.0, 1e-4, 1e3),
    "rest_angle_deg": Knob(2.0, 0.5, 180.0),
    "unloaded_share": Knob(1.0, 1e-3, 1.0),
    "ovality_in": Knob(1.0, 1e-6, 0.05),
    "wear_in_per_1000_landings": Knob(1.0, 1e-7, 0.2),
    "overrun_in_per_1000_landings": Knob(1.0, 1e-7, 0.2),
    "rod_change_in": Knob(1.0, 1e-7, 0.5),
    "reading_shift_in": Knob(1.0, 1e-7, 0.5),
    "stop_shift_in": Knob(1.0, 1e-7, 0.2),
    "clearance_bias_in": Knob(1.0, 1e-7, 0.02),
    "rate_error": Knob(1.0, 1e-6, 2.0),
    "lost_motion_in": Knob(1.0, 1e-7, 0.5),
    "blocked_share": Knob(1.0, 1e-3, 1.0),
    "common_room_in": Knob(-2.0, 1e-4, 0.03),
    "amplitude_in": Knob(1.0, 1e-7, 0.5),
}


def _sign(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def pick(rng: np.random.Generator, values: NDArray[np.object_], fewest: int = 1) -> str:
    """One identity among those with enough rows."""
    names, counts = np.unique(values.astype(str), return_counts=True)
    usable = names[counts >= fewest]
    return str(rng.choice(usable if usable.size else names))


def _draw_tilt(rng: np.random.Generator, design: Design) -> Draft:
    floats = tuple(f"axial_float_{joint}_in" for joint in (3, 4, 5, 6, 7, 9, 10))
    return Draft(
        None, None, "bearing_span_in", {"bearing_span_in": float(rng.uniform(1.0, 2.2))}, floats
    )


def _apply_tilt(design: Design, state: State, draft: Draft) -> None:
    slope = design.floats / draft.parameters["bearing_span_in"]
    state.tilt[:, 0] = np.arctan(np.hypot(slope[:, 2], slope[:, 4]))
    state.tilt[:, 1] = np.arctan(np.hypot(slope[:, 5], slope[:, 6]))
    state.tilt[:, 2] = np.arctan(np.hypot(slope[:, 8], slope[:, 9]))
    state.tilt[:, 3] = np.arctan(slope[:, 3])


def _draw_elastic(rng: np.random.Generator, design: Design) -> Draft:
    parameters = {
        "short_link_ea_lb": float(rng.uniform(2e6, 8e6)),
        "actuator_ea_ratio": float(rng.uniform(1.0, 3.0)),
        "actuator_load_sign": 1.0 if rng.random() < 0.3 else -1.0,
        "short_link_share": float(rng.uniform(0.3, 0.8)),
        "contact_exponent": float(rng.uniform(0.88, 1.0)),
        "contact_share": float(rng.uniform(0.0, 0.4)),
    }
    return Draft(None, None, "short_link_ea_lb", parameters, ("hydraulic_pressure_psi",))


def _apply_elastic(design: Design, state: State, draft: Draft) -> None:
    p = draft.parameters
    full = physics.CALIBRATION_PRESSURE_PSI
    bent = full * (np.maximum(design.pressure, 0.0) / full) ** p["contact_exponent"]
    pressure = (1.0 - p["contact_share"]) * design.pressure + p["contact_share"] * bent
    force = PISTON_AREA_IN2 * (pressure - full)
    ea = p["short_link_ea_lb"]
    state.actuator += p["actuator_load_sign"] * force * 12.7 / (ea * p["actuator_ea_ratio"])
    state.short_link += p["short_link_share"] * force * 3.68 / ea


def _draw_thermal(rng: np.random.Generator, design: Design) -> Draft:
    factor = float(rng.uniform(0.6, 1.4))
    parameters = {"mismatch_factor": factor, "part_spread": rng.normal(0.0, 0.05, 8).tolist()}
    return Draft(None, None, "mismatch_factor", parameters, ("temperature_c",))


def _apply_thermal(design: Design, state: State, draft: Draft) -> None:
    warmer = design.temperature - physics.RIGGING_TEMPERATURE_C
    mismatch = draft.parameters["mismatch_factor"] * (physics.ALUMINIUM_PER_C - physics.STEEL_PER_C)
    state.airframe += mismatch * warmer
    state.parts += (
        mismatch * warmer[:, None] * np.array(draft.parameters["part_spread"])[list(_PART)]
    )


def _joint_columns(*joints: int) -> tuple[str, ...]:
    return tuple(f"clearance_{joint}_in" for joint in joints)


def _draw_direction(rng: np.random.Generator, design: Design) -> Draft:
    joint = int(rng.integers(1, 11))
    if rng.random() < 0.7:
        knob, value = "rest_angle_deg", float(rng.uniform(60.0, 100.0))
    else:
        knob, value = "unloaded_share", float(rng.uniform(0.4, 1.0))
    parameters = {knob: value, "turn_sign": _sign(rng)}
    return Draft(f"joint {joint}", joint, knob, parameters, _joint_columns(joint))


def _apply_direction(design: Design, state: State, draft: Draft) -> None:
    column = draft.where - 1
    if draft.knob == "rest_angle_deg":
        state.turned[:, column] += draft.parameters["turn_sign"] * np.radians(
            draft.parameters[draft.knob]
        )
    else:
        state.clearance[:, column] *= 1.0 - draft.parameters[draft.knob]


def _draw_oval(rng: np.random.Generator, design: Design) -> Draft:
    joint = int(rng.integers(1, 11))
    extra, exponent = float(rng.uniform(0.0008, 0.003)), float(rng.uniform(0.85, 1.2))
    parameters = {"ovality_in": extra, "wear_exponent": exponent}
    return Draft(f"joint {joint}", joint, "ovality_in", parameters, _joint_columns(joint))


def _apply_oval(design: Design, state: State, draft: Draft) -> None:
    column = draft.where - 1
    worn = (design.clearance[:, column] / REFERENCE_CLEARANCE_IN) ** draft.parameters[
        "wear_exponent"
    ]
    state.oval[:, column] += draft.parameters["ovality_in"] * worn


def _draw_unlisted_wear(rng: np.random.Generator, design: Design) -> Draft:
    knob = "wear_in_per_1000_landings" if rng.random() < 0.6 else "overrun_in_per_1000_landings"
    parameters = {
        knob: float(rng.uniform(0.001, 0.004)),
        "wear_exponent": float(rng.uniform(0.85, 1.2)),
        "roller_radius_in": float(rng.uniform(2.5, 4.5)),
        "wear_sign": _sign(rng),
    }
    return Draft(None, None, knob, parameters, ("gear_landings",))


def _apply_unlisted_wear(design: Design, state: State, draft: Draft) -> None:
    p = draft.parameters
    depth = p["wear_sign"] * p[draft.knob] * (design.landings / 1000.0) ** p["wear_exponent"]
    if draft.knob == "wear_in_per_1000_landings":
        state.twist += depth / p["roller_radius_in"]
    else:
        state.stroke += depth


def _draw_rigging(rng: np.random.Generator, design: Design) -> Draft:
    tail = pick(rng, design.tail, 7)
    rows = np.flatnonzero(design.tail == tail)
    side = None
    if rng.random() < 0.35:
        side = pick(rng, design.side[rows], 3)
        rows = rows[design.side[rows] == side]
    days = np.unique(design.day[rows])
    start = None
    if rng.random() < 0.7 and days.size >= 3:
        start = date_text(days[int(rng.integers(1, max(2, days.size // 2 + 1)))])
    parameters = {
        "rod_change_in": float(rng.uniform(0.004, 0.02)),
        "sign": _sign(rng),
        "from_date": start,
    }
    target = f"tail {tail}" if side is None else f"tail {tail} {side}"
    return Draft(target, (tail, side), "rod_change_in", parameters, ("tail_no", "inspection_date"))


def _apply_rigging(design: Design, state: State, draft: Draft) -> None:
    state.rod[rigged_rows(design, draft)] += (
        draft.parameters["sign"] * draft.parameters["rod_change_in"]
    )


def rigged_rows(design: Design, draft: Draft) -> NDArray[np.bool_]:
    """Rows that a re-rigged rod touches."""
    tail, side = draft.where
    rows = design.tail == tail
    if side is not None:
        rows &= design.side == side
    if draft.parameters["from_date"] is not None:
        rows &= np.array([date_text(day) for day in design.day]) >= draft.parameters["from_date"]
    return np.asarray(rows, dtype=bool)


def _draw_date_step(rng: np.random.Generator, design: Design) -> Draft:
    day = design.alias_day
    if not np.isfinite(day):
        day = float(np.quantile(design.day, rng.uniform(0.25, 0.75)))
    knob = "reading_shift_in" if rng.random() < 0.6 else "stop_shift_in"
    parameters = {
        knob: float(rng.uniform(0.002, 0.006)),
        "sign": _sign(rng),
        "from_date": date_text(day),
    }
    return Draft(None, None, knob, parameters, ("inspection_date",))


def _shift(state: State, rows: NDArray[np.bool_] | Array, draft: Draft) -> None:
    """Shift the reading, or the actuator's position at which it is taken."""
    amount = draft.parameters["sign"] * draft.parameters[draft.knob]
    if draft.knob == "stop_shift_in":
        state.stroke += amount * rows
    else:
        state.offset += amount * rows


def _apply_date_step(design: Design, state: State, draft: Draft) -> None:
    dates = np.array([date_text(day) for day in design.day])
    _shift(state, dates >= draft.parameters["from_date"], draft)


def _draw_gauge(rng: np.random.Generator, design: Design) -> Draft:
    gauge = pick(rng, design.gauge, 8)
    knob = "reading_shift_in" if rng.random() < 0.75 else "clearance_bias_in"
    size = (0.002, 0.006) if knob == "reading_shift_in" else (0.0002, 0.0006)
    parameters = {knob: float(rng.uniform(*size)), "sign": _sign(rng)}
    return Draft(f"gauge {gauge}", gauge, knob, parameters, ("gauge_id",))


def _apply_gauge(design: Design, state: State, draft: Draft) -> None:
    rows = design.gauge == draft.where
    if draft.knob == "clearance_bias_in":
        state.recorded[rows] += draft.parameters["sign"] * draft.parameters[draft.knob]
    else:
        _shift(state, rows, draft)


def _draw_technician(rng: np.random.Generator, design: Design) -> Draft:
    person = pick(rng, design.technician, 8)
    knob = "reading_shift_in" if rng.random() < 0.7 else "stop_shift_in"
    parameters = {knob: float(rng.uniform(0.002, 0.006)), "sign": _sign(rng)}
    return Draft(f"technician {person}", person, knob, parameters, ("technician_id",))


def _apply_technician(design: Design, state: State, draft: Draft) -> None:
    _shift(state, design.technician == draft.where, draft)


def _draw_side(rng: np.random.Generator, design: Design) -> Draft:
    parameters = {"rod_change_in": float(rng.uniform(0.002, 0.008)), "sign": _sign(rng)}
    return Draft(None, None, "rod_change_in", parameters, ("side",))


def _apply_side(design: Design, state: State, draft: Draft) -> None:
    state.rod[design.side == "RH"] += draft.parameters["sign"] * draft.parameters["rod_change_in"]


def _draw_rate(rng: np.random.Generator, design: Design) -> Draft:
    parameters = {"rate_error": float(rng.uniform(0.03, 0.12)), "sign": _sign(rng)}
    return Draft(None, None, "rate_error", parameters, _joint_columns(*range(1, 11)))


def _apply_rate(design: Design, state: State, draft: Draft) -> None:
    state.rate_error += draft.parameters["sign"] * draft.parameters["rate_error"]


def _draw_hysteresis(rng: np.random.Generator, design: Design) -> Draft:
    centre = 0.0 if rng.random() < 0.6 else 0.5
    lost = float(rng.uniform(0.003, 0.008))
    parameters = {"lost_motion_in": lost, "sign": _sign(rng), "calibrated_at": centre}
    return Draft(None, None, "lost_motion_in", parameters, ("approach",))


def _apply_hysteresis(design: Design, state: State, draft: Draft) -> None:
    p = draft.parameters
    state.offset += (
        p["sign"] * p["lost_motion_in"] * ((design.approach == "RETRACTING") - p["calibrated_at"])
    )


def _draw_contact(rng: np.random.Generator, design: Design) -> Draft:
    pair = ADJACENT[int(rng.integers(len(ADJACENT)))]
    if rng.random() < 0.75:
        knob, value = "blocked_share", float(rng.uniform(0.6, 1.0))
    else:
        knob, value = "common_room_in", float(rng.uniform(0.003, 0.008))
    return Draft(f"joints {pair[0]},{pair[1]}", pair, knob, {knob: value}, _joint_columns(*pair))


def _apply_contact(design: Design, state: State, draft: Draft) -> None:
    columns = [joint - 1 for joint in draft.where]
    both = state.clearance[:, columns]
    if draft.knob == "blocked_share":
        smaller = both.argmin(axis=1)
        rows = np.arange(both.shape[0])
        both[rows, smaller] *= 1.0 - draft.parameters["blocked_share"]
    else:
        both *= np.minimum(1.0, draft.parameters["common_room_in"] / both.sum(axis=1))[:, None]
    state.clearance[:, columns] = both


_FLOATS = tuple(f"axial_float_{joint}_in" for joint in range(1, 11))

CATALOGUE: dict[str, Cause] = {
    cause.name: cause
    for cause in (
        Cause("out_of_plane_tilt", _draw_tilt, _apply_tilt, _FLOATS),
        Cause("elastic_compliance", _draw_elastic, _apply_elastic, ("hydraulic_pressure_psi",)),
        Cause("thermal_growth", _draw_thermal, _apply_thermal, ("temperature_c",)),
        Cause("direction_not_worst_case", _draw_direction, _apply_direction),
        Cause("oval_wear", _draw_oval, _apply_oval),
        Cause("unlisted_wear", _draw_unlisted_wear, _apply_unlisted_wear, ("gear_landings",)),
        Cause("rigging_offset", _draw_rigging, _apply_rigging),
        Cause("date_step", _draw_date_step, _apply_date_step, ("inspection_date",)),
        Cause("gauge_bias", _draw_gauge, _apply_gauge, ("gauge_id",)),
        Cause("technician_bias", _draw_technician, _apply_technician, ("technician_id",)),
        Cause("side_difference", _draw_side, _apply_side),
        Cause("calibration_rate", _draw_rate, _apply_rate),
        Cause("approach_hysteresis", _draw_hysteresis, _apply_hysteresis, ("approach",)),
        Cause("joint_contact", _draw_contact, _apply_contact),
    )
}


def off_list(
    name: str,
    variables: tuple[str, ...],
    draw: Callable[[np.random.Generator, Design], Parameters],
    shape: Callable[[Design, Parameters], Array],
) -> Cause:
    """A cause that is on nobody's list: a shape in the table's columns, in inches at the
    plunger.
    """

    def drawn(rng: np.random.Generator, design: Design) -> Draft:
        size = {"amplitude_in": float(rng.uniform(0.002, 0.006)), "sign": _sign(rng)}
        parameters = size | draw(rng, design)
        named = tuple(v.format(**parameters) for v in variables)
        return Draft(None, None, "amplitude_in", parameters, named)

    def applied(design: Design, state: State, draft: Draft) -> None:
        p = draft.parameters
        state.offset += p["sign"] * p["amplitude_in"] * shape(design, p)

    return Cause(name, drawn, applied)


def _season(design: Design, p: Parameters) -> Array:
    wave: Array = np.sin(2.0 * np.pi * (design.day - p["phase_days"]) / p["period_days"])
    return wave


def _kink(_: np.random.Generator, design: Design) -> Parameters:
    """The kink at which the bent line has least of a straight one in it."""
    kinks = np.quantile(design.pressure, np.linspace(0.1, 0.9, 33))
    straight = [
        abs(np.corrcoef(np.abs(design.pressure - kink), design.pressure)[0, 1]) for kink in kinks
    ]
    return {
        "kink_psi": float(kinks[int(np.argmin(straight))]),
        "width_psi": float(design.pressure.std()),
    }


def _far_pair(rng: np.random.Generator, design: Design) -> Parameters:
    pairs = ((1, 8), (2, 9), (3, 8), (4, 10), (3, 9), (1, 6))
    first, second = pairs[int(rng.integers(len(pairs)))]
    means = design.clearance.mean(axis=0)
    return {
        "first": first,
        "second": second,
        "first_mean_in": float(means[first - 1]),
        "second_mean_in": float(means[second - 1]),
    }


def _far_product(design: Design, p: Parameters) -> Array:
    one = design.clearance[:, p["first"] - 1] / p["first_mean_in"] - 1.0
    two = design.clearance[:, p["second"] - 1] / p["second_mean_in"] - 1.0
    product: Array = one * two
    return product


OFF_CATALOGUE: dict[str, Cause] = {
    cause.name: cause
    for cause in (
        off_list(
            "technician_in_the_cold",
            ("technician_id", "temperature_c"),
            lambda rng, d: {
                "technician": pick(rng, d.technician, 20),
                "from_c": float(np.median(d.temperature)),
            },
            lambda d, p: (d.technician == p["technician"]) * (d.temperature - p["from_c"]) / 12.0,
        ),
        off_list(
            "season",
            ("inspection_date",),
            lambda rng, _: {
                "phase_days": float(rng.uniform(0, 365)),
                "period_days": float(rng.uniform(120, 300)),
            },
            _season,
        ),
        off_list(
            "grease_drag",
            ("temperature_c",),
            lambda rng, d: {
                "middle_c": float(d.temperature.mean() + rng.normal(0.0, 1.0)),
                "width_c": float(d.temperature.std() * 1.4),
                "power": float(rng.choice([2.0, 4.0])),
            },
            lambda d, p: np.abs((d.temperature - p["middle_c"]) / p["width_c"]) ** p["power"],
        ),
        off_list(
            "wear_of_one_side",
            ("gear_landings", "side"),
            lambda _, d: {"from_landings": float(np.median(d.landings))},
            lambda d, p: (
                np.where(d.side == "RH", 1.0, -1.0) * (d.landings - p["from_landings"]) / 1000.0
            ),
        ),
        off_list(
            "pressure_kink",
            ("hydraulic_pressure_psi",),
            _kink,
            lambda d, p: np.abs(d.pressure - p["kink_psi"]) / p["width_psi"],
        ),
        off_list(
            "cold_oil_under_load",
            ("temperature_c", "hydraulic_pressure_psi"),
            lambda _, d: {
                "middle_c": float(d.temperature.mean()),
                "middle_psi": float(d.pressure.mean()),
                "width_psi": float(d.pressure.std()),
            },
            lambda d, p: (
                (d.temperature - p["middle_c"])
                / 12.0
                * (d.pressure - p["middle_psi"])
                / p["width_psi"]
            ),
        ),
        off_list(
            "lost_motion_under_load",
            ("approach", "hydraulic_pressure_psi"),
            lambda _, d: {
                "middle_psi": float(d.pressure.mean()),
                "width_psi": float(d.pressure.std()),
            },
            lambda d, p: (
                np.where(d.approach == "RETRACTING", 1.0, -1.0)
                * (d.pressure - p["middle_psi"])
                / p["width_psi"]
            ),
        ),
        off_list(
            "distant_joints_together",
            ("clearance_{first}_in", "clearance_{second}_in"),
            _far_pair,
            _far_product,
        ),
        off_list(
            "bellcrank_end_float",
            ("axial_float_{joint}_in",),
            lambda rng, _: {"joint": int(rng.choice([1, 2, 8]))},
            lambda d, p: (d.floats[:, p["joint"] - 1] - 0.02) / 0.015,
        ),
        off_list(
            "gauge_drift",
            ("gauge_id", "inspection_date"),
            lambda rng, d: {"gauge": pick(rng, d.gauge, 20), "middle_day": float(d.day.mean())},
            lambda d, p: (d.gauge == p["gauge"]) * (d.day - p["middle_day"]) / 200.0,
        ),
    )
}
