"""``mlg doctor``: is this installation able to do everything?"""

from __future__ import annotations

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear import DEFAULT_GEAR


def doctor(
    gear: options.Gear = DEFAULT_GEAR,
    as_json: options.Json = False,
    _version: options.Version = False,
) -> None:
    """Check that every part of this installation works; exit 1 if not."""
    from mlg_troubleshoot.workflows import doctor as task

    findings = task.examine_installation(gear)
    if as_json:
        from mlg_troubleshoot.json_outputs import DoctorOutput
        from mlg_troubleshoot.reporting.json_form import written

        output.write_json(written(DoctorOutput, abilities=findings))
    else:
        output.show_page("doctor", output.console(), findings=findings)
    lacking = any(f.needed and not f.works for f in findings)
    raise typer.Exit(ExitCode.ATTENTION if lacking else ExitCode.FINE)


app = options.alone(doctor, "Example: [b]mlg doctor[/b]")
