"""The clearances of one gear over its landings, drawn on a terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.conftest import mlg, row
from tests.store.places import table


@pytest.fixture
def drawn(tmp_path: Path) -> list[str]:
    """The lines of a gear whose joint 3 wears over its limit, is restored and wears again."""
    store = tmp_path / "store.sqlite"
    read = {1: "0.0010", 2: "0.0045", 3: "0.0090", 5: "0.0010", 6: "0.0012"}
    rows = [
        row(
            record_id=f"R{n}",
            clearance_3_in=value,
            inspection_date=f"202{n}-01-10",
            gear_landings=str(500 * n),
        )
        for n, value in read.items()
    ]
    gear = ("N123", "LH", "--store", store)
    mlg("check", table(tmp_path, *rows), "--keep", "--store", store)
    mlg("history", "repair", *gear, "--joint", "3", "--date", "2024-01-10", "--landings", "2000")
    return mlg("history", *gear).out.splitlines()


def line_of(drawn: list[str], start: str) -> str:
    (found,) = [each for each in drawn if each.startswith(start) and "0.00" not in each]
    return found


def test_readings_stand_in_their_order_as_shares_of_the_limit(drawn: list[str]) -> None:
    assert "".join(line_of(drawn, "#3 ").split("·")[0].split()[1:]) == "▂▅!^▂▂"


def test_places_are_in_proportion_to_landings(drawn: list[str]) -> None:
    shown = line_of(drawn, "#3 ")
    first, last = shown.index("▂"), shown.rindex("▂")
    assert (last - 4) / (first - 4) == pytest.approx(3000 / 500, rel=0.1)


def test_the_forecast_stands_after_the_last_reading(drawn: list[str]) -> None:
    ahead = line_of(drawn, "#3 ").rpartition("▂")[2]
    assert set(ahead.replace(" ", "")) <= set("·?×")
    assert ahead.strip()


def test_a_joint_that_was_not_restored_has_no_sign_of_it(drawn: list[str]) -> None:
    assert "^" not in line_of(drawn, "#4 ")


def test_a_restoration_long_after_the_last_reading_stands_in_the_plot(tmp_path: Path) -> None:
    store = tmp_path / "store.sqlite"
    gear = ("N123", "LH", "--store", store)
    first = row(inspection_date="2021-01-10", gear_landings="500")
    mlg("check", table(tmp_path, first), "--keep", "--store", store)
    mlg("history", "repair", *gear, "--joint", "3", "--date", "2024-01-10", "--landings", "2000")
    assert line_of(mlg("history", *gear).out.splitlines(), "#3 ").endswith("^")


def test_a_gear_without_landings_has_no_plot(tmp_path: Path) -> None:
    store = tmp_path / "store.sqlite"
    mlg("check", table(tmp_path, row()), "--keep", "--store", store)
    assert "eighths" not in mlg("history", "N123", "LH", "--store", store).out
