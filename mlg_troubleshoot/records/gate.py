"""The gate for values that stand in no file: flags, prompts and Python fill a row for the judge of
rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from numbers import Real

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    COLUMNS,
    CONVENTION,
    GAUGE_U,
    IDENTITY,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RowSource,
)
from mlg_troubleshoot.errors import Problem, UsageError
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.records.cells import typed
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.records.rows import ReadOptions, Row, RowReader, TableInHand
from mlg_troubleshoot.records.tables import Columns, Header
from mlg_troubleshoot.records.values import CellFaultError, read_text
from mlg_troubleshoot.units import LengthUnit

# Who and which gear a value is judged for before that is known.
NOBODY = {RECORD_ID.name: "0", TAIL_NO.name: "0", SIDE.name: "LH"}


def judge_row(
    values: Mapping[str, object], options: ReadOptions
) -> tuple[Inspection | InvalidRow, list[Problem]]:
    """Judge values by column name as a table with these headers and one row would be."""
    if not any(name.startswith("clearance_") and name != CONVENTION.name for name in values):
        values = {**values, CLEARANCE.header(options.joints.numbers[0]): None}
    problems: list[Problem] = []
    table = TableInHand(
        options,
        None,
        None,
        lambda p: problems.append(replace(p, row=None, cell=None)),
    )
    columns = Columns(Header((1,), tuple(values)), table)
    for p in columns.placed:
        if p.field is None and not p.refused:
            expected = "a column of the inspection table"
            table.tell("column_unknown", p.header, expected, "", p.place)
    reader = RowReader(columns.placed, table)
    rows = [reader.read(Row(1, [typed(value) for value in values.values()]))]
    reader.settle_dates(rows)
    return replace(rows[0], source=RowSource()), problems


def admit(
    values: Mapping[str, object], options: ReadOptions, labels: Mapping[str, str] | None = None
) -> Inspection:
    """Return the inspection that the values make, or raise what a table would call a problem."""
    read, problems = judge_row(values, options)
    if problems or isinstance(read, InvalidRow):
        said = [f"{_label(p, labels or {})}: expected {p.expected}" for p in problems]
        remedies = dict.fromkeys(p.remedy for p in problems if p.remedy)
        raise UsageError(
            "; ".join(said) or "the values do not form an inspection", " ".join(remedies)
        )
    return read


def judge_length(
    column: str, text: str, options: ReadOptions
) -> tuple[Inspection | InvalidRow, list[Problem]]:
    """Judge one length alone, before it is known whose it is."""
    return judge_row({**NOBODY, column: text}, options)


def judge_text(label: str, text: str, remedy: str) -> None:
    """Refuse a text that is empty, or that no file can carry."""
    if not text.strip():
        raise UsageError(f"{label} is empty", remedy)
    try:
        read_text(text, "a text")
    except CellFaultError as fault:
        raise UsageError(f"{label} {text!r} is not a text", fault.remedy) from None


def made_record_id(inspection: Inspection) -> str:
    """The id of a visit that was entered by hand without one, by flags or at the prompts: its gear
    and its day.
    """
    day = inspection.inspection_date or date.today()
    return f"{inspection.tail_no}-{inspection.side}-{day:%Y%m%d}"


def judge_again(
    inspection: Inspection, options: ReadOptions, changes: Mapping[str, str] | None = None
) -> Inspection:
    """Judge an inspection made in Python, or one with other texts in some columns.

    Without `entered` its clearances and their uncertainties are readings in its convention, as in a
    table; with it they were read before and are radial. Numbers are inches.
    """
    given = inspection
    factor = given.convention.per_radial if given.entered and given.convention is not None else 1.0
    values = cells_of(given, options.joints, factor)
    required = [column.name for column in IDENTITY]
    changed = changes or {}
    stays = {
        name: value
        for name, value in values.items()
        if (value is not None or name in required) and name.removesuffix("_in") not in changed
    }
    read = admit(stays | {name: text for name, text in changed.items() if text}, options)
    kept = {n: e for n, e in given.entered.items() if CLEARANCE.header(n) not in changed}
    carried = {name: text for name, text in given.carried.items() if name not in changed}
    return replace(
        read,
        entered={n: kept.get(n, e) for n, e in read.entered.items()},
        # Numbers are inches here: what was asked about the unit of the entry stands until it is
        # confirmed.
        unit_question=(
            "" if given.small_readings_true else given.unit_question or read.unit_question
        ),
        carried={**carried, **read.carried},
        is_left=given.is_left,
        warnings=tuple(dict.fromkeys((*given.warnings, *read.warnings))),
        source=given.source,
    )


def cells_of(inspection: Inspection, joints: Joints, factor: float) -> dict[str, object]:
    """The values of an inspection by canonical column, in inches; `factor` makes readings of the
    lengths that a convention scales.
    """
    values: dict[str, object] = {}
    for column in COLUMNS:
        scale = factor if column.scales else 1.0
        if column is PLUNGER_DISPLACEMENT:
            for place, value in enumerate(inspection.readings_in, 1):
                values[column.header(place, LengthUnit.INCH)] = value
            continue
        unit = LengthUnit.INCH if column.is_length else None
        by_joint = getattr(inspection, column.joint_fills) if column.joint_fills else {}
        for joint, value in by_joint.items():
            name = column.header(joint, unit)
            if isinstance(joint, bool) or joint not in joints.numbers:
                said = f"{name}: expected a joint from {joints.span}"
                raise UsageError(said, f"T{joints.lack(joint)[1:]}.")
            values[name] = _times(value, scale)
        assumed = (
            column is GAUGE_U
            and inspection.gauge_u_is_default
            and inspection.gauge_u_in == DEFAULT_GAUGE_U_IN
        )
        if not (column.carried or column.needs_joint or assumed):
            values[column.header(unit=unit)] = _times(inspection.value(column.filled), scale)
    return values


def _times(value: object, factor: float) -> object:
    return float(value) * factor if factor != 1.0 and isinstance(value, Real) else value


def _label(problem: Problem, labels: Mapping[str, str]) -> str:
    column = problem.column or "the values"
    return labels.get(column) or (
        column if problem.value in (None, column) else f"{column}: {problem.value!r}"
    )
