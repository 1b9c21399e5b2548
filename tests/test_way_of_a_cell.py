"""The way of one cell from its file to its judgement: how many functions, how many changes of room.

Neither number may grow; who lowers one lowers it here.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import mlg_troubleshoot
from mlg_troubleshoot.workflows.check import CheckOptions, check_files

MOST_FUNCTIONS = 241
MOST_CHANGES_OF_ROOM = 227
PACKAGE = str(Path(mlg_troubleshoot.__file__).parent)
TABLE = "record_id,tail_no,side,clearance_convention,clearance_3_in\nR1,N1,LH,RADIAL,0.013\n"


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> tuple[set[Any], int]:
    """The functions of the package that one reading calls, and how often a room calls another."""
    file = tmp_path_factory.mktemp("walk") / "one.csv"
    file.write_text(TABLE, encoding="utf-8")
    # What is loaded and computed once per process belongs to no cell.
    check_files([file], CheckOptions())
    functions: set[Any] = set()
    rooms: list[str] = []
    changes = 0

    def trace(frame: FrameType, event: str, _argument: Any) -> None:
        nonlocal changes
        code = frame.f_code
        if event not in ("call", "return") or not code.co_filename.startswith(PACKAGE):
            return
        if event == "return":
            if rooms:
                rooms.pop()
            return
        room = Path(code.co_filename).relative_to(PACKAGE).parts[0]
        changes += bool(rooms) and rooms[-1] != room
        rooms.append(room)
        if not code.co_name.startswith("<"):
            functions.add(code)

    sys.setprofile(trace)
    try:
        check_files([file], CheckOptions())
    finally:
        sys.setprofile(None)
    return functions, changes


def test_a_cell_passes_through_few_functions(walk):
    functions, _changes = walk
    assert len(functions) <= MOST_FUNCTIONS


def test_a_cell_changes_rooms_seldom(walk):
    _functions, changes = walk
    assert changes <= MOST_CHANGES_OF_ROOM
