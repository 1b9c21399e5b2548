"""What is believed of a gear that failed: its joints, its rigging, or everything else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import RiggingCheck
from mlg_troubleshoot.decision.prediction import Cases
from mlg_troubleshoot.decision.priors import PRIORS
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import belief_of, every_joint, inspected

WORN = every_joint(0.004)


def causes_of(gear: Gear, clearance_in: dict[int, float], **more: Any) -> SimpleNamespace:
    return belief_of(Cases.of(gear, [inspected(clearance_in, **more)]))


def test_a_rigging_that_was_looked_at_is_rarely_the_cause(gear: Gear) -> None:
    odds = []
    for looked in (None, RiggingCheck.YES):
        found = causes_of(gear, WORN, readings_in=(0.036,), rigging_checked=looked)
        odds.append(float(found.chances[1] / found.chances[0]))
    assert odds[1] == pytest.approx(0.03 * odds[0])


def test_the_joints_explain_a_reading_at_their_worst_directions_though_no_random_ones_would(gear):
    worst_in = float(0.94 * gear.model.plunger_amplification() @ np.full(10, 0.004))
    found = causes_of(gear, WORN, readings_in=(worst_in,), rigging_checked=RiggingCheck.YES)
    assert found.held > 100.0
    assert found.chances[0] > 0.7


def test_a_joint_that_was_read_twice_is_known_to_be_worn_or_not(gear: Gear) -> None:
    found = causes_of(gear, {3: 0.013, 5: 0.001}, readings_in=(0.036,), measured_again=(3,))
    assert found.worn[[2, 4]].tolist() == pytest.approx([1.0, 0.0], abs=1e-3)
    assert ((found.worn[[0, 6]] > 0.0) & (found.worn[[0, 6]] < 1.0)).all()


def test_of_a_gear_of_which_nothing_was_read_the_joints_are_the_cause_as_often_as_usual(gear):
    found = belief_of(Cases.of(gear, [inspected({})]))
    assert found.chances[0] / found.chances[2] == pytest.approx(
        PRIORS.joints_for_one_elsewhere, rel=0.01
    )


def test_the_joints_of_a_gear_read_as_new_are_rarely_the_cause(gear: Gear) -> None:
    found = belief_of(Cases.of(gear, [inspected(every_joint(0.001))]))
    assert found.chances[0] / found.chances[2] < 0.1


def test_the_same_plunger_reading_is_the_joints_rather_than_the_rigging_where_one_was_read_worn(
    gear: Gear,
) -> None:
    at_rest = {"readings_in": (0.036,)}
    worn = causes_of(gear, {2: 0.011, 9: 0.001}, **at_rest)
    sound = causes_of(gear, {2: 0.001, 9: 0.001}, **at_rest)
    assert worn.chances[1] < 0.3 * sound.chances[1]


def test_a_worn_joint_that_hardly_moves_the_plunger_speaks_against_the_rigging_all_the_same(gear):
    # A rigging goes wrong at work on the gear, at which what is over its limit is restored.
    worn, sound = (
        causes_of(gear, every_joint(0.0015, j6=worn), readings_in=(0.036,), measured_again=(6,))
        for worn in (0.011, 0.0015)
    )
    assert worn.chances[1] / worn.chances[0] < 0.1 * sound.chances[1] / sound.chances[0]


def test_loaded_pins_scatter_by_their_angle() -> None:
    angles = np.random.default_rng(1).normal(0.0, np.radians(PRIORS.scatter_deg), 200_000)
    assert PRIORS.cosine == pytest.approx((np.cos(angles).mean(), np.cos(angles).std()), abs=2e-3)
