"""A linkage from measurements: what a survey finds, doubts and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.surveying.plan import planned, suggested, suggested_early
from mlg_troubleshoot.surveying.readings import ReadingKind, SurveyedLinkage, SurveyReading
from mlg_troubleshoot.surveying.survey import Fitting, Prior, Survey, fit

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


def readings_of(
    places: Sequence[tuple[str, str, float | None]], u: float
) -> tuple[SurveyReading, ...]:
    values = four_bar_distances((CRANK, COUPLER, ROCKER, GROUND), TURN)
    return tuple(
        SurveyReading(ReadingKind.DISTANCE, *place[:2], values[place], u, place[2], row)
        for row, place in enumerate(places, start=2)
    )


LENGTHS = (
    ("O2", "A", None),
    ("A", "B", None),
    ("O4", "B", None),
    ("O2", "O4", None),
    ("O4", "A", None),
)
BRACED = (*LENGTHS, ("O2", "B", None), ("O4", "A", LATER))


@pytest.fixture(scope="module")
def four_bar() -> Gear:
    return load_gear(FOUR_BAR)


@pytest.fixture(scope="module")
def braced(four_bar: Gear) -> Survey:
    return fit(four_bar, readings_of(BRACED, 2e-3), np.random.default_rng(0))


def test_the_four_bar_has_the_amplification_that_its_measured_lengths_give_in_closed_form(
    braced: Survey,
) -> None:
    amplification = braced.linkage.amplification(braced.modes[0].vector[None])[0]
    assert amplification[1:3] == pytest.approx(
        index_of((CRANK, COUPLER, ROCKER, GROUND, TURN)), rel=1e-4
    )
    assert braced.misfits == ()
    assert len({m.sides for m in braced.modes}) == 1


def test_the_posterior_of_the_four_bar_is_the_closed_forms_propagated_uncertainty(
    braced: Survey,
) -> None:
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
    assert float(np.std(braced.linkage.amplification(braced.draws)[:, 1])) == pytest.approx(
        expected, rel=0.15
    )


def test_readings_less_the_numbers_that_they_determine_are_the_degrees_of_freedom(
    braced: Survey,
) -> None:
    numbers = len((CRANK, COUPLER, ROCKER, GROUND, TURN))
    assert braced.degrees_of_freedom == pytest.approx(len(BRACED) - numbers, abs=0.01)


def test_a_fit_tells_how_far_it_is(four_bar: Gear) -> None:
    told: list[tuple[int, int]] = []
    fit(
        four_bar,
        readings_of(LENGTHS, 2e-3),
        np.random.default_rng(0),
        lambda *done: told.append(done),
    )
    assert told == sorted(told)
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1]


def test_lengths_alone_leave_both_sides_of_a_joint_and_of_the_crank(four_bar: Gear) -> None:
    found = fit(four_bar, readings_of(LENGTHS, 2e-3), np.random.default_rng(0))
    shares = {
        s: sum(m.weight for m in found.modes if m.sides == s)
        for s in {m.sides for m in found.modes}
    }
    assert set(shares) == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    assert min(shares.values()) > 0.1


def test_two_readings_of_one_distance_that_differ_are_named_together(four_bar: Gear) -> None:
    readings = readings_of(LENGTHS, 0.01)
    found = fit(
        four_bar, (*readings, replace(readings[1], value=7.5, row=7)), np.random.default_rng(0)
    )
    assert found.contradicts
    assert {m.reading.row for m in found.misfits} == {3, 7}
    assert {m.group for m in found.misfits} == {(3, 7)}


def test_swapped_readings_are_named_as_swapped_and_do_not_bend_the_linkage(four_bar: Gear) -> None:
    readings = list(readings_of((*BRACED, ("O2", "B", LATER)), 2e-3))
    one, other = readings[4], readings[6]
    readings[4], readings[6] = replace(one, value=other.value), replace(other, value=one.value)
    found = fit(four_bar, tuple(readings), np.random.default_rng(0))
    assert {m.reading.row: m.suggestion.partition(":")[0] for m in found.misfits} == {
        6: "swapped with row 8",
        8: "swapped with row 6",
    }
    best = found.linkage.amplification(found.modes[0].vector[None])[0]
    assert best[1:3] == pytest.approx(index_of((CRANK, COUPLER, ROCKER, GROUND, TURN)), rel=1e-3)


def test_a_distance_in_another_unit_is_named_alone_with_the_unit_that_would_fit(
    four_bar: Gear,
) -> None:
    readings = list(readings_of((*BRACED, ("O2", "B", LATER)), 2e-3))
    readings[4] = replace(readings[4], value=readings[4].value * 25.4)
    (misfit,) = fit(four_bar, tuple(readings), np.random.default_rng(0)).misfits
    assert misfit.reading.row == 6
    assert "25.4 times too large" in misfit.suggestion


def test_distances_that_no_triangle_has_are_named_together(four_bar: Gear) -> None:
    readings = list(readings_of(LENGTHS, 0.01))
    # Ground less crank is 3.95 in: no two of the three readings say which is a tenth too long or
    # too short.
    readings[4] = replace(readings[4], value=3.8)
    found = fit(four_bar, tuple(readings), np.random.default_rng(0))
    assert found.contradicts
    assert {2, 5, 6} <= {m.reading.row for m in found.misfits}


SLIDER_CRANK = FOUR_BAR.with_name("slider-crank.toml")
# Crank, rod, offset of the slider's axis below the crank's pivot, turn of the crank from that axis
# at the reference.
SLIDER = (2.1, 5.2, 1.1, 0.05)


def slider_readings(
    numbers: Sequence[float] | np.ndarray,
) -> dict[tuple[ReadingKind, str, str, float | None], float]:
    """Distances, and positions of the slider from its place at the reference, by the textbook
    formula.
    """
    crank, rod, offset, turn = numbers

    def place(angle: float) -> float:
        return float(
            crank * np.cos(turn + angle)
            + np.sqrt(rod**2 - (crank * np.sin(turn + angle) + offset) ** 2)
        )

    found: dict[tuple[ReadingKind, str, str, float | None], float] = {
        (ReadingKind.DISTANCE, "O2", "A", None): float(crank),
        (ReadingKind.DISTANCE, "A", "C", None): float(rod),
    }
    for angle in (0.25, 0.5, 0.75, 1.0):
        found[ReadingKind.DISTANCE, "O2", "C", angle] = float(np.hypot(place(angle), offset))
        found[ReadingKind.PLUNGER, "", "", angle] = place(angle) - place(0.0)
    return found


def secant(numbers: Sequence[float] | np.ndarray) -> float:
    """Amplification of a slider-crank at the end of its stroke, one radian: secant of the rod to
    the axis.
    """
    crank, rod, offset, turn = numbers
    return float(1.0 / np.sqrt(1.0 - ((crank * np.sin(turn + 1.0) + offset) / rod) ** 2))


def test_the_slider_crank_has_the_amplification_and_the_uncertainty_of_its_closed_form() -> None:
    u = {ReadingKind.DISTANCE: 2e-3, ReadingKind.PLUNGER: 5e-4}
    values = slider_readings(SLIDER)
    readings = tuple(
        SurveyReading(kind, a, b, value, u[kind], at, row, driven_in="rad")
        for row, ((kind, a, b, at), value) in enumerate(values.items(), start=2)
    )
    found = fit(load_gear(SLIDER_CRANK), readings, np.random.default_rng(0))
    index = found.linkage.amplification(found.draws)[:, 0]
    best = found.linkage.amplification(found.modes[0].vector[None])[0]
    steps = 1e-6 * np.eye(4)
    ends = [
        [np.array(list(slider_readings(SLIDER + s * h).values())) for s in (1, -1)] for h in steps
    ]
    slopes = np.array([(a - b) / 2e-6 for a, b in ends]).T / [[u[key[0]]] for key in values]
    wanted = np.array([(secant(SLIDER + h) - secant(SLIDER - h)) / 2e-6 for h in steps])
    assert found.misfits == ()
    assert best == pytest.approx(np.full(3, secant(SLIDER)), rel=1e-4)
    assert float(np.std(index)) == pytest.approx(
        float(np.sqrt(wanted @ np.linalg.inv(slopes.T @ slopes) @ wanted)), rel=0.15
    )


def linkage_between(linkage: SurveyedLinkage, first: int, second: int, share: float) -> np.ndarray:
    gear = linkage.gear
    a, b = (linkage.vector(gear.ensemble[i]) for i in (first, second))
    mixed = (1.0 - share) * a + share * b
    assert linkage.closes(mixed[None])[0]
    return mixed


@pytest.fixture(scope="module")
def plan(gear: Gear) -> tuple[tuple[SurveyReading, bool], ...]:
    return planned(gear)


@pytest.fixture(scope="module")
def truth(gear: Gear) -> np.ndarray:
    return linkage_between(SurveyedLinkage(gear), 0, 1, 0.4)


@pytest.fixture(scope="module")
def read(
    gear: Gear, truth: np.ndarray, plan: tuple[tuple[SurveyReading, bool], ...]
) -> tuple[SurveyReading, ...]:
    """A full survey of a linkage, with the noise that it states."""
    linkage, rng = SurveyedLinkage(gear), np.random.default_rng(3)
    reach = truth[linkage.names.index("extension")] / gear.reference.stroke[1]
    rows = tuple(
        replace(r, extension=None if r.extension is None else r.extension * reach) for r, _ in plan
    )
    values = linkage.predicted(rows, truth[None])[0] + rng.standard_normal(len(rows)) * [
        r.u for r in rows
    ]
    return tuple(
        replace(r, value=float(v), row=i)
        for i, (r, v) in enumerate(zip(rows, values, strict=True), start=2)
    )


def test_a_fit_that_is_held_up_is_freed_by_fitting_again_from_around_it(
    gear: Gear, read: tuple[SurveyReading, ...]
) -> None:
    linkage = SurveyedLinkage(gear)
    prior = Prior(linkage)
    fitting = Fitting(linkage, prior, read)
    held_up = fitting.descend(fitting.begun(prior.members[7:8]), 1.0, 25, robust=True)
    freed = fitting.reheated(held_up, np.random.default_rng(0))
    assert held_up.loss[0] > 100.0
    assert freed.loss[0] < 30.0


@pytest.fixture(scope="module")
def slipped(
    gear: Gear, read: tuple[SurveyReading, ...], plan: tuple[tuple[SurveyReading, bool], ...]
) -> tuple[Survey, int]:
    """A full survey in which one distance was read in millimetres and entered as inches."""
    place = next(
        i for i, (r, checked) in enumerate(plan) if checked and r.kind is ReadingKind.DISTANCE
    )
    slip = replace(read[place], value=read[place].value * 25.4)
    row = slip.row
    assert row is not None
    return fit(gear, (*read[:place], slip, *read[place + 1 :]), np.random.default_rng(1)), row


@pytest.mark.slow
def test_a_full_survey_with_a_slip_in_it_still_finds_the_amplification_indices(
    slipped: tuple[Survey, int], truth: np.ndarray
) -> None:
    found, _ = slipped
    best, true = (found.linkage.amplification(v[None])[0] for v in (found.modes[0].vector, truth))
    error = np.abs(best / true - 1.0)
    assert np.median(error) < 0.04
    assert error.max() < 0.12


@pytest.mark.slow
def test_the_slip_alone_is_named_with_the_unit_that_would_fit(slipped: tuple[Survey, int]) -> None:
    found, row = slipped
    (misfit,) = found.misfits
    assert misfit.reading.row == row
    assert "25.4 times too large" in misfit.suggestion
    assert not found.contradicts


def named(
    gear: Gear, read: tuple[SurveyReading, ...], wrong: dict[int, float]
) -> dict[int | None, str]:
    """What a survey says of each misfit, with other values in these rows."""
    rows = tuple(replace(r, value=wrong.get(r.row or 0, r.value)) for r in read)
    return {m.reading.row: m.suggestion for m in fit(gear, rows, np.random.default_rng(1)).misfits}


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), [(29, 33), (24, 30)])
def test_a_swapped_pair_in_a_full_survey_is_named_and_nothing_else(
    gear: Gear, read: tuple[SurveyReading, ...], one: int, other: int
) -> None:
    value = {r.row: r.value for r in read}
    found = named(gear, read, {one: value[other], other: value[one]})
    assert {row: words.partition(":")[0] for row, words in found.items()} == {
        one: f"swapped with row {other}",
        other: f"swapped with row {one}",
    }


@pytest.mark.slow
def test_the_intervals_hold_the_true_indices_and_are_narrow(
    slipped: tuple[Survey, int], truth: np.ndarray
) -> None:
    found, _ = slipped
    low, high = np.quantile(found.linkage.amplification(found.draws), [0.05, 0.95], axis=0)
    true = found.linkage.amplification(truth[None])[0]
    assert np.mean((low <= true) & (true <= high)) >= 0.7
    assert np.median(high / low) < 1.25


@pytest.mark.slow
def test_every_draw_moves_over_the_whole_stroke(slipped: tuple[Survey, int]) -> None:
    found, _ = slipped
    assert len(found.draws) > 100
    assert found.linkage.closes(found.draws).all()


@pytest.mark.slow
def test_a_few_readings_leave_many_linkages_all_of_which_move(
    gear: Gear, read: tuple[SurveyReading, ...]
) -> None:
    found = fit(gear, read[:7], np.random.default_rng(1))
    assert found.misfits == ()
    assert len(found.draws) > 60
    assert found.linkage.closes(found.draws).all()
    assert found.linkage.closes(found.modes[0].vector[None])[0]


def test_predictions_in_a_batch_are_those_of_the_calibrated_linkage(gear: Gear) -> None:
    linkage = SurveyedLinkage(gear)
    vectors = np.array([linkage.vector(each) for each in gear.ensemble[:4]])
    models = gear.ensemble_models[:4]
    indices = np.array([m.plunger_amplification() for m in models])
    assert linkage.amplification(vectors) == pytest.approx(indices, rel=1e-4)
    reading = (SurveyReading(ReadingKind.PLUNGER, extension=0.3),)
    moved = [float(m.plunger(0.3) - m.plunger(m.stroke[1])) for m in models]
    assert linkage.predicted(reading, vectors)[:, 0] == pytest.approx(moved, abs=1e-4)


def test_a_displacement_in_a_batch_is_the_worst_of_the_calibrated_linkage(gear: Gear) -> None:
    linkage = SurveyedLinkage(gear)
    clearance = np.array([[0.0, 0.0, 0.013, 0.0, 0.007, 0.0, 0.0, 0.0, 0.0, 0.0]])
    vectors = np.array([linkage.vector(each) for each in gear.ensemble[:3]])
    worst = [float(worst_case(m, clearance).magnitude_in[0]) for m in gear.ensemble_models[:3]]
    assert linkage.displacement(vectors, clearance)[:, 0] == pytest.approx(worst, rel=5e-3)


def test_the_template_reads_what_narrows_the_indices_and_says_what_nothing_checks(
    plan: tuple[tuple[SurveyReading, bool], ...],
) -> None:
    kinds = [r.kind for r, _ in plan]
    assert [
        kinds.count(k)
        for k in (
            ReadingKind.DISTANCE,
            ReadingKind.ANGLE,
            ReadingKind.EXTENSION,
            ReadingKind.PLUNGER,
        )
    ] == [
        24,
        3,
        1,
        9,
    ]
    assert len({r.what for r, _ in plan}) == len(plan)
    assert {checked for _, checked in plan} == {True, False}


def test_the_next_reading_is_the_one_that_tells_most(four_bar: Gear) -> None:
    linkage = SurveyedLinkage(four_bar)
    rng = np.random.default_rng(0)
    drawn = linkage.vector(four_bar.reference) + 0.1 * rng.standard_normal(
        (300, len(linkage.names))
    )
    length = linkage.predicted((SurveyReading(ReadingKind.DISTANCE, "A", "B"),), drawn)
    found = suggested(linkage, drawn, length, ())
    assert found is not None
    assert {found.reading.start, found.reading.end} == {"A", "B"}
    assert found.narrowing > 0.8


def test_following_the_next_reading_from_an_empty_survey_tells_more_than_the_template_s_order(
    gear: Gear, truth: np.ndarray, plan: tuple[tuple[SurveyReading, bool], ...]
) -> None:
    linkage = SurveyedLinkage(gear)
    root = Prior(linkage).root

    def left_open(readings: tuple[SurveyReading, ...]) -> float:
        """Variances of the logarithms of the indices, added, by the linear estimate at the true
        linkage.
        """
        slopes = (
            linkage.slopes(readings, truth[None])[1][0] / np.array([[r.u] for r in readings]) @ root
        )
        wanted = linkage.log_slopes(truth[None])[0] @ root
        return float(
            np.trace(wanted @ np.linalg.inv(np.eye(len(root)) + slopes.T @ slopes) @ wanted.T)
        )

    asked: tuple[SurveyReading, ...] = ()
    while len(asked) < 12:
        found = suggested_early(linkage, asked, linkage.amplification)
        assert found is not None
        asked = (*asked, found.reading)
    assert left_open(asked) < 0.6 * left_open(tuple(r for r, _ in plan[:12]))


def test_nothing_is_suggested_where_nothing_would_narrow(four_bar: Gear) -> None:
    linkage = SurveyedLinkage(four_bar)
    drawn = np.repeat(linkage.vector(four_bar.reference)[None], 50, axis=0)
    drawn = drawn + 1e-6 * np.random.default_rng(0).standard_normal(drawn.shape)
    assert suggested(linkage, drawn, linkage.amplification(drawn), ()) is None
