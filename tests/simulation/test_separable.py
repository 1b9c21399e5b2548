"""``mlg gear separable``: what planned columns could tell apart, before anything is measured."""

from __future__ import annotations

import json
from functools import cache

import pytest
from scipy.stats import norm
from typer.testing import CliRunner

from mlg_troubleshoot.cli.app import app
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.workflows.separable import _APART, CausePlanned, separable

TWO_JOINTS = ("tail_no", "side", "clearance_3_in", "clearance_5_in")

ONE_POSITION = (
    *(
        "tail_no",
        "side",
        "inspection_date",
        "technician_id",
        "gauge_id",
        "approach",
        "temperature_c",
    ),
    *("hydraulic_pressure_psi", "gear_landings"),
)
CURVE = (*ONE_POSITION, "actuator_extension_in", "plunger_position_in")
JOINT_6 = ("direction_not_worst_case", "joint 6")
# What one position tells apart late or never, and a curve does.
FALL_APART = (
    JOINT_6,
    ("joint_contact", "joints 5,6"),
    ("unlisted_wear", None),
    ("calibration_rate", None),
)


@cache
def planned(*columns: str) -> dict[tuple[str, str | None], CausePlanned]:
    return {(cause.cause, cause.target): cause for cause in separable(columns=columns or None)}


def test_contact_of_the_only_joints_that_are_read_looks_like_a_wrong_rate_unless_it_is_large() -> (
    None
):
    contact = planned(*TWO_JOINTS)["joint_contact", "joints 3,5"]
    assert contact.nearest == "calibration_rate"
    assert contact.found_from_in is not None
    assert (
        contact.told_apart_from_in is None
        or contact.told_apart_from_in > 5.0 * contact.found_from_in
    )


def test_the_cheapest_column_that_splits_them_tells_them_apart_at_half_the_size() -> None:
    contact = planned(*TWO_JOINTS)["joint_contact", "joints 3,5"]
    assert contact.further_column is not None
    further = planned(*TWO_JOINTS, contact.further_column)[
        "joint_contact", "joints 3,5"
    ].told_apart_from_in
    assert further is not None
    assert contact.told_apart_from_in is None or further <= 0.5 * contact.told_apart_from_in


def test_a_cause_whose_column_is_not_planned_says_which() -> None:
    pressure = planned(*TWO_JOINTS)["elastic_compliance", None]
    assert pressure.missing_column == "hydraulic_pressure_psi"
    assert pressure.found_from_in is None


def test_causes_that_physics_lets_push_apart_only_are_not_rivals() -> None:
    oval = planned(*TWO_JOINTS)["oval_wear", "joint 3"]
    assert oval.nearest != "direction_not_worst_case joint 3"
    assert oval.told_apart_from_in is not None


def test_at_the_stated_distance_the_wrong_cause_is_ruled_out_four_times_in_five() -> None:
    # The difference of the log likelihoods has a mean of half the squared distance, and the
    # distance as its scatter.
    assert norm.sf(Beliefs().odds, _APART**2 / 2.0, _APART) == pytest.approx(0.8, abs=0.001)


def test_what_is_distinguished_is_not_smaller_than_what_is_found() -> None:
    for cause in planned(*TWO_JOINTS).values():
        if cause.told_apart_from_in is not None:
            assert cause.found_from_in is not None
            assert cause.told_apart_from_in >= cause.found_from_in > 0.0


def test_a_direction_and_a_contact_beside_it_are_one_to_readings_at_mid_position() -> None:
    assert (
        planned(*ONE_POSITION)[JOINT_6].nearest,
        planned(*ONE_POSITION)[JOINT_6].told_apart_from_in,
    ) == (
        "joint_contact joints 5,6",
        None,
    )


@pytest.mark.parametrize("key", [*FALL_APART, ("load_directions", None), ("geometry", None)])
def test_a_curve_tells_apart_what_one_position_cannot_and_is_proposed(
    key: tuple[str, str | None],
) -> None:
    one, curve = planned(*ONE_POSITION)[key], planned(*CURVE)[key]
    assert curve.told_apart_from_in is not None
    assert curve.told_apart_from_in < 0.5 * (one.told_apart_from_in or 1.0)
    assert one.further_column == "actuator_extension"


def test_a_curve_says_no_more_of_how_a_rod_was_rigged() -> None:
    one, curve = (
        planned(*columns)["rigging_offset", None].found_from_in for columns in (ONE_POSITION, CURVE)
    )
    assert one is not None
    assert curve is not None
    assert curve > 0.85 * one


def test_load_directions_and_another_linkage_are_each_others_nearest() -> None:
    assert planned(*ONE_POSITION)["load_directions", None].nearest == "geometry"
    assert planned(*ONE_POSITION)["geometry", None].nearest == "load_directions"


def test_a_column_that_no_table_has_is_refused() -> None:
    with pytest.raises(UsageError, match="oil_colour is not a column"):
        separable(columns=["oil_colour"])


def test_the_command_writes_json_and_names_what_it_cannot_test() -> None:
    told = CliRunner().invoke(
        app, ["gear", "separable", "--columns", ",".join(TWO_JOINTS), "--json"]
    )
    assert told.exit_code == 0
    causes = json.loads(told.stdout)["causes"]
    assert {c["missing_column"] for c in causes if c["cause"] == "thermal_growth"} == {
        "temperature_c"
    }
