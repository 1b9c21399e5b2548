"""Results as the documented JSON, and each list of it as a table."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import shorten
from typing import Any

import pandas as pd
from markupsafe import escape

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.diagnosis import Diagnosis, SimulationDiagnosis
from mlg_troubleshoot.diagnosis.causes import Catalogue
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import WorstCase
from mlg_troubleshoot.life.folding import lives
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.records.frames import frame_of, label_of
from mlg_troubleshoot.records.headers import Joints
from mlg_troubleshoot.reporting.json_form import (
    assessment_as_json,
    check_as_json,
    diagnosis_as_json,
    gear_as_json,
    plain,
)
from mlg_troubleshoot.reporting.life_json import fleet_as_json
from mlg_troubleshoot.reporting.model_json import study_as_json
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.surveying import SurveyResult
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.diagnose import DiagnoseResult
from mlg_troubleshoot.workflows.history import Lives, show_fleet

# The list that a result's table is of, the first one that it has.
_MAIN = ("inspections", "gears", "suspects", "causes", "joints", "also_possible")
# What says whose a row of a list within a row is.
_WHOSE = ("record_id", "tail_no", "side")
# What a notebook shows of a result.
_SHOWN_ROWS = 4
_SHOWN_COLUMNS = 6
_SHOWN_CHARACTERS = 24
_SHOWN_WORDS = 400


def _catalogue_as_json(catalogue: Catalogue) -> dict[str, Any]:
    names = ("name", "needs", "parameter", "trial", "plausible", "sign", "inspect", "separates")
    return {
        "causes": [
            {"sentence": cause.words("…"), **{name: plain(getattr(cause, name)) for name in names}}
            for cause in catalogue
        ]
    }


def _worst_case_as_json(worst: WorstCase) -> dict[str, Any]:
    names = ("over_in", "under_in", "magnitude_in", "over_directions", "under_directions")
    return {name: plain(getattr(worst, name)) for name in names}


def _simulation_as_json(found: SimulationDiagnosis) -> dict[str, Any]:
    suspects = [
        {
            "name": s.name,
            "nominal": s.suspect.nominal,
            "value": s.value,
            "low": s.interval[0],
            "high": s.interval[1],
            "probability": s.probability,
            "named": s in found.named,
            "effect_rms": s.effect_rms,
            "unit": s.suspect.unit,
            "aliases": ", ".join(s.aliases),
        }
        for s in found.suspects
    ]
    return {**plain(found), "suspects": suspects}


# What has a form of its own; any other result is written as it stands.
_AS_JSON: dict[type, Callable[[Any], Any]] = {
    CheckResult: lambda r: check_as_json(r.gear, r.judgements, r.problems, r.notes),
    Assessment: assessment_as_json,
    DiagnoseResult: lambda r: diagnosis_as_json(r.diagnosis, r.extension, r.notes),
    Diagnosis: lambda r: diagnosis_as_json(r, None),
    SimulationDiagnosis: _simulation_as_json,
    SurveyResult: lambda r: plain({"numbers": r.numbers, "joints": r.joints}),
    StudyFindings: study_as_json,
    WorstCase: _worst_case_as_json,
    Gear: gear_as_json,
    Catalogue: _catalogue_as_json,
    Lives: lambda r: fleet_as_json(r.lines),
}


def to_dict(result: Any) -> dict[str, Any]:
    written: dict[str, Any] = _AS_JSON.get(type(result), plain)(result)
    return written


def to_frame(result: Any, of: str = "") -> pd.DataFrame:
    lists = {name: rows for name, rows in to_dict(result).items() if isinstance(rows, list)}
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
        for name, value in to_dict(result).items()
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
