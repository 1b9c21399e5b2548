"""``mlg diagnose``: measured against predicted, in seven lines."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import typer
from rich.console import Console
from rich.text import Text

from mlg_troubleshoot import workflows
from mlg_troubleshoot.cli import views
from mlg_troubleshoot.cli.progress import stages
from mlg_troubleshoot.diagnosis import Diagnosis, NamedCause

NOTHING_FOUND, SOMETHING_FOUND = 0, 1
_SHOWN = 8


def run(
    files: Sequence[str],
    options: workflows.DiagnoseOptions,
    *,
    write_extension: Path | None,
    report: Path | None,
    page: str,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run the command and leave with the exit code of the contract.

    Parameters
    ----------
    files : sequence of str
        Tables.
    options : DiagnoseOptions
        What the user declared.
    write_extension : Path or None
        Where to write the extension.
    report : Path or None
        Folder of the report.
    page : str
        Paper of the report.
    as_json : bool
        Write JSON to stdout.
    quiet : bool
        No progress and no notes.
    """
    sources: list[Path | BinaryIO] = [
        io.BytesIO(sys.stdin.buffer.read()) if name == "-" else Path(name) for name in files
    ]
    with stages(quiet=quiet) as bar:
        result = workflows.diagnose_files(sources, options, progress=lambda share: bar("Diagnosing", int(100 * share), 100))
    diagnosis = result.diagnosis
    if as_json:
        from mlg_troubleshoot.reporting.diagnosis_json import diagnosis_as_json

        typer.echo(json.dumps(diagnosis_as_json(diagnosis, result.extension), allow_nan=False, ensure_ascii=False, indent=1))
    else:
        if not quiet:
            views.show_notes(result.notes)
        views.show_problems(result.problems)
        _show(diagnosis)
    if write_extension is not None:
        if result.extension is None:
            typer.echo(f"No extension written: the verdict is {diagnosis.verdict}, no cause is named alone.", err=True)
        else:
            workflows.write_extension(result.extension, write_extension)
            typer.echo(f"Extension: {write_extension}. Use it: mlg check FILE --extension {write_extension}", err=True)
    if report is not None:
        for path in workflows.write_diagnosis_report(result, options, report, page):
            typer.echo(f"Report: {path}", err=True)
    raise typer.Exit(NOTHING_FOUND if diagnosis.verdict == "NONE" and not diagnosis.faults else SOMETHING_FOUND)


def _thou(value_in: float) -> str:
    return f"{1000.0 * value_in:.1f}"


def _show(d: Diagnosis) -> None:
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=110)

    def line(number: int, word: str, *parts: str) -> None:
        text = Text(f"{number} {word:<7}", style="bold")
        text.append(" ".join(part for part in parts if part), style="not bold")
        console.print(text)

    faults = "; ".join(
        f"row {f.row} {f.column}: {f.value}, {f.kind.replace('_', ' ')}"
        + (f", {f.suggested} used here" if f.suggested is not None else ", not used")
        for f in d.faults[:_SHOWN]
    )
    more = f" and {len(d.faults) - _SHOWN} more" if len(d.faults) > _SHOWN else ""
    untested = ", ".join(f"{cause} (no {column})" for cause, column in d.not_testable)
    line(
        1,
        "DATA",
        f"{d.rows_read} rows, {d.rows_used} used.",
        f"Most likely wrong: {faults}{more}. Repaired in this analysis only." if faults else "No data fault found.",
        f"NOT TESTABLE: {untested}." if untested else "",
    )
    gauge = (
        "repeatability unknown"
        if d.repeatability_in is None
        else f"one reading repeats to {_thou(d.repeatability_in)} thou ({d.repeatability_source})"
    )
    line(2, "MISFIT", f"measured − predicted: mean {1000 * d.mean_in:+.1f}, rms {_thou(d.rms_in)} thou; {gauge}.")
    line(3, "CAUSE", *_cause(d))
    line(4, "MODEL", _model(d))
    line(5, "GAIN", _gain(d))
    line(6, "LEFT", _left(d))
    line(7, "DO", _do(d))


def _name(c: NamedCause) -> str:
    return c.candidate.cause.words(c.candidate.target)


def _cause(d: Diagnosis) -> list[str]:
    ruled = ", ".join(f"{cause} {target or ''}".strip() for cause, target in d.ruled_out[:5])
    if d.verdict == "NONE":
        return [
            "NONE: nothing stands out beyond chance.",
            f"An effect of {_thou(d.smallest_rms_in)} thou rms would have been found 4 times in 5.",
        ]
    if d.verdict == "UNLISTED":
        return [
            f"UNLISTED: real, but not on the list; it moves with {' × '.join(d.unlisted_variables)}.",
            f"Chance if nothing is wrong: {d.remainder_p:.3g}.",
        ]
    if d.verdict == "AMBIGUOUS":
        names = "; ".join(_name(c) for c in d.also_possible)
        return [f"AMBIGUOUS: the data cannot separate: {names}."]
    named = "; ".join(
        f"{_name(c)}, {_thou(c.effect_rms_in)} thou rms (chance if nothing is wrong: {c.p_value:.3g})" for c in d.causes
    )
    return [f"NAMED: {named}.", f"Ruled out: {ruled}." if ruled else "", "Not ruled out: none."]


def _number(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _model(d: Diagnosis) -> str:
    if not d.terms:
        return "not extended." + (" Band widened instead." if d.verdict in {"UNLISTED", "AMBIGUOUS"} else "")
    parts = []
    for c in d.causes:
        for name, value in c.parameters.items():
            interval = c.interval_shown.get(name)
            band = "" if interval is None else f" (95 % {interval[0]:.4g} to {interval[1]:.4g})"
            parts.append(f"{name} {_number(value)}{band}")
    return "prediction = rigid model + " + "; ".join(parts) + "."


def _gain(d: Diagnosis) -> str:
    g = d.gain
    if g is None:
        return "none measured: the model was not extended."
    changed = ", ".join(g.verdicts_changed[:_SHOWN]) + (" …" if len(g.verdicts_changed) > _SHOWN else "")
    return (
        f"rms on rows not used for the fit {1000 * g.rms_before_in:.2f} → {1000 * g.rms_after_in:.2f} thou (held out by "
        f"{g.held_out_by}); false WITHIN {g.false_within_before} → {g.false_within_after}; false OUTSIDE "
        f"{g.false_outside_before} → {g.false_outside_after} of {d.rows_used}; side of the margin changes: {changed or 'none'}."
    )


def _left(d: Diagnosis) -> str:
    gauges = "" if d.expected_scatter_in is None else f" The gauges alone leave about {_thou(d.expected_scatter_in)} thou."
    looks = "looks like noise" if d.remainder_is_noise else "does not look like noise alone"
    return f"remainder {_thou(d.residual_u_in)} thou rms {looks} (p = {d.remainder_p:.2g}).{gauges}"


def _do(d: Diagnosis) -> str:
    if d.verdict == "NAMED":
        return "; ".join(c.candidate.cause.inspect for c in d.causes) + "."
    if d.verdict == "AMBIGUOUS":
        return f"To split them, take: {d.also_possible[0].candidate.cause.separates}."
    if d.verdict == "UNLISTED":
        return f"Record what else differs with {' and '.join(d.unlisted_variables)}; keep the model as it is."
    return "Nothing to change. More rows would find smaller effects."
