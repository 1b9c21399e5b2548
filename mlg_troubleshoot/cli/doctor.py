"""``mlg doctor``: is this installation able to do everything?"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict

import typer
from rich.text import Text

from mlg_troubleshoot import workflows
from mlg_troubleshoot.cli import output


def run(gear: str, *, as_json: bool) -> None:
    """Show each ability with its state; exit 1 if one that should be there is not.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.
    as_json : bool
        Write JSON instead of text.
    """
    findings = workflows.examine_installation(gear)
    if as_json:
        output.write(json.dumps({"schema_version": 1, "abilities": [asdict(f) for f in findings]}, indent=1))
    else:
        _print(findings)
    raise typer.Exit(1 if any(f.needed and not f.works for f in findings) else 0)


def _print(findings: Sequence[workflows.Ability]) -> None:
    console = output.console()
    for finding in findings:
        mark = "ok      " if finding.works else ("MISSING " if finding.needed else "optional")
        console.print(Text(f"{mark} {finding.ability}: {finding.detail}"))
        if not finding.works and finding.remedy:
            console.print(Text(f"         What to do: {finding.remedy}"))
