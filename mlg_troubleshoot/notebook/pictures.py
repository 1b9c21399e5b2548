"""Pictures of results, drawn by what draws the reports."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Assessment
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.paper.study import StudyFindings
from mlg_troubleshoot.reporting import diagnosis_figures, fleet_figures
from mlg_troubleshoot.reporting.diagnosis_figures import Residuals
from mlg_troubleshoot.reporting.figures import Style
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.inspection_figures import margin_gauge, plunger_curve
from mlg_troubleshoot.reporting.picture import Picture
from mlg_troubleshoot.reporting.schematic import blank_schematic, schematic
from mlg_troubleshoot.reporting.study_figures import BarSeries, grouped_bars, release_curve
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckResult
from mlg_troubleshoot.workflows.diagnose import DiagnoseResult
from mlg_troubleshoot.workflows.history import Lives

_Draw = Callable[..., list[Markup]]


def _of_gear(draw: Callable[[Gear, Assessment, Lengths], list[Markup]]) -> _Draw:
    """A picture of one gear of a result, by its place."""

    def drawn(
        result: CheckResult | Assessment,
        *,
        row: int = 0,
        gear: Any = DEFAULT_GEAR,
        unit: str = "in",
    ) -> list[Markup]:
        lengths = Lengths(LengthUnit.parse(unit))
        if isinstance(result, Assessment):
            return draw(load_gear(gear), result, lengths)
        judgement = result.judgements[row] if -1 < row < len(result.judgements) else None
        if not isinstance(judgement, Assessment):
            raise UsageError(
                f"row {row} has nothing to draw", "Give the place of a row that was judged."
            )
        return draw(result.gear, judgement, lengths)

    return drawn


def _linkage(gear: Gear, assessment: Assessment, lengths: Lengths) -> list[Markup]:
    return [panel for _, panel, _ in schematic(gear, assessment, lengths).panels]


def _blank(gear: Gear) -> list[Markup]:
    return [panel for _, panel, _ in blank_schematic(gear).panels]


def _release(gear: Gear, *, unit: str = "in") -> list[Markup]:
    return [release_curve(gear, Lengths(LengthUnit.parse(unit)))]


def _indices(result: StudyFindings | IndexTable) -> list[Markup]:
    table = result.result.table if isinstance(result, StudyFindings) else result
    joints = table.joints
    styles: dict[str, Style] = {"first_order": "solid", "total_order": "open"}
    series = [
        BarSeries(
            name.replace("_", " "),
            np.array([getattr(joint, name) for joint in joints]),
            style,
            np.array([getattr(joint, f"{name}_interval") for joint in joints]),
        )
        for name, style in styles.items()
    ]
    said = "First-order and total-order index of each joint with its 95 % interval"
    return [grouped_bars([f"#{joint.joint}" for joint in joints], series, "Indices", said)]


def _residuals(
    result: DiagnoseResult, *, against: str = "predicted", unit: str = "in"
) -> list[Markup]:
    residuals = _rows(result, unit)
    known = residuals.columns
    if against not in known:
        raise UsageError(f"no column {against!r}", f"Give one of {', '.join(known)}.")
    column = diagnosis_figures.against_column(residuals, against)
    before = diagnosis_figures.residual_plot(residuals, column, "before")
    if not result.diagnosis.causes:
        return [before]
    after = diagnosis_figures.residual_plot(residuals, column, "with the extension", after=True)
    return [before, after]


def _scatter(result: DiagnoseResult, *, unit: str = "in") -> list[Markup]:
    return [diagnosis_figures.measured_against_predicted(_rows(result, unit))]


def _tails(result: DiagnoseResult, *, unit: str = "in") -> list[Markup]:
    return diagnosis_figures.tail_strips(_rows(result, unit))


def _rows(result: DiagnoseResult, unit: str) -> Residuals:
    return Residuals(result.diagnosis, result.gear.joint_numbers, LengthUnit.parse(unit))


def _life(result: Lives, *, tail: str = "", side: str = "", unit: str = "in") -> list[Markup]:
    wanted = [
        life
        for life in result.lives
        if life.latest and tail in ("", life.key[0]) and side in ("", life.key[1])
    ]
    if not wanted:
        known = ", ".join(life.name for life in result.lives[:5])
        raise UsageError(f"no gear {tail} {side}".rstrip(), f"Give one of: {known}.")
    life = wanted[0]
    lengths = Lengths(LengthUnit.parse(unit))
    return [fleet_figures.wear_figure(life, result.forecasts[life.key], result.gear, lengths)]


# The pictures of each result by name, the first one where no name is given.
_OF_ONE_GEAR: dict[str, _Draw] = {
    "linkage": _of_gear(_linkage),
    "stroke": _of_gear(lambda *one: [plunger_curve(*one)]),
    "margin": _of_gear(lambda _gear, *one: [*filter(None, [margin_gauge(*one)])]),
}
_PICTURES: dict[type, dict[str, _Draw]] = {
    CheckResult: _OF_ONE_GEAR,
    Assessment: _OF_ONE_GEAR,
    StudyFindings: {"indices": _indices},
    IndexTable: {"indices": _indices},
    DiagnoseResult: {"residuals": _residuals, "measured": _scatter, "tails": _tails},
    Lives: {"life": _life},
    Gear: {"linkage": _blank, "stroke": _release},
}


def plot(result: Any, name: str = "", **how: Any) -> Picture:
    known = _PICTURES.get(type(result), {})
    if not known:
        raise UsageError(
            f"{type(result).__name__} has no picture", "Draw its table: to_frame().plot()."
        )
    name = name or next(iter(known))
    if name not in known:
        raise UsageError(f"no picture {name!r}", f"Give one of {', '.join(known)}.")
    drawings = known[name](result, **how)
    if not drawings:
        raise UsageError(f"the picture {name!r} needs a linkage that closes", "")
    return Picture.of(f"{name} – {type(result).__name__}", *drawings)
