"""The rows of 200 tables with planted bad cells, as dicts, as flags and at the prompts: the
verdicts and the problems of the file.
"""

from __future__ import annotations

import re
from typing import Any

import pandas as pd
import pytest

import mlg_troubleshoot as mlg
from mlg_troubleshoot.cli.by_hand import from_flags
from mlg_troubleshoot.cli.check import Flags
from mlg_troubleshoot.cli.prompts import Entry
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from mlg_troubleshoot.workflows.check import CheckOptions, check_inspection
from tests.test_frames import as_csv, sheet

# Where a refusal stands, a joint or a column, and what was expected there; or the verdict.
Came = dict[int | str, str] | tuple[Any, ...]
OPTIONS = CheckOptions(advice=False)
TYPED = ("record_id", "tail_no", "side", "inspection_date", "gear_landings")


def came_of(result: mlg.CheckResult) -> Came:
    (row,) = result.to_dict()["inspections"]
    return row["verdict"], row["predicted_displacement_in"], row["next_action"]["text"]


def by_table(source: Any) -> Came:
    found = mlg.check(source, advice=False)
    if found.problems:
        return {place(str(p.column)): p.expected for p in found.problems}
    return came_of(found)


def place(column: str) -> int | str:
    joint = re.search(r"\d+", column)
    return int(joint[0]) if joint else column


def readings(row: pd.DataFrame) -> dict[int, str]:
    """What stands in each clearance cell, by joint."""
    cells = row.iloc[0].to_dict()
    return {
        int(name.split("_")[1]): text
        for name, text in cells.items()
        if re.match(r"clearance_\d", name)
    }


def unit_of(row: pd.DataFrame) -> str:
    return str(row.columns[-1]).rpartition("_")[2]


def by_flags(row: pd.DataFrame) -> Came:
    cells = row.iloc[0]
    given = [f"{joint}={text}" for joint, text in readings(row).items() if text]
    convention = ClearanceConvention.parse(cells["clearance_convention"])
    options = CheckOptions(unit=LengthUnit.parse(unit_of(row)), convention=convention, advice=False)
    try:
        given += [f"{name}={cells[name]}" for name in (TYPED[0], *TYPED[3:]) if cells[name]]
        read = from_flags(Flags(given, cells["tail_no"], cells["side"]), options)
    except UsageError as error:
        refused = re.findall(r"--(?:set ')?(\w+)[^:]*: expected ([^;]*)", error.message)
        return {place(flag): expected for flag, expected in refused}
    return came_of(check_inspection(read, options))


def by_prompts(row: pd.DataFrame) -> Came:
    """A row typed at the prompts; what is refused there."""
    cells, refused = row.iloc[0], dict[int | str, str]()
    gear = mlg.load_gear()
    head = {name: cells[name] for name in ("record_id", "tail_no")}
    head["clearance_convention"] = ClearanceConvention.parse(cells["clearance_convention"]).value
    entry = Entry.new(gear, head | {"unit": unit_of(row)})
    side = Side.spelt(cells["side"])
    if side is None:
        refused["side"] = "LH or RH"
    entry.give("side", side or "LH")
    for joint, text in readings(row).items():
        try:
            entry.take(gear, [(f"clearance_{joint}", text)] if text else [])
        except UsageError as error:
            (refused[joint],) = re.findall(r"expected (.*?)$", error.message)
    if refused:
        return refused
    for name in TYPED[3:]:
        entry.give(name, cells[name])
    return came_of(check_inspection(entry.inspection(gear), OPTIONS))


# A table takes 0.2 s: the everyday run takes one of ten.
TABLES = [
    pytest.param(seed, marks=() if seed % 10 == 0 else pytest.mark.slow) for seed in range(200)
]


@pytest.mark.parametrize("seed", TABLES)
def test_a_row_given_by_hand_has_the_verdict_and_the_problems_of_its_file(seed: int) -> None:
    table = sheet(seed)
    for number in range(len(table)):
        row = table.iloc[[number]]
        wanted = by_table(as_csv(row))
        assert by_table(row.iloc[0].to_dict()) == wanted
        assert by_flags(row) == wanted
        assert by_prompts(row) == wanted
