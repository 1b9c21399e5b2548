"""NEXT followed to its end by a technician who knows the truth: a few gears of two worlds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.decision.technician import CLEARANCE, NONE, OTHER, WORLDS, Hangar, counted, replayed

_BY_NAME = {world.name: world for world in WORLDS}


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Hangar, tuple, tuple]:
    folder = tmp_path_factory.mktemp("hangar")
    found, hangar = counted(_BY_NAME["A mis-rigged"], 54, 1900, folder)
    return found.figures, hangar, found.minutes, found.against


def test_every_gear_comes_to_an_end(worked: tuple) -> None:
    assert worked[0]["ended"] == 1.0


def test_failures_by_clearance_are_cured_in_fewer_minutes_than_by_measuring_everything(worked):
    assert worked[0]["cured"] == 1.0
    assert worked[2][CLEARANCE] <= 0.82 * worked[3][CLEARANCE]


def test_other_failures_cost_little_and_no_sound_joint(worked: tuple) -> None:
    assert worked[2][OTHER] <= 0.2 * worked[3][OTHER]
    assert worked[0]["other, sound restored"] == 0.0


def test_gears_that_did_not_fail_keep_their_sound_joints(worked: tuple) -> None:
    assert worked[2][NONE] <= 0.95 * worked[3][NONE]
    assert worked[0]["not failed, sound restored"] == 0.0


def test_a_repaired_failure_by_clearance_ends_done(worked: tuple) -> None:
    ends = {g.end for g in worked[1].gears if g.kind == CLEARANCE and g.repairs}
    assert ends == {"DONE"}


def test_nothing_is_done_twice_without_new_information(worked: tuple) -> None:
    for gear in worked[1].gears:
        measured = [joints for action, joints in gear.done if action == "MEASURE"]
        assert len(measured) == len(set(measured))


def test_one_gear_is_told_alone_what_it_is_told_in_a_batch(worked: tuple, tmp_path: Path) -> None:
    fresh = Hangar(_BY_NAME["A mis-rigged"], 18, 1901)
    together = fresh.judged(fresh.gears, tmp_path)
    for gear, among_others in zip(fresh.gears, together, strict=True):
        (alone,) = fresh.judged([gear], tmp_path)
        assert alone["plan"] == among_others["plan"]
        assert (alone["end"], alone["verdict"]) == (among_others["end"], among_others["verdict"])


@pytest.mark.parametrize(
    "name", ["A one area shut", pytest.param("A one joint shut", marks=pytest.mark.slow)]
)
def test_a_plan_ends_without_asking_for_what_cannot_be_reached(name: str, tmp_path: Path) -> None:
    hangar = Hangar(_BY_NAME[name], 12, 1902).work(tmp_path)
    assert all(gear.shut and gear.end for gear in hangar.gears)
    assert [gear.asked & gear.shut for gear in hangar.gears] == [set()] * len(hangar.gears)


def test_no_repaired_failure_is_sent_elsewhere_by_what_its_row_says_from_before(tmp_path):
    repaired, sent_elsewhere, _unasked = replayed(24, 1903, tmp_path)
    assert repaired > 5
    assert sent_elsewhere == 0


@pytest.mark.slow
def test_another_gauge_spares_the_joints_that_one_reads_too_high(tmp_path: Path) -> None:
    found, _hangar = counted(_BY_NAME["D gravity, gauge x1.2"], 120, 1905, tmp_path)
    assert found.figures["sound of restored"] <= 0.08
    assert found.figures["not failed, sound restored"] <= 0.05
