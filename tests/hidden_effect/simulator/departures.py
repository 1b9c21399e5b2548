"""What a real fleet departs in first: where loads rest the pins, how clearances are written down,
one group alone.

They stand beside the catalogue and not in it, so that the fleets of the catalogue's rows stay as
they are.
"""

from __future__ import annotations

import numpy as np

from .causes import CATALOGUE, OFF_CATALOGUE, Cause, Draft, off_list, pick
from .fleet import Design
from .physics import State

#: Standard deviations of the angles between where loads rest the pins and the worst directions; the
#: last one stands
#: for evenly all around [deg].
ALL_AROUND_DEG = 180.0
SPREADS_DEG = (40.0, 90.0, ALL_AROUND_DEG)
_JOINTS = tuple(f"clearance_{joint}_in" for joint in range(1, 11))
#: Rows of the group that a departure concerns, at the least [-].
_FEWEST = 8


def _draw_loads(rng: np.random.Generator, design: Design) -> Draft:
    spread = SPREADS_DEG[int(rng.integers(len(SPREADS_DEG)))]
    parameters = {
        "spread_deg": spread,
        "normal": rng.normal(size=10).tolist(),
        "turn": rng.uniform(-1.0, 1.0, 10).tolist(),
    }
    return Draft(None, None, "spread_deg", parameters, _JOINTS)


def _apply_loads(design: Design, state: State, draft: Draft) -> None:
    p = draft.parameters
    around = p["spread_deg"] >= ALL_AROUND_DEG
    state.turned += np.radians(
        180.0 * np.array(p["turn"]) if around else p["spread_deg"] * np.array(p["normal"])
    )


def _draw_convention(rng: np.random.Generator, design: Design) -> Draft:
    word, column = (
        ("technician", design.technician),
        ("gauge", design.gauge),
        ("tail", design.tail),
    )[int(rng.integers(3))]
    name = pick(rng, column, _FEWEST)
    factor = 2.0 if rng.random() < 0.5 else 0.5
    return Draft(
        f"{word} {name}", (word, name), "written_factor", {"written_factor": factor}, _JOINTS
    )


def _apply_convention(design: Design, state: State, draft: Draft) -> None:
    word, name = draft.where
    rows = getattr(design, word) == name
    state.recorded[rows] += (draft.parameters["written_factor"] - 1.0) * design.clearance[rows]


def _within(word: str, column: str, field: str) -> Cause:
    """A covariate that acts on the rows of one tail, gauge or technician alone."""
    return off_list(
        f"{field}_of_one_{word}",
        (column, {"pressure": "hydraulic_pressure_psi", "temperature": "temperature_c"}[field]),
        lambda rng, d: {
            "name": pick(rng, getattr(d, word), _FEWEST),
            "from": float(np.median(getattr(d, field))),
        },
        lambda d, p: (
            (getattr(d, word) == p["name"])
            * (getattr(d, field) - p["from"])
            / getattr(d, field).std()
        ),
    )


DEPARTURES: dict[str, Cause] = {
    cause.name: cause
    for cause in (
        Cause("load_directions", _draw_loads, _apply_loads),
        Cause("convention_slip", _draw_convention, _apply_convention),
        *(
            _within(word, column, field)
            for word, column in (
                ("tail", "tail_no"),
                ("gauge", "gauge_id"),
                ("technician", "technician_id"),
            )
            for field in ("pressure", "temperature")
        ),
    )
}


def find(name: str) -> Cause:
    """A cause of any list by name."""
    every = {**CATALOGUE, **OFF_CATALOGUE, **DEPARTURES}
    if name not in every:
        raise KeyError(f"No cause {name!r}; there are {', '.join(every)}.")
    return every[name]
