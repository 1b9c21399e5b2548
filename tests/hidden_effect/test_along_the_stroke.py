"""An effect is hidden along the stroke: a curve distinguishes what one position cannot, and one rig
is enough.

What was hidden is compared after the diagnosis, which reads the CSV file that the simulator wrote.
The seeds of what one position cannot distinguish are those of eight at which it could not, those of
a fleet without clearances once failed (one was AMBIGUOUS, one has a far reading that no slip
explains, in one something was named, in one the rate was not); the others are the first ones tried.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from typer.testing import CliRunner

from mlg_troubleshoot.cli.app import app
from mlg_troubleshoot.diagnosis import Diagnosis
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files

from .along import CLEARANCES
from .simulator import linkage
from .simulator.fleet import draw_design
from .simulator.physics import Gears
from .simulator.records import write_csv
from .simulator.stroke import CurveSpec, curve_table, positions

ALONG = ("actuator_extension_in", "plunger_position_in")
DIRECTIONS = CurveSpec(effect="load_directions", parameters={"spread_deg": 40.0})
OTHER_LINKAGE = CurveSpec(geometry="C")
RATE = CurveSpec(effect="calibration_rate")
SOUND = CurveSpec()
RIG = CurveSpec(gears=1, rows=24, fleet=False)
OTHER_RIG = CurveSpec(gears=1, rows=24, fleet=False, geometry="A-G:0.2")


def write(file: Path, spec: CurveSpec, seed: int, without: tuple[str, ...] = ()) -> Path:
    """Write the table of a curve without some of its columns."""
    table = curve_table(spec, seed)[0]
    write_csv({name: cells for name, cells in table.items() if name not in without}, file)
    return file


@cache
def found(name: str, seed: int, without: tuple[str, ...] = ()) -> Diagnosis:
    """Hide, write, read, diagnose: once for all tests of a worker."""
    with TemporaryDirectory() as folder:
        file = write(Path(folder) / "curve.csv", globals()[name], seed, without)
        return diagnose_files([file], DiagnoseOptions()).diagnosis


def named(diagnosis: Diagnosis) -> list[str]:
    """Each named cause."""
    return [c.candidate.cause.name for c in diagnosis.causes]


def test_the_simulated_plunger_at_full_extension_reads_as_at_mid_position() -> None:
    design = draw_design(np.random.default_rng(1), 8)
    gears = Gears(linkage.load("A"), design, np.zeros((8, 10)))
    state = gears.sound()
    at_mid = positions(gears, state, np.full(8, gears.geometry.stroke)) - gears.read(state)
    assert np.ptp(at_mid) < 1e-12


def test_at_one_position_directions_are_named_where_a_linkage_is_far_less_likely() -> None:
    d = found("DIRECTIONS", 2, ALONG)
    assert named(d) == ["load_directions"]
    assert d.probabilities[("load_directions", None)] > 9.0 * d.probabilities[("geometry", None)]


def test_at_one_position_another_linkage_is_one_of_a_set() -> None:
    assert "geometry" in [
        c.candidate.cause.name for c in found("OTHER_LINKAGE", 8, ALONG).also_possible
    ]


def test_a_curve_tells_load_directions_from_the_linkage() -> None:
    assert named(found("DIRECTIONS", 2)) == ["load_directions"]


@pytest.mark.parametrize("seed", [4, 8])
def test_a_curve_tells_the_linkage_from_load_directions(seed: int) -> None:
    assert named(found("OTHER_LINKAGE", seed)) == ["geometry"]


def test_a_smooth_curve_of_misfit_is_not_an_entry_error() -> None:
    assert found("OTHER_LINKAGE", 4).faults == ()


def test_the_rate_of_the_dial_is_found_with_its_size_in_the_travel_of_the_plunger() -> None:
    hidden = curve_table(RATE, 1)[1]
    (cause,) = found("RATE", 1).causes
    assert cause.parameters["rate_change"] == pytest.approx(
        hidden["sign"] * hidden["rate_error"], abs=0.01
    )


def test_nothing_is_found_on_a_sound_rig() -> None:
    assert found("RIG", 1).verdict == "NONE"


def test_nothing_is_found_on_a_worn_rig_of_which_no_clearance_was_read() -> None:
    assert found("RIG", 1, CLEARANCES).verdict == "NONE"


@pytest.mark.parametrize("seed", [9000, 9001, 20011])
def test_nothing_is_found_in_a_sound_fleet_of_which_no_clearance_was_read(seed: int) -> None:
    assert found("SOUND", seed, CLEARANCES).verdict == "NONE"


def test_the_rate_is_found_in_a_fleet_of_which_no_clearance_was_read() -> None:
    assert named(found("RATE", 20005, CLEARANCES)) == ["calibration_rate"]


def test_a_fleet_without_clearances_says_that_its_wear_is_supposed() -> None:
    assert any("only supposed" in said for said in found("SOUND", 9000, CLEARANCES).unsaid)


def test_one_rig_without_clearances_shows_another_linkage() -> None:
    assert named(found("OTHER_RIG", 1, CLEARANCES)) == ["geometry"]


def test_what_one_rig_cannot_say_stands_beside_its_verdict(tmp_path: Path) -> None:
    file = write(tmp_path / "rig.csv", RIG, 1, CLEARANCES)
    out = CliRunner().invoke(app, ["diagnose", str(file), "--json", "--quiet"])
    said = json.loads(out.stdout)["cannot_say"]
    assert [out.exit_code, len(said)] == [0, 1]
    assert "whether other gears do the same" in said[0]


@pytest.mark.parametrize("seed", [1, 3])
def test_joints_worn_unlike_the_rest_of_their_gear_are_not_called_swapped(seed: int) -> None:
    assert found("RATE", seed).faults == ()
