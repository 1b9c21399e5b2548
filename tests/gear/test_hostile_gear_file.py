"""A gear file is data: nothing in it runs, and what no gear can have is refused with its place."""

from __future__ import annotations

import os
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import pytest
import tomli_w

from mlg_troubleshoot.datafile import read_json, read_toml
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.errors import GearFileError, MechanismError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.gear_tables import GearFile
from mlg_troubleshoot.geometry.mechanism import Crank, Mechanism, Output, Plane, Point
from mlg_troubleshoot.geometry.program import write_program
from mlg_troubleshoot.indices.index_table import IndexTable, TableGear
from mlg_troubleshoot.reporting.html import ReportProvenance, render
from mlg_troubleshoot.reporting.inspection_report import inspection_document
from mlg_troubleshoot.units import ClearanceConvention

# Printable and short, so that no check of names keeps them from the generators.
HOSTILE = (
    *("x = __import__('os')._exit(7)", "0;__import__('os')._exit(7)", "a\\nimport os;os._exit(7)"),
    *("</text><script>alert(1)</script>", '"onload="alert(1)', "{{7*7}}{%raw%}", "lambda:0", "p0"),
    *("t3", "s", "None", "#", "'''"),
)


def renamed(value: Any, names: dict[str, str]) -> Any:
    if isinstance(value, dict):
        return {names.get(k, k): renamed(v, names) for k, v in value.items()}
    if isinstance(value, list):
        return [renamed(v, names) for v in value]
    return names.get(value, value) if isinstance(value, str) else value


@pytest.fixture(scope="module")
def hostile(gear: Gear, tmp_path_factory: pytest.TempPathFactory) -> Gear:
    """The shipped linkage, each of its points under a hostile name."""
    raw = tomllib.loads(gear.path.read_text(encoding="utf-8"))
    names = dict(zip([p.name for p in gear.reference.mechanism.points], HOSTILE, strict=True))
    names |= {"sidestay": "<b>plane</b>", "locking pin": "<img src=x onerror=alert(1)>"}
    del raw["diagnosis"], raw["ensemble"]
    path = tmp_path_factory.mktemp("hostile") / "gear.toml"
    path.write_text(tomli_w.dumps(renamed(raw, names)), encoding="utf-8")
    return load_gear(path)


def test_hostile_names_never_become_code_in_the_program(hostile: Gear, gear: Gear) -> None:
    programs = [write_program(g.reference.mechanism) for g in (hostile, gear)]
    assert programs[0].lines == programs[1].lines
    assert programs[0].inputs == programs[1].inputs


def test_a_linkage_with_hostile_names_moves_as_the_same_linkage_with_plain_names(hostile, gear):
    assert (
        hostile.model.plunger_amplification().tolist()
        == gear.model.plunger_amplification().tolist()
    )
    x = [
        list(m.model.kernel.positions(0.3, m.model.kernel.no_clearance()).values())[-1]
        for m in (hostile, gear)
    ]
    assert x[0] == x[1]


def of_gear(table: IndexTable, gear: Gear) -> IndexTable:
    """Return a table as if it had been computed for another gear."""
    other = TableGear(gear.id, gear.geometry_sha256, gear.ensemble_sha256, gear.provenance)
    return msgspec.structs.replace(table, gear=other)


def test_hostile_names_are_text_in_the_drawing_of_a_report(hostile, table):
    gear = hostile
    own = of_gear(table, gear)
    inspection = Inspection("R", "N1", Side.LH, ClearanceConvention.RADIAL, {3: 0.013, 5: 0.007})
    (judged,) = assess([inspection], gear, own)
    told = ReportProvenance("1", datetime(2024, 5, 17, tzinfo=UTC), gear.geometry_sha256)
    html = render(inspection_document(judged, gear, told), "A4")
    assert "<script>" not in html
    assert "<img" not in html
    assert "<b>plane" not in html
    assert "&lt;b&gt;plane&lt;/b&gt;" in html


def test_two_numbers_that_names_make_alike_are_refused() -> None:
    # The lengths a-b to c and a to b-c would both be called length.a-b-c.
    points = [("a-b", 0.0, 0.0), ("c", 1.0, 0.0), ("a", 3.0, 0.0), ("b-c", 5.0, 0.0)]
    text = {
        "planes": (Plane("base"),),
        "reference_input": 0.0,
        "output": Output("angle", "c", "a-b"),
    }
    parts = tuple(Point(n, "base", x, y, fixed=n in {"a-b", "a"}) for n, x, y in points)
    with pytest.raises(MechanismError, match=r"Two numbers .* 'length.a-b-c'"):
        write_program(Mechanism(points=parts, steps=(Crank("c", "a-b"), Crank("b-c", "a")), **text))


@pytest.mark.parametrize(
    "text", ["[" * 5000 + "]" * 5000, '{"a": ' * 5000 + "1" + "}" * 5000, "1" * 5000, "[]", "3"]
)
def test_a_json_file_that_is_too_deep_or_no_table_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "x.json"
    file.write_text(text)
    with pytest.raises(GearFileError, match=r"x\.json: (cannot be read as JSON|expected names)"):
        read_json(file, IndexTable, "")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_in_place_of_a_gear_file_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "gear.toml"
    os.mkfifo(pipe)
    with pytest.raises(GearFileError, match="is not a regular file"):
        load_gear(pipe)


def test_a_folder_in_place_of_a_gear_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match="is not a regular file"):
        read_toml(tmp_path, GearFile)
