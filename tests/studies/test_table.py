"""The precomputed table of indices."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import (
    IndexTable,
    rank_ranges,
    ranks,
    read_index_table,
    write_index_table,
)
from mlg_troubleshoot.paper.study import StudyDesign, StudyOptions, run_study


@pytest.fixture
def elsewhere(gear: Gear, table: IndexTable, tmp_path: Path) -> Gear:
    write_index_table(table, tmp_path / "indices.json")
    return replace(gear, indices_file=tmp_path / "indices.json")


def _changed(gear: Gear, **values: object) -> None:
    raw = json.loads(gear.indices_file.read_text())
    raw["gear"].update(values)
    gear.indices_file.write_text(json.dumps(raw))


def test_the_shipped_table_is_what_the_study_gives(gear: Gear, table: IndexTable) -> None:
    again = run_study(gear, StudyOptions(design=StudyDesign.TENSOR)).table
    assert again.first_order == pytest.approx(table.first_order, abs=1e-10)
    assert again.total_order == pytest.approx(table.total_order, abs=1e-10)
    assert msgspec.structs.replace(again, joints=()) == msgspec.structs.replace(table, joints=())


def test_a_written_table_reads_back(elsewhere: Gear, table: IndexTable) -> None:
    assert read_index_table(elsewhere) == table


@pytest.mark.parametrize("what", ["id", "geometry_sha256", "ensemble_sha256"])
def test_a_table_of_another_geometry_is_refused(elsewhere: Gear, what: str) -> None:
    _changed(elsewhere, **{what: "0" * 64})
    with pytest.raises(GearFileError, match="another") as caught:
        read_index_table(elsewhere)
    assert "--write-table keeps it" in caught.value.remedy


def test_a_table_for_other_limits_is_refused(elsewhere: Gear) -> None:
    raw = json.loads(elsewhere.indices_file.read_text())
    raw["joints"][2]["limit_in"] = 0.01
    elsewhere.indices_file.write_text(json.dumps(raw))
    with pytest.raises(GearFileError, match=r"joint 3 at 0\.01 in"):
        read_index_table(elsewhere)


def test_a_missing_table_says_that_it_will_be_made(gear: Gear, tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match="missing") as caught:
        read_index_table(replace(gear, indices_file=tmp_path / "none.json"))
    assert "--write-table keeps it" in caught.value.remedy


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema_version": 99}', '{"schema_version": 1}'])
def test_a_spoilt_table_is_refused_with_a_message(elsewhere: Gear, text: str) -> None:
    elsewhere.indices_file.write_text(text)
    with pytest.raises(GearFileError) as caught:
        read_index_table(elsewhere)
    assert caught.value.remedy.startswith("Move the file away")


def test_joints_that_differ_by_less_than_1e_4_share_a_rank() -> None:
    assert ranks(np.array([0.2, 0.30002, 0.30001, 0.1])).tolist() == [3, 1, 1, 4]


def test_a_rank_range_spans_the_linkages() -> None:
    assert rank_ranges(np.array([[0.3, 0.2], [0.1, 0.2]])) == [(1, 2), (1, 2)]
