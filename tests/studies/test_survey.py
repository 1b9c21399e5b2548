"""A linkage from readings: what a survey finds, doubts and names."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from mlg_troubleshoot import SurveyResult, predict, survey
from mlg_troubleshoot.errors import MechanismError, UsageError
from mlg_troubleshoot.gear.assembly import DesignSpace
from mlg_troubleshoot.gear.gear import Gear, Linkage
from mlg_troubleshoot.surveying.survey import ReadingKind, SurveyedLinkage, SurveyReading

FOUR_BAR = Path(__file__).parents[1] / "geometry" / "data" / "four-bar.toml"
CRANK, COUPLER, ROCKER, GROUND, TURN, LATER = 2.1, 7.15, 9.1, 6.05, np.radians(12.0), 0.4


def four_bar_distances(
    lengths: Sequence[float], turn: float
) -> dict[tuple[str, str, float | None], float]:
    """Pin distances of a four-bar linkage by complex numbers: the ground lies at -turn from the
    crank.
    """
    crank, coupler, rocker, ground = lengths
    found: dict[tuple[str, str, float | None], float] = {}
    for extension in (None, LATER):
        a, o4 = crank * np.exp(1j * (extension or 0.0)), ground * np.exp(-1j * turn)
        apart = abs(o4 - a)
        along = (coupler**2 - rocker**2 + apart**2) / (2 * apart)
        b = a + (o4 - a) / apart * (along + 1j * np.sqrt(coupler**2 - along**2))
        for (p, one), (q, other) in (
            (("O2", 0), ("A", a)),
            (("A", a), ("B", b)),
            (("O4", o4), ("B", b)),
            (("O2", 0), ("O4", o4)),
            (("O4", o4), ("A", a)),
            (("O2", 0), ("B", b)),
        ):
            found[p, q, extension] = abs(one - other)
    return found


def index_of(numbers: Sequence[float] | np.ndarray) -> float:
    """The rocker's turn by the coupler's stretch, 30 degrees of crank on, where the stroke of the
    gear file ends.

    It is one over rocker length times the sine of the transmission angle.
    """
    crank, coupler, rocker, ground, turn = numbers
    square = crank**2 + ground**2 - 2 * crank * ground * np.cos(turn + np.radians(30.0))
    cosine = (coupler**2 + rocker**2 - square) / (2 * coupler * rocker)
    return float(1.0 / (rocker * np.sqrt(1.0 - cosine**2)))


def table_of(places: Sequence[tuple[str, str, float | None]], u: float) -> pd.DataFrame:
    values = four_bar_distances((CRANK, COUPLER, ROCKER, GROUND), TURN)
    rows = [("DISTANCE", a, b, values[a, b, at], u, at) for a, b, at in places]
    return pd.DataFrame(rows, columns=["kind", "from", "to", "value_in", "u_in", "extension_in"])


LENGTHS = (
    ("O2", "A", None),
    ("A", "B", None),
    ("O4", "B", None),
    ("O2", "O4", None),
    ("O4", "A", None),
)
BRACED = (*LENGTHS, ("O2", "B", None), ("O4", "A", LATER))


@cache
def braced() -> SurveyResult:
    return survey(table_of(BRACED, 2e-3), FOUR_BAR)


def test_the_four_bar_has_the_amplification_that_its_measured_lengths_give_in_closed_form() -> None:
    found = braced()
    true = index_of((CRANK, COUPLER, ROCKER, GROUND, TURN))
    assert [joint.value for joint in found.joints] == pytest.approx([true] * 4, rel=1e-4)
    assert found.misfits == ()
    assert found.fits == 1
    assert np.abs(found.residuals).max() < 0.1


def test_the_interval_of_the_four_bar_is_the_closed_forms_propagated_uncertainty() -> None:
    numbers = np.array([CRANK, COUPLER, ROCKER, GROUND, TURN])

    def readings(x: np.ndarray) -> np.ndarray:
        values = four_bar_distances(x[:4], x[4])
        return np.array([values[place] for place in BRACED])

    steps = 1e-6 * np.eye(5)
    slopes = (
        np.array([(readings(numbers + h) - readings(numbers - h)) / 2e-6 for h in steps]).T / 2e-3
    )
    wanted = np.array([(index_of(numbers + h) - index_of(numbers - h)) / 2e-6 for h in steps])
    expected = float(np.sqrt(wanted @ np.linalg.inv(slopes.T @ slopes) @ wanted))
    joint = braced().joints[1]
    assert joint.high - joint.low == pytest.approx(2 * 1.96 * expected, rel=0.2)


@pytest.mark.slow
def test_lengths_alone_leave_several_linkages() -> None:
    assert survey(table_of(LENGTHS, 2e-3), FOUR_BAR).fits > 1


@pytest.mark.slow
def test_a_distance_in_another_unit_is_named_alone_and_does_not_bend_the_linkage() -> None:
    """In a table of millimetres, of which a row without a value was not read."""
    table = table_of((*BRACED, ("O2", "B", LATER), ("A", "B", LATER)), 2e-3)
    true_in = table.loc[4, "value_in"]
    table["value_mm"] = 25.4 * table.pop("value_in")
    table.loc[4, "value_mm"] *= 25.4
    table.loc[8, "value_mm"] = np.nan
    found = survey(table, FOUR_BAR)
    assert len(found.readings) == 8
    (misfit,) = found.misfits
    assert misfit.reading.row == 4
    assert misfit.expected == pytest.approx(true_in, abs=5e-3)
    assert "row 4, distance O4 A" in str(misfit)
    true = index_of((CRANK, COUPLER, ROCKER, GROUND, TURN))
    assert found.joints[1].value == pytest.approx(true, rel=1e-3)


SLIDER_CRANK = FOUR_BAR.with_name("slider-crank.toml")
# Crank, rod, offset of the slider's axis below the crank's pivot, turn of the crank from that axis
# at the reference.
SLIDER = (2.1, 5.2, 1.1, 0.05)


def slider_readings(
    numbers: Sequence[float] | np.ndarray,
) -> dict[tuple[str, str, str, float | None], float]:
    """Distances, and positions of the slider from its place at the reference, by the textbook
    formula.
    """
    crank, rod, offset, turn = numbers

    def place(angle: float) -> float:
        return float(
            crank * np.cos(turn + angle)
            + np.sqrt(rod**2 - (crank * np.sin(turn + angle) + offset) ** 2)
        )

    found: dict[tuple[str, str, str, float | None], float] = {
        ("DISTANCE", "O2", "A", None): float(crank),
        ("DISTANCE", "A", "C", None): float(rod),
    }
    for angle in (0.25, 0.5, 0.75, 1.0):
        found["DISTANCE", "O2", "C", angle] = float(np.hypot(place(angle), offset))
        found["PLUNGER", "", "", angle] = place(angle) - place(0.0)
    return found


def secant(numbers: Sequence[float] | np.ndarray) -> float:
    """Amplification of a slider-crank at the end of its stroke, one radian: secant of the rod to
    the axis.
    """
    crank, rod, offset, turn = numbers
    return float(1.0 / np.sqrt(1.0 - ((crank * np.sin(turn + 1.0) + offset) / rod) ** 2))


@pytest.mark.slow
def test_the_slider_crank_has_the_amplification_and_the_uncertainty_of_its_closed_form() -> None:
    u = {"DISTANCE": 2e-3, "PLUNGER": 5e-4}
    values = slider_readings(SLIDER)
    rows = [(kind, a, b, value, u[kind], at) for (kind, a, b, at), value in values.items()]
    columns = ["kind", "from", "to", "value_in", "u_in", "extension_in"]
    found = survey(pd.DataFrame(rows, columns=columns), SLIDER_CRANK)
    steps = 1e-6 * np.eye(4)
    ends = [
        [np.array(list(slider_readings(SLIDER + s * h).values())) for s in (1, -1)] for h in steps
    ]
    slopes = np.array([(a - b) / 2e-6 for a, b in ends]).T / [[u[key[0]]] for key in values]
    wanted = np.array([(secant(SLIDER + h) - secant(SLIDER - h)) / 2e-6 for h in steps])
    expected = float(np.sqrt(wanted @ np.linalg.inv(slopes.T @ slopes) @ wanted))
    assert found.misfits == ()
    assert [joint.value for joint in found.joints] == pytest.approx([secant(SLIDER)] * 3, rel=1e-4)
    joint = found.joints[0]
    assert joint.high - joint.low == pytest.approx(2 * 1.96 * expected, rel=0.2)


def test_the_gear_file_of_a_survey_is_its_gear(tmp_path: Path) -> None:
    found = braced()
    gear = found.write(str(tmp_path / "mine.toml"))
    assert (gear.path, len(gear.ensemble)) == (tmp_path / "mine.toml", 12)
    assert predict({1: 0.005}, gear).over_in == pytest.approx(
        predict({1: 0.005}, found.gear).over_in, abs=1e-12
    )


@pytest.mark.parametrize("name", ["mine.toml", "mine-ensemble.toml"])
def test_a_surveyed_gear_replaces_a_file_with_force_only(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(UsageError, match=r"mine\.toml cannot be written"):
        braced().write(tmp_path / "mine.toml")
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"
    assert braced().write(tmp_path / "mine.toml", force=True).id == "mine"


WRONG: list[tuple[str, Any, str]] = [
    ("value_in", "7,15 in", r"row 1: value_in '7,15 in': expected the number of one length"),
    ("value_in", -1.0, r"row 1: DISTANCE -1\.0 ± 0\.002: expected a reading above 0"),
    ("u_in", -1.0, r"row 1: DISTANCE .* expected a reading above 0"),
    ("to", "X", r"row 1: no DISTANCE from 'A' to 'X': expected points of O2, "),
    ("kind", "LENGTH", r"row 1: 'LENGTH' is not a valid ReadingKind"),
    ("value_inch", 1.0, r"column 'value_inch' is unknown"),
    ("value_mm", 1.0, r"row 1: .* expected the number of one length"),
    ("value_deg", 1.0, r"row 1: .* expected the number of one length"),
]


@pytest.mark.parametrize(("column", "value", "words"), WRONG)
def test_a_wrong_cell_is_named(column: str, value: Any, words: str) -> None:
    table = table_of(BRACED, 2e-3).astype(object)
    table.loc[1, column] = value
    with pytest.raises(UsageError, match=words):
        survey(table, FOUR_BAR)


def test_predictions_in_a_batch_are_those_of_the_calibrated_linkage(gear: Gear) -> None:
    linkage = SurveyedLinkage(gear)
    vectors = np.array([linkage.vector(each) for each in gear.ensemble[:4]])
    models = gear.ensemble_models[:4]
    indices = np.array([m.plunger_amplification() for m in models])
    assert linkage.amplification(vectors) == pytest.approx(indices, rel=1e-4)
    reading = (SurveyReading(0, ReadingKind.PLUNGER, "", "", 0.0, 1.0, 0.3, is_angle=False),)
    moved = [float(m.plunger(0.3) - m.plunger(m.stroke[1])) for m in models]
    assert linkage.predicted(reading, vectors)[:, 0] == pytest.approx(moved, abs=1e-4)


READINGS = Path(__file__).parents[2] / "docs" / "how-to" / "data" / "survey-readings.csv"


def read_of(gear: Gear, linkage: Linkage) -> pd.DataFrame:
    """The readings of the example's table on another linkage, without error."""
    model, mechanism, table = gear.model_of(linkage), linkage.mechanism, pd.read_csv(READINGS)
    vector = dict(
        zip(DesignSpace(linkage).names, DesignSpace(linkage).vector(linkage), strict=True)
    )
    places = {}
    for point in mechanism.points:
        origin, axes = mechanism.frame(point.plane)
        places[point.name] = origin + np.array([point.x, point.y]) @ axes[:2]
    mid = model.plunger(linkage.stroke[1])
    for k, row in table.iterrows():
        if row["kind"] == "PLUNGER":
            table.loc[k, "value_in"] = float(model.plunger(row["extension_in"]) - mid)
        elif row["kind"] == "DISTANCE":
            table.loc[k, "value_in"] = np.linalg.norm(places[row["from"]] - places[row["to"]])
        elif row["kind"] == "EXTENSION":
            table.loc[k, "value_in"] = vector["extension"]
        else:
            what = "direction" if row["to"] == "hinge" else row["to"]
            table.loc[k, "value_deg"] = np.degrees(vector[f"{row['from']}.{what}"])
    return table


def hidden(gear: Gear, rng: np.random.Generator) -> Linkage:
    """A linkage drawn between three of the ensemble, and a little around, that moves freely."""
    space = DesignSpace(gear.reference)
    members = np.array([space.vector(each) for each in gear.ensemble])
    members -= 2.0 * np.pi * np.round((members - members[0]) / (2.0 * np.pi))
    for _ in range(99):
        three = rng.choice(len(members), 3, replace=False)
        around = 0.15 * members.std(axis=0) * rng.standard_normal(len(space.names))
        linkage = space.linkage(rng.dirichlet(np.ones(3)) @ members[three] + around, "H")
        try:
            if gear.model_of(linkage).plunger_amplification().max() < 5.0:
                return linkage
        except MechanismError:
            # It does not close over its whole stroke.
            continue
    raise AssertionError("no linkage closes")


@pytest.mark.slow
def test_intervals_hold_the_indices_of_hidden_linkages_and_the_ensemble_fits_the_readings(
    gear: Gear,
) -> None:
    inside, wide, misfit = [], [], []
    for seed in (2, 3):
        rng = np.random.default_rng([4, seed])
        linkage = hidden(gear, rng)
        table = read_of(gear, linkage)
        columns = ["value_in", "value_deg"]
        u = table[["u_in", "u_deg"]].to_numpy()
        table[columns] += u * rng.standard_normal(u.shape)
        found = survey(table, gear)
        true = gear.model_of(linkage).plunger_amplification()
        inside += [j.low <= t <= j.high for j, t in zip(found.joints, true, strict=True)]
        wide += [j.low <= j.value <= j.high for j in found.joints]
        for drawn in found.gear.ensemble[1:]:
            off = (read_of(found.gear, drawn)[columns] - table[columns]).to_numpy() / u
            misfit.append(np.nanmean(off**2))
    assert np.mean(inside) >= 0.9
    assert all(wide)
    # Each adds to the readings' own error as much as the readings leave open.
    assert np.median(misfit) < 3.0
