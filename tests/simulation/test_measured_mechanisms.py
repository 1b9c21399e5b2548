"""Measured mechanisms that nobody here made: what is known about them must be found."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Verdict, diagnose_simulation
from tests.simulation.real_rigs import Gear, Panda, Plotter


@cache
def gear() -> SimulationDiagnosis:
    rig = Gear()
    return diagnose_simulation(rig.predict, rig.runout_mm, rig.suspects, groups=rig.session)


def test_the_gear_names_sleeves_and_dial_as_one_class_with_the_reading_that_separates_them():
    first = gear().causes[0]
    assert gear().verdict is Verdict.NAMED
    assert {first.name, *first.aliases} == {"sleeve_size", "dial_scale"}
    assert first.separates == "the dial against a gauge block"
    assert gear().aliases == (("sleeve_size", "dial_scale"),)


def test_the_gear_loses_85_percent_of_its_misfit_on_the_other_session() -> None:
    assert gear().gain.held_out_by == "group"
    assert gear().gain.rms_before == pytest.approx(0.0371, abs=0.0002)
    assert gear().gain.rms_after < 0.15 * gear().gain.rms_before
    rig = Gear()
    sessions = rig.runout_mm[rig.session == 1] - rig.runout_mm[rig.session == 2]
    repeatability = float(np.sqrt(np.mean(sessions**2) / 2.0))
    assert gear().gain.rms_after == pytest.approx(repeatability, rel=0.35)
    assert gear().p_unlisted < 0.5


@cache
def plotter() -> SimulationDiagnosis:
    rig = Plotter()
    return diagnose_simulation(rig.predict, rig.pulse_us, rig.suspects, rig.nuisance)


def test_the_plotter_has_hysteresis_on_both_servos_and_other_slopes() -> None:
    values = {cause.name: cause.value for cause in plotter().causes}
    assert values["hysteresis_1"] == pytest.approx(0.6, abs=0.15)
    assert values["hysteresis_2"] == pytest.approx(0.9, abs=0.15)
    assert values["slope_1"] == pytest.approx(9.65, abs=0.1)
    assert values["slope_2"] == pytest.approx(8.87, abs=0.1)


def test_what_is_bent_in_the_plotter_is_unlisted() -> None:
    assert plotter().verdict is Verdict.UNLISTED
    assert plotter().p_unlisted > 0.99


@cache
def arm(session: int) -> SimulationDiagnosis:
    rig = Panda(session)
    return diagnose_simulation(rig.predict, rig.measured, rig.offsets, rig.nuisance, rig.place)


@pytest.mark.slow
@pytest.mark.parametrize("session", [1, 2])
def test_the_arm_has_joint_4_wrong_first_and_5_and_6_after_it(session: int) -> None:
    found = arm(session)
    assert found.causes[0].name == "joint_4"
    assert -1.4 < found.causes[0].value < -1.2
    assert {"joint_5", "joint_6"} <= {cause.name for cause in found.causes[1:]}


@pytest.mark.slow
@pytest.mark.parametrize("session", [1, 2])
def test_the_arms_first_joint_and_what_the_tool_absorbs_cannot_be_tested(session: int) -> None:
    assert set(arm(session).untestable) == {"joint_1", "joint_7"}


@pytest.mark.slow
def test_both_sessions_of_the_arm_name_the_same_causes() -> None:
    first, second = (
        {cause.name: cause.value for cause in arm(session).causes} for session in (1, 2)
    )
    assert first.keys() == second.keys()
    for name, value in first.items():
        assert value == pytest.approx(second[name], abs=0.12)


@pytest.mark.slow
@pytest.mark.parametrize("session", [1, 2])
def test_trained_on_some_places_the_arms_misfit_at_another_falls_by_80_percent(session):
    gain = arm(session).gain
    assert gain.held_out_by == "group"
    assert gain.rms_after < 0.2 * gain.rms_before


@pytest.mark.slow
def test_with_all_denavit_hartenberg_parameters_no_session_names_what_the_other_contradicts():
    found = []
    for session in (1, 2):
        rig = Panda(session)
        found.append(
            diagnose_simulation(rig.predict, rig.measured, rig.every, rig.nuisance, rig.place)
        )
    for one, other in (found, found[::-1]):
        known = {cause.name: cause for cause in (*other.causes, *other.also_possible)}
        for cause in one.causes:
            alike = [known[name] for name in (cause.name, *cause.aliases) if name in known]
            assert alike, f"{cause.name} is named by one session only"
            same = known.get(cause.name)
            assert same is None or np.sign(same.value) == np.sign(cause.value)
