"""Where the coordinates come from."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import tomli_w

from mlg_troubleshoot.errors import GearFileError, InconclusiveDataError, UsageError
from mlg_troubleshoot.gear.design import member_values
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.paper.reconstruct import Reconstruction, reconstruct
from mlg_troubleshoot.paper.targets import Target, load_targets, targets_file


@pytest.fixture(scope="module")
def targets(gear: Gear) -> tuple[Target, ...]:
    return load_targets(targets_file(gear))


@pytest.fixture(scope="module")
def shifted(gear: Gear, targets: tuple[Target, ...]) -> Reconstruction:
    """Linkage A with joint 3 pushed aside by a quarter of an inch, polished again."""
    mechanism = gear.reference.mechanism
    points = tuple(replace(p, y=p.y + 0.1) if p.name == "3" else p for p in mechanism.points)
    start = replace(gear.reference, mechanism=replace(mechanism, points=points))
    return reconstruct(gear, targets, np.random.default_rng(0), 0, start=start, minutes=10.0)


@pytest.mark.slow
def test_a_start_is_polished_until_every_printed_number_is_met_and_most_of_it_stays_free(
    shifted: Reconstruction,
) -> None:
    assert shifted.meets_all
    binding = {each.target.measure for each in shifted.met if each.binds}
    assert {"worst_displacement", "max_amplification_index"} <= binding
    assert 3 <= shifted.determined < 10 < shifted.numbers


@pytest.mark.slow
def test_a_true_number_that_is_added_narrows_what_is_free(
    gear: Gear, targets: tuple[Target, ...], shifted: Reconstruction
) -> None:
    known = msgspec.structs.replace(
        next(t for t in targets if t.measure == "end_rate"),
        value=2.05,
        tolerance=0.05,
        at_least=None,
        at_most=None,
        search=True,
    )
    more = reconstruct(
        gear, (*targets, known), np.random.default_rng(0), 0, start=shifted.linkage, minutes=10.0
    )
    assert more.meets_all
    assert more.determined > shifted.determined


def test_a_linkage_written_as_a_member_reads_back_from_the_ensemble(
    gear: Gear, tmp_path: Path
) -> None:
    for file in gear.path.parent.glob("hawker-800xp*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    ensemble = tmp_path / "hawker-800xp-ensemble.toml"
    ensemble.write_text(
        ensemble.read_text()
        + "\n"
        + tomli_w.dumps({"members": {"K": member_values(gear.ensemble[3])}})
    )
    enlarged = load_gear(tmp_path / "hawker-800xp.toml")
    assert [linkage.name for linkage in enlarged.ensemble][-1] == "K"
    links = [0.001 * (-1) ** i for i in range(20)]
    again = enlarged.ensemble_models[-1].displacement(links)
    assert float(again) == pytest.approx(
        float(gear.ensemble_models[3].displacement(links)), abs=1e-12
    )


@pytest.mark.slow
def test_targets_that_cannot_be_met_end_with_a_message(
    gear: Gear, targets: tuple[Target, ...]
) -> None:
    with pytest.raises(InconclusiveDataError, match="no linkage met"):
        reconstruct(gear, targets, np.random.default_rng(0), 0, minutes=0.01)


@pytest.mark.parametrize("width", ["0.0", "-0.1", "1e-30"])
def test_a_target_without_a_tolerance_is_refused(gear: Gear, tmp_path: Path, width: str) -> None:
    text = targets_file(gear).read_text(encoding="utf-8")
    (tmp_path / "t.toml").write_text(
        re.sub(r"tolerance = \S+", f"tolerance = {width}", text, count=1)
    )
    with pytest.raises(GearFileError, match="tolerance: expected a number above 0"):
        load_targets(tmp_path / "t.toml")


def test_a_target_that_moves_with_nothing_determines_nothing(
    gear: Gear, targets: tuple[Target, ...]
) -> None:
    case = next(t for t in targets if t.clearance_in)
    nothing = msgspec.structs.replace(
        case,
        clearance_in=dict.fromkeys(case.clearance_in, 0.0),
        value=0.0,
        tolerance=0.001,
        search=True,
    )
    found = reconstruct(
        gear, (nothing,), np.random.default_rng(0), 0, start=gear.reference, minutes=0.0
    )
    assert found.determined == 0


def test_a_file_without_numbers_to_search_is_refused(
    gear: Gear, targets: tuple[Target, ...]
) -> None:
    with pytest.raises(UsageError):
        free = tuple(msgspec.structs.replace(t, search=False) for t in targets)
        reconstruct(gear, free, np.random.default_rng(0), 0)


@pytest.mark.slow
def test_a_linkage_is_found_from_scratch(gear: Gear, targets: tuple[Target, ...]) -> None:
    found = reconstruct(gear, targets, np.random.default_rng(1), 1, minutes=15.0)
    assert found.meets_all
