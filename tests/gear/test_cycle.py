"""The retraction cycle of section 2.1: what the text states, and nothing that it does not."""

from __future__ import annotations

import pytest

from mlg_troubleshoot.gear.gear import Gear, RetractionCycle


@pytest.fixture
def cycle(gear: Gear) -> RetractionCycle:
    assert gear.cycle is not None
    return gear.cycle


def test_the_four_stages_stand_in_the_order_of_the_text(cycle: RetractionCycle) -> None:
    assert [(stage.name, stage.plunger) for stage in cycle.stages] == [
        ("Down Lock", "in"),
        ("Moving Up", "mid"),
        ("Moving Down", "mid"),
        ("Up Lock", "out"),
    ]
    assert cycle.source == "Section 2.1 of the paper"


def test_the_valve_has_six_combinations_of_three_positions_and_two_flows(cycle):
    combinations = {(state.plunger, state.flow) for state in cycle.valve}
    assert combinations == {
        (p, f) for p in ("in", "mid", "out") for f in ("retracting", "extending")
    }
    assert len(cycle.valve) == 6
    position = {stage.name: stage.plunger for stage in cycle.stages}
    assert all(position[state.stage] == state.plunger for state in cycle.valve)


def test_the_gear_moves_with_the_plunger_at_mid_and_where_the_text_is_silent_is_not_stated(cycle):
    at_mid = {state.flow: state.result for state in cycle.valve if state.plunger == "mid"}
    assert at_mid == {
        "retracting": "the main landing gear is raised",
        "extending": "the main landing gear is lowered",
    }
    assert "not stated" in cycle.beyond
    assert "not stated" in cycle.short
    silent = {(s.plunger, s.flow) for s in cycle.valve if s.plunger != "mid"}
    said = {(s.plunger, s.flow) for s in cycle.valve if "not stated" in s.result}
    assert said == silent


def test_the_release_has_the_four_steps_of_the_text_from_the_actuator_to_the_released_lock(cycle):
    words = [
        "actuator extends",
        "locking pin travels",
        "short link is pulled",
        "down lock is released",
    ]
    assert all(word in step for word, step in zip(words, cycle.release, strict=True))


def test_doors_open_before_the_gear_is_lowered_and_close_last_when_it_is_raised(cycle):
    assert cycle.extension_order == ("doors open first", "gear moves down")
    assert cycle.retraction_order[-1] == "doors close last"


@pytest.mark.parametrize(
    ("displacement", "words"),
    [
        *((at, "in the range") for at in (0.0, 0.03, -0.03)),
        (0.0301, "beyond the range"),
        (-0.0301, "short of the range"),
    ],
)
def test_a_displaced_plunger_is_told_in_the_words_of_the_text(cycle, displacement, words):
    assert words in cycle.symptom(displacement, 0.03)
