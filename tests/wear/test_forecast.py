"""Forecasts of wear: who gets one, how wide it is, and how often it holds."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.wear import Samples, WearModel, WearPath, first_passage, fit_wear

from . import real, worlds

ENDS = [0.05, 0.5, 0.95]


def small_fleet() -> list[WearPath]:
    rng = np.random.default_rng(4)
    lives = worlds.fleet("wiener", rng, parts=9, visits=4)
    paths = [WearPath(life.unit, life.usage, life.read) for part in lives for life in part]
    return [
        *paths,
        WearPath("read once", [0.4], [0.7]),
        WearPath("renewed", [0.3, 0.6], [1.0, 1.7]),
        WearPath("renewed", [], []),
    ]


@pytest.fixture(scope="module")
def model() -> WearModel:
    return fit_wear(small_fleet())


def width(samples: Samples) -> float:
    low, high = samples.quantile([0.05, 0.95]).T
    return float(np.mean(high - low))


def usage_to_limit(model: WearModel, unit: str, limit: float) -> Samples:
    """Usage at which the wear of a unit first passes a limit, from its last reading on."""
    last = np.max(model.paths[unit][-1].usage)
    ahead = model.scale.usage * np.concatenate([[0], np.geomspace(1 / 50, 40, 44)])
    wear = model.forecast(unit, last + ahead, reading=False).samples
    return Samples(last + first_passage(ahead, wear, limit))


def test_quantiles_come_one_row_a_unit_and_usage(model: WearModel) -> None:
    assert model.forecast("part 1", [1.6, 1.8]).quantile(ENDS).shape == (2, 3)
    units = ["part 1", "part 2", "read once"]
    assert model.forecast(units, [[1.6, 1.8], [1.7, 1.9], [2.0, 2.2]]).quantile(ENDS).shape == (
        3,
        2,
        3,
    )


def test_many_units_at_once_are_forecast_as_each_alone(model: WearModel) -> None:
    alone = model.forecast("part 3", [1.8]).quantile(ENDS)
    among = model.forecast(["part 1", "part 3"] * 40, [1.8]).quantile(ENDS)[1]
    assert among == pytest.approx(alone, abs=0.25 * float(alone[0, 2] - alone[0, 0]))


def test_groups_of_units_have_the_very_numbers_that_each_group_has_alone(model: WearModel) -> None:
    units = ["part 1", "renewed", "part 3", "new", "read once", "part 2"]
    usage = np.linspace(1.5, 2.5, 12).reshape(6, 2)
    among = model.forecast(units, usage, together=2).samples
    alone = [model.forecast(units[n : n + 2], usage[n : n + 2]).samples for n in (0, 2, 4)]
    assert np.array_equal(among, np.concatenate(alone))


def test_a_unit_that_went_further_than_all_others_goes_on_from_its_own_last_reading(model):
    last = 3.0 * model.scale.usage
    far = model.of([WearPath("far", np.linspace(0.2, last, 9), np.linspace(0.2, last, 9))])
    now, ahead = far.forecast("far", [last, 1.01 * last], reading=False).quantile(0.5)
    spread = width(far.forecast("far", [last], reading=False))
    assert (now, ahead) == pytest.approx((last, 1.01 * last), abs=0.05 * last)
    assert spread < 0.05 * last


def test_usages_in_any_order_give_each_its_own_forecast(model: WearModel) -> None:
    ahead = model.forecast("part 1", [1.6, 2.4]).quantile(0.5)
    assert model.forecast("part 1", [2.4, 1.6]).quantile(0.5) == pytest.approx(ahead[::-1])


def test_a_unit_read_often_is_known_better_than_one_read_once_and_that_better_than_a_new_one(model):
    often, once, new = (
        width(model.forecast(unit, [1.0])) for unit in ("part 1", "read once", "nobody knows it")
    )
    assert often < once < new


def test_a_restored_part_starts_again_and_is_known_better_than_a_new_one(model: WearModel) -> None:
    restored, new = (
        model.forecast("renewed", [0.0, 1.0]),
        model.forecast("nobody knows it", [0.0, 1.0]),
    )
    assert restored.quantile(0.5)[0] == pytest.approx(new.quantile(0.5)[0], abs=0.06)
    # It wore fast before.
    assert restored.quantile(0.5)[1] > new.quantile(0.5)[1]


def test_a_reading_scatters_more_than_the_wear_itself(model: WearModel) -> None:
    assert width(model.forecast("part 1", [1.5])) > width(
        model.forecast("part 1", [1.5], reading=False)
    )


def test_the_chance_of_having_crossed_is_that_of_being_above_where_wear_hardly_goes_back(model):
    crossed = np.mean(usage_to_limit(model, "part 2", 2.2).samples <= 2.0)
    above = np.mean(model.forecast("part 2", [2.0], reading=False).samples[0] > 2.2)
    assert crossed == pytest.approx(above, abs=0.1)


def test_quantiles_among_crossings_that_never_come_are_infinite_and_never_nan() -> None:
    crossing = Samples(np.array([1.0, 2.0, np.inf, np.inf, np.inf])).quantile(
        [0.0, 0.1, 0.25, 0.4, 0.6, 1.0]
    )
    assert crossing.tolist() == [1.0, 1.0, 2.0, np.inf, np.inf, np.inf]


def test_the_same_seed_gives_the_same_forecast() -> None:
    one, two = (
        fit_wear([WearPath("a", [1.0, 2.0], [1.0, 2.2])], seed=3).forecast("a", [3.0])
        for _ in range(2)
    )
    assert np.array_equal(one.samples, two.samples)


def test_another_seed_tells_the_kinds_alike_where_all_parts_begin_at_exactly_the_same_number():
    rng = np.random.default_rng(3)
    usage = np.linspace(0.0, 1.0, 8)
    worn = 0.9 + np.cumsum(
        rng.lognormal(-2.0, 0.3, (20, 1)) * rng.gamma(9.0, 1.0 / 9.0, (20, 7)), axis=1
    )
    paths = [WearPath(str(k), usage, np.r_[0.9, each]) for k, each in enumerate(worn)]
    one, other = (fit_wear(paths, seed=seed).kinds for seed in (0, 1))
    assert max(abs(one[kind] - other[kind]) for kind in one) < 0.05


def test_other_units_of_measurement_give_the_same_forecast(model: WearModel) -> None:
    other = fit_wear(
        [
            WearPath(p.unit, np.asarray(p.usage) * 1000.0, np.asarray(p.value) * 0.0254)
            for p in small_fleet()
        ]
    )
    forecast = other.forecast("part 1", [1600.0]).quantile(ENDS) / 0.0254
    assert forecast == pytest.approx(model.forecast("part 1", [1.6]).quantile(ENDS), rel=0.02)


def test_what_falls_is_forecast_as_what_grows_seen_in_a_mirror(model: WearModel) -> None:
    mirrored = fit_wear(
        [WearPath(p.unit, p.usage, 9.0 - np.asarray(p.value)) for p in small_fleet()]
    )
    assert 9.0 - mirrored.forecast("part 1", [1.6]).quantile(0.5) == pytest.approx(
        model.forecast("part 1", [1.6]).quantile(0.5), rel=0.03
    )
    only = fit_wear([WearPath("part", [0.1, 1.0], [9.0, 8.0])])
    assert only.forecast("part", [2.0]).quantile(0.95) < 8.5


def test_a_declared_error_of_reading_is_taken_as_it_is() -> None:
    paths = [
        WearPath(f"{i}", [0.1, 0.5, 0.9], [0.1, 0.5 + i / 100, 0.9 + i / 50], reading_u=0.3)
        for i in range(6)
    ]
    model = fit_wear(paths)
    samples = model.forecast("2", [1.0]).samples - model.forecast("2", [1.0], reading=False).samples
    assert np.std(model.forecast("2", [1.0]).samples) > 0.3
    assert np.isfinite(samples).all()


def test_one_reading_of_one_unit_is_enough_for_a_wide_forecast() -> None:
    model = fit_wear([WearPath("a", [100.0], [0.002], reading_u=0.0005)])
    low, _middle, high = model.forecast("a", [200.0]).quantile(ENDS)[0]
    assert low < 0.002 < high


@pytest.mark.parametrize(
    ("usage", "value", "said"),
    [
        ([2.0, 1.0], [0.0, 0.0], "ascend"),
        ([-1.0, 1.0], [0.0, 0.0], "ascend from 0"),
        ([0.0], [np.nan], "finite"),
        ([0.0, 1.0], [0.0], "one value a usage|2 usages"),
    ],
)
def test_a_path_that_is_not_valid_is_refused(usage, value, said):
    with pytest.raises(UsageError, match=said):
        WearPath("a", usage, value)
    with pytest.raises(UsageError, match="no path has a reading"):
        fit_wear([WearPath("a", [], [])])


@pytest.mark.parametrize("usage", [-0.1, np.nan])
def test_a_usage_that_cannot_be_is_refused(model: WearModel, usage: float) -> None:
    with pytest.raises(UsageError, match="negative or not finite"):
        model.forecast("part 1", [usage, 1.6])


@pytest.mark.slow
def test_nine_in_ten_last_visits_of_the_liners_are_held() -> None:
    data = real.liners()
    model = fit_wear(
        [
            WearPath(u, h[: max(len(h) - 1, 1), 0], h[: max(len(h) - 1, 1), 1])
            for u, h in data.items()
        ]
    )
    ends = {
        u: model.forecast(u, h[-1:, 0]).quantile(ENDS)[0] for u, h in data.items() if len(h) > 1
    }
    assert sum(low <= data[u][-1, 1] <= high for u, (low, _middle, high) in ends.items()) >= 14


@pytest.mark.slow
@pytest.mark.parametrize(("seen", "least"), [(0.03, 18), (0.06, 16)])
def test_the_crack_limit_is_crossed_when_the_forecast_says(seen: float, least: int) -> None:
    held = early = 0
    data = real.cracks()
    known = {u: h[h[:, 0] <= seen + 1e-9] for u, h in data.items()}
    model = fit_wear([WearPath(u, h[:, 0], h[:, 1]) for u, h in known.items()])
    for unit, h in data.items():
        if known[unit][-1, 1] < 1.2 <= h[-1, 1]:
            crossing = np.interp(1.2, h[:, 1], h[:, 0])
            low, high = usage_to_limit(model, unit, 1.2).quantile([0.05, 0.95])
            held, early = held + (low <= crossing <= high), early + (crossing < low)
    assert held >= least
    assert early <= 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", worlds.KINDS)
def test_ninety_percent_intervals_hold_about_ninety_percent_in_a_known_world(kind: str) -> None:
    held = []
    for seed in (11, 12):
        rng = np.random.default_rng(seed)
        lives = worlds.fleet(kind, rng)
        paths = [WearPath(life.unit, life.usage, life.read) for part in lives for life in part[:-1]]
        paths += [WearPath(part[-1].unit, part[-1].usage[:3], part[-1].read[:3]) for part in lives]
        model = fit_wear(paths)
        for part in lives:
            low, high = model.forecast(part[-1].unit, part[-1].usage[3:]).quantile([0.05, 0.95]).T
            held += list((low <= part[-1].read[3:]) & (part[-1].read[3:] <= high))
    assert 0.85 <= np.mean(held) <= 0.97
