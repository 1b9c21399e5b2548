"""Two inspections of one gear side by side: before and after a repair."""

from __future__ import annotations

from datetime import date
from pathlib import Path

from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.workflows.check import before_and_after
from tests.cli.conftest import mlg
from tests.decision.conftest import Judge, every_joint

WORN = every_joint(0.001, j3=0.013, j5=0.007)
HEADER = "record_id,tail_no,side,clearance_convention,inspection_date," + ",".join(
    f"clearance_{n}_in" for n in range(1, 11)
)


def table(tmp_path: Path, *rows: str) -> Path:
    file = tmp_path / "two.csv"
    file.write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    return file


def row(record: str, tail: str, day: str, clearance_in: dict[int, float]) -> str:
    return ",".join(
        [record, tail, "LH", "RADIAL", day, *(str(clearance_in[n]) for n in range(1, 11))]
    )


def test_two_records_of_one_gear_are_shown_side_by_side(tmp_path: Path) -> None:
    file = table(
        tmp_path,
        row("OLD", "N1", "2024-01-01", WORN),
        row("NEW", "N1", "2024-01-03", every_joint(0.001)),
    )
    shown = mlg("check", file).out
    assert "Before and after" in shown
    assert "-0.0120" in shown


def test_two_different_gears_are_not_compared(tmp_path: Path) -> None:
    file = table(
        tmp_path,
        row("OLD", "N1", "2024-01-01", WORN),
        row("NEW", "N2", "2024-01-03", every_joint(0.001)),
    )
    assert "Before and after" not in mlg("check", file).out


def test_the_dates_decide_which_is_before(judge: Judge) -> None:
    late, early = (
        judge(every_joint(0.001), inspection_date=date(2024, 1, day), record_id=f"day {day}")
        for day in (9, 2)
    )
    assert before_and_after((late, early)) == (early, late)


def test_without_dates_the_order_of_the_table_counts(judge: Judge) -> None:
    first, second = judge(WORN, record_id="A"), judge(every_joint(0.001), record_id="B")
    assert before_and_after((first, second)) == (first, second)


def test_left_and_right_gear_are_not_compared(judge: Judge) -> None:
    assert before_and_after((judge(WORN), judge(WORN, side=Side.RH))) is None


def test_three_records_are_not_compared(judge: Judge) -> None:
    assert before_and_after((judge(WORN),) * 3) is None
