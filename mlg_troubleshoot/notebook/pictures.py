"""The picture of a result, drawn by what draws the reports."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.misfit.simulation_result import SimulationDiagnosis
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.reporting import diagnosis_figures
from mlg_troubleshoot.reporting.figures import Lengths
from mlg_troubleshoot.reporting.fleet_report import wear_figure
from mlg_troubleshoot.reporting.inspection_figures import blank_schematic, joint_key, schematic
from mlg_troubleshoot.reporting.publish import Picture
from mlg_troubleshoot.reporting.study_figures import indices_figure
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.diagnose import DiagnoseResult
from mlg_troubleshoot.workflows.history import Lives


def _linkage(result: CheckResult, row: int = 0, unit: str = "in") -> list[Markup]:
    judgement = result.judgements[row] if -1 < row < len(result.judgements) else None
    if not isinstance(judgement, Assessment):
        raise UsageError(
            f"row {row} has nothing to draw", "Give the place of a row that was judged."
        )
    clearance_in = judgement.inspection.clearance_in
    key = joint_key(result.gear, clearance_in, Lengths(LengthUnit.parse(unit)))
    return [panel for _, panel, _ in schematic(result.gear, judgement).panels] + [key]


def _unmeasured(gear: Gear) -> list[Markup]:
    drawn = blank_schematic(gear)
    return [panel for _, panel, _ in drawn.panels] + [joint_key(gear, {}, Lengths())]


def _indices(result: StudyFindings | IndexTable) -> list[Markup]:
    table = result.table if isinstance(result, StudyFindings) else result
    return [indices_figure(table)]


def _residuals(
    result: DiagnoseResult, against: str = "predicted", unit: str = "in"
) -> list[Markup]:
    shown = LengthUnit.parse(unit)
    d = result.diagnosis
    axes = diagnosis_figures.axes_of(d, result.gear.joint_numbers, shown)
    if against not in axes:
        raise UsageError(f"no column {against!r}", f"Give one of {', '.join(axes)}.")
    rows = diagnosis_figures.rows_of(d, shown)
    figures = [diagnosis_figures.residual_plot(rows, axes[against], "before")]
    if rows.fit:
        figures.append(diagnosis_figures.residual_plot(rows, axes[against], rows.fit, after=True))
    return figures


def _fit(result: SimulationDiagnosis) -> list[Markup]:
    rows = diagnosis_figures.FittedRows(
        result.measured, result.predicted, result.fitted, "fitted", "unit of the readings"
    )
    predicted = diagnosis_figures.ResidualAxis("predicted", result.predicted)
    fitted = diagnosis_figures.ResidualAxis("fitted", result.fitted)
    return [
        diagnosis_figures.measured_against_predicted(rows),
        diagnosis_figures.residual_plot(rows, predicted, "before"),
        diagnosis_figures.residual_plot(rows, fitted, "fitted", after=True),
    ]


def _life(result: Lives, tail: str = "", side: str = "", unit: str = "in") -> list[Markup]:
    for life in result.lives:
        if life.latest and tail in ("", life.key[0]) and side in ("", life.key[1]):
            ahead = result.forecasts[life.key]
            return [wear_figure(life, ahead, result.gear, Lengths(LengthUnit.parse(unit)))]
    known = ", ".join(life.name for life in result.lives[:5])
    raise UsageError(f"no gear {tail} {side}".rstrip(), f"Give one of: {known}.")


_DRAW = {
    CheckResult: _linkage,
    Gear: _unmeasured,
    StudyFindings: _indices,
    IndexTable: _indices,
    DiagnoseResult: _residuals,
    SimulationDiagnosis: _fit,
    Lives: _life,
}


def plot(result: Any, **options: Any) -> Picture:
    draw: Any = _DRAW.get(type(result))
    name = type(result).__name__
    if draw is None:
        raise UsageError(f"{name} has no picture", "Draw its table: to_frame().plot().")
    return Picture.of(name, *draw(result, **options))
