"""Results as the documented JSON, and each list of it as a table."""

from __future__ import annotations

from textwrap import shorten
from typing import Any

import pandas as pd
from markupsafe import escape

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.records.gate import frame_of, label_of
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.history import show_fleet

# The list that a result's table is of, the first one that it has.
_MAIN = ("inspections", "gears", "suspects", "causes", "joints", "also_possible")
# What says whose a row of a list within a row is.
_WHOSE = ("record_id", "tail_no", "side")
# What a notebook shows of a result.
_SHOWN_ROWS = 4
_SHOWN_COLUMNS = 6
_SHOWN_CHARACTERS = 24
_SHOWN_WORDS = 400


def to_frame(result: Any, of: str = "") -> pd.DataFrame:
    lists = {name: rows for name, rows in result.to_dict().items() if isinstance(rows, list)}
    known = [name for name in _MAIN if name in lists]
    name = of or next((name for name in known if lists[name]), "".join(known[:1]))
    if name in lists:
        frame = _frame(lists[name])
    else:
        rows = next((lists[each] for each in known if lists[each]), [])
        within = [
            {**{key: row[key] for key in _WHOSE if key in row}, **each}
            for row in rows
            for each in row.get(name) or ()
        ]
        if name and not any(name in row for row in rows):
            raise UsageError(
                f"no table {name!r}", f"Give one of {', '.join(_tables(lists, rows))}."
            )
        frame = _frame(within) if name else pd.DataFrame(_columns(lists))
    if isinstance(result, CheckResult) and name == "inspections":
        frame.index = _index(result)
    return frame


def html(result: Any) -> str:
    """What a result says by itself and the beginning of its table, within two kilobytes: a notebook
    keeps whatever it shows.
    """
    words = (
        f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in result.to_dict().items()
        if isinstance(value, str | float)
    )
    frame = to_frame(result)
    with pd.option_context("display.max_colwidth", _SHOWN_CHARACTERS):
        table = frame.iloc[:_SHOWN_ROWS, :_SHOWN_COLUMNS].to_html(border=0)
    return (
        f"<p><b>{type(result).__name__}</b>: {escape(shorten(', '.join(words), _SHOWN_WORDS))}</p>"
        f"{table}<p>to_frame(): {frame.shape[0]} rows, {frame.shape[1]} columns</p>"
    )


def _tables(lists: dict[str, Any], rows: list[Any]) -> list[str]:
    within = [key for row in rows[:1] for key, each in row.items() if _is_table(each)]
    own = [name for name, each in lists.items() if _is_table(each)]
    return own + within


def _is_table(value: Any) -> bool:
    return isinstance(value, list) and isinstance(next(iter(value), {}), dict)


def _frame(rows: list[Any]) -> pd.DataFrame:
    """One line per row; what is a table itself has its own."""
    if not all(isinstance(row, dict) for row in rows):
        return pd.DataFrame({"value": rows})

    def bare(row: dict[str, Any]) -> dict[str, Any]:
        return {k: each for k, each in row.items() if not (each and _is_table(each))}

    return pd.json_normalize(list(map(bare, rows)))


def _columns(lists: dict[str, Any]) -> dict[str, Any]:
    """Lists of numbers, one per row of an array."""
    return {
        name: values
        for name, values in lists.items()
        if not any(isinstance(value, list | dict) for value in values)
    }


def _index(result: CheckResult) -> pd.Index[Any]:
    """The labels of the frame that the rows came from, else their place."""
    read = result.read
    if read is None or len(read.files) != 1 or not read.files[0].labels:
        return pd.RangeIndex(len(result.judgements))
    labels = read.files[0].labels
    return pd.Index([label_of(labels, judged.row.source.row) for judged in result.judgements])


def store_frame(store: Store, of: str) -> pd.DataFrame:
    """The inspections of a store that stand, or one line per gear in it."""
    if of == "lives":
        return to_frame(show_fleet(store, load_gear(DEFAULT_GEAR), ahead=False, whole=False))
    rows = [kept.inspection for life in lives(store).values() for kept in life.inspections]
    numbers = {joint for row in rows for joint in row.clearance_in}
    return frame_of(rows, Joints(tuple(sorted(numbers))))
