"""What a fleet and a life say of a gear: worked out from what stands, never recalled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Run, mlg, row

from .places import table

SOUND = {f"clearance_{n}_in": "0.0011" for n in range(1, 11)}
MARGIN = "\nmargin = 0.03"
FAR = {"plunger_displacement_in": "0.06"}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    return tmp_path


def visit(name: str, day: str, **more: str) -> dict[str, str]:
    return row(**{"record_id": name, "tail_no": "N1", "inspection_date": day, **SOUND, **more})


def keep(folder: Path, *rows: dict[str, str], gear: Path | None = None) -> Run:
    more = () if gear is None else ("--gear", gear)
    return mlg("check", table(folder, *rows), "--keep", *more)


def line(gear: Path | None = None) -> Any:
    more = () if gear is None else ("--gear", gear)
    (found,) = mlg("fleet", "--json", "--no-forecast", *more).json["gears"]
    return found


def events() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = mlg("history", "N1", "LH", "--json", "--no-forecast").json[
        "events"
    ]
    return found


def test_a_repair_that_is_void_hides_nothing(place: Path) -> None:
    keep(place, visit("R0", "2026-01-01"))
    mlg("history", "repair", "N1", "LH", "--joint", "6", "--date", "2026-01-08")
    keep(place, visit("R1", "2026-01-05", **FAR))
    (repair,) = (each for each in events() if each["kind"] == "restored")
    mlg("history", "void", repair["hash"], "--why", "wrong gear")
    assert line()["verdict"] == "OUTSIDE_MARGIN"


def test_a_corrected_margin_of_the_gear_file_corrects_the_fleet(place: Path) -> None:
    shipped = Path(__file__).parents[2] / "mlg_troubleshoot" / "gear" / "data"
    for file in shipped.iterdir():
        (place / file.name).write_bytes(file.read_bytes())
    right, wide = place / "hawker-800xp.toml", place / "wide.toml"
    text = right.read_text(encoding="utf-8")
    wide.write_text(text.replace(MARGIN, MARGIN.replace("0.03", "0.07")), encoding="utf-8")
    assert wide.read_text(encoding="utf-8") != text
    worn = dict.fromkeys(SOUND, "0.004")
    keep(place, visit("R1", "2026-01-01", **worn), gear=wide)
    assert line(wide)["verdict"] == "WITHIN_MARGIN"
    assert line(right)["verdict"] == "OUTSIDE_MARGIN"


def test_a_corrected_date_puts_no_verdict_on_another_inspection(place: Path) -> None:
    first = visit("R1", "2026-01-04", gear_landings="100")
    keep(place, first)
    keep(place, visit("R1", "2026-02-04", gear_landings="900", **FAR))
    wrong = next(each for each in events() if each["date"] == "2026-01-04")
    values = ("date=2026-02-03", "landings=899")
    assert mlg("history", "amend", wrong["hash"], *values).code == 0
    assert line()["verdict"] == "OUTSIDE_MARGIN"
    said = {each["gear_landings"]: each["verdict"] for each in events() if each["verdict"]}
    assert said == {899.0: "WITHIN_MARGIN", 900.0: "OUTSIDE_MARGIN"}


def test_nothing_is_written_beside_the_store(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(place / "cache"))
    keep(place, visit("R1", "2026-01-04", gear_landings="100"))
    assert mlg("fleet").code == 0
    assert not (place / "cache" / "mlg").exists()


def test_of_two_inspections_of_one_day_the_worse_is_the_line_of_the_fleet(place: Path) -> None:
    keep(place, visit("R1", "2026-01-05", **FAR), visit("R2", "2026-01-05"))
    assert line()["verdict"] == "OUTSIDE_MARGIN"
