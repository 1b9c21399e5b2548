"""A linkage as a vector of its free numbers; changes inside the model, row by row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.gear.assembly import DesignSpace, member_values
from mlg_troubleshoot.gear.gear import Adjustment, Gear, Linkage, adjusted_worst_case
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import chance_beyond, worst_case
from mlg_troubleshoot.geometry.program import write_program

from .own import own_gear


def moved_as_a_whole(linkage: Linkage) -> Linkage:
    """The same linkage, shifted and turned in its base plane."""
    m = linkage.mechanism
    base, turn = m.planes[0].name, np.exp(0.3j)
    points = []
    for p in m.points:
        z = complex(p.x, p.y) * turn + (1.0 - 2.0j) if p.plane == base else complex(p.x, p.y)
        points.append(replace(p, x=z.real, y=z.imag))
    planes = tuple(
        replace(p, hinge_direction=p.hinge_direction + 0.3) if p.parent == base else p
        for p in m.planes
    )
    return replace(linkage, mechanism=replace(m, points=tuple(points), planes=planes))


def test_a_linkage_comes_back_from_its_vector(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble:
        again = space.linkage(space.vector(member), member.name)
        places = [[(p.x, p.y) for p in each.mechanism.points] for each in (again, member)]
        assert np.array(places[0]) == pytest.approx(np.array(places[1]), abs=1e-9)
        assert again.stroke == pytest.approx(member.stroke)


def test_branch_signs_are_those_of_the_coordinates(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble:
        again = space.linkage(space.vector(member), member.name)
        branches = [
            {k: v for k, v in write_program(each.mechanism).parameters.items() if k[:4] == "sign"}
            for each in (again, member)
        ]
        assert branches[0] == branches[1]


def test_moving_and_turning_everything_together_is_not_another_design(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    for member in gear.ensemble[:4]:
        assert space.vector(moved_as_a_whole(member)) == pytest.approx(
            space.vector(member), abs=1e-9
        )


def test_the_numbers_of_a_batch_are_those_of_each_linkage(gear: Gear) -> None:
    space = DesignSpace(gear.reference)
    vectors = np.array([space.vector(member) for member in gear.ensemble])
    together = write_program(space.assembled(vectors)).parameters
    for i, vector in enumerate(vectors):
        alone = write_program(space.assembled(vector)).parameters
        assert list(alone) == list(together)
        for name, value in alone.items():
            assert np.broadcast_to(together[name], len(vectors))[i] == pytest.approx(
                value, abs=1e-12
            ), name


def test_a_linkage_written_as_a_member_reads_back_from_the_ensemble(gear, tmp_path):
    own = own_gear(tmp_path)
    ensemble = tmp_path / "hawker-800xp-ensemble.toml"
    ensemble.write_text(
        ensemble.read_text()
        + "\n"
        + tomli_w.dumps({"members": {"K": member_values(gear.ensemble[3])}})
    )
    enlarged = load_gear(own)
    assert [linkage.name for linkage in enlarged.ensemble][-1] == "K"
    links = [0.001 * (-1) ** i for i in range(20)]
    again = enlarged.ensemble_models[-1].displacement(links)
    assert float(again) == pytest.approx(
        float(gear.ensemble_models[3].displacement(links)), abs=1e-12
    )


CLEARANCE = np.tile(np.linspace(0.001, 0.005, 10), (3, 1))
LINK = "length.3-5"


def test_an_empty_adjustment_changes_nothing(gear: Gear) -> None:
    plain, adjusted = (
        worst_case(gear.model, CLEARANCE),
        adjusted_worst_case(gear.model, Adjustment(CLEARANCE)),
    )
    assert np.array_equal(plain.over_in, adjusted.over_in)


def test_a_rate_factor_multiplies_both_senses_and_not_the_offset(gear: Gear) -> None:
    rate, offset = np.array([1.0, 1.1, 1.1]), np.array([-0.004, 0.002, -0.002])
    plain = worst_case(gear.model, CLEARANCE)
    adjusted = adjusted_worst_case(
        gear.model, Adjustment(CLEARANCE, rate_factor=rate, offset_in=offset)
    )
    assert adjusted.over_in == pytest.approx(rate * plain.over_in + offset)
    assert adjusted.under_in == pytest.approx(rate * plain.under_in + offset)


def test_a_scaled_number_is_multiplied_and_then_changed(gear: Gear) -> None:
    nominal = gear.model.kernel.parameters[gear.model.kernel.parameter_names.index(LINK)]
    scaled, changed = np.array([1.0, 0.999, 0.999]), np.array([-0.01, 0.01, 0.0])
    both = Adjustment(CLEARANCE, changed={LINK: changed}, scaled={LINK: scaled})
    assert both.numbers(gear.model)[LINK] == pytest.approx(scaled * nominal + changed)


def test_each_linkage_of_the_ensemble_changes_its_own_nominal_number(gear: Gear) -> None:
    adjustment = Adjustment(CLEARANCE, changed={LINK: np.full(3, 0.01)})
    found = {float(adjustment.numbers(model)[LINK][0]) for model in gear.ensemble_models}
    assert len(found) == 10


def test_a_longer_link_shifts_both_senses_by_what_the_link_alone_does(gear: Gear) -> None:
    zero = np.zeros((1, 10))
    longer = adjusted_worst_case(gear.model, Adjustment(zero, changed={LINK: np.array([0.002])}))
    assert longer.over_in == pytest.approx(longer.under_in)
    assert abs(longer.over_in[0]) == pytest.approx(
        0.002 * gear.model.plunger_amplification()[2], rel=0.02
    )


def test_rows_are_adjusted_independently(gear: Gear) -> None:
    adjusted = adjusted_worst_case(
        gear.model, Adjustment(CLEARANCE, changed={LINK: np.array([0.0, 0.002, 0.0])})
    )
    plain = worst_case(gear.model, CLEARANCE)
    assert (adjusted.over_in != plain.over_in).tolist() == [False, True, False]


def test_the_clearances_that_act_may_differ_from_the_measured_ones(gear: Gear) -> None:
    adjusted = adjusted_worst_case(gear.model, Adjustment(0.5 * CLEARANCE))
    assert adjusted.over_in == pytest.approx(worst_case(gear.model, 0.5 * CLEARANCE).over_in)


def test_the_chance_with_random_directions_counts_rate_and_offset(gear: Gear) -> None:
    clearance, margin = CLEARANCE[:1], np.array([0.03])
    moved = chance_beyond(gear.model, clearance, margin, 512, offset_in=np.array([0.025]))
    grown = chance_beyond(gear.model, clearance, margin, 512, rate_factor=np.array([3.0]))
    assert min(moved[0], grown[0]) > chance_beyond(gear.model, clearance, margin, 512)[0]


def test_an_offset_alone_decides_without_clearance(gear: Gear) -> None:
    zero, margin = np.zeros((2, 10)), np.full(2, 0.03)
    assert chance_beyond(
        gear.model, zero, margin, 64, offset_in=np.array([0.029, 0.031])
    ).tolist() == [0.0, 1.0]


def test_some_rows_of_an_adjustment_move_as_they_do_among_all(gear: Gear) -> None:
    three = np.array([0.0, 0.001, -0.001])
    whole = Adjustment(
        CLEARANCE,
        {LINK: three},
        {"length.6-7": 1.0 + three},
        1.0 + three,
        three,
        np.linspace(-1.0, 1.0, 10),
    )
    all_rows, last = (
        adjusted_worst_case(gear.model, whole),
        adjusted_worst_case(gear.model, whole.take(np.array([2, 1]))),
    )
    assert last.over_in == pytest.approx(all_rows.over_in[[2, 1]])
    assert last.under_in == pytest.approx(all_rows.under_in[[2, 1]])
