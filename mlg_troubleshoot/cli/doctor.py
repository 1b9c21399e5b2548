"""``mlg doctor``: is this installation able to do everything?"""

from __future__ import annotations

import typer
from rich.text import Text

from mlg_troubleshoot import workflows
from mlg_troubleshoot.cli import output


def run(gear: str) -> None:
    """Show each ability with its state; exit 1 if one that should be there is not.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.
    """
    console = output.console()
    findings = workflows.examine_installation(gear)
    for finding in findings:
        mark = "ok      " if finding.works else ("MISSING " if finding.needed else "optional")
        console.print(Text(f"{mark} {finding.ability}: {finding.detail}"))
        if not finding.works and finding.remedy:
            console.print(Text(f"         What to do: {finding.remedy}"))
    raise typer.Exit(1 if any(f.needed and not f.works for f in findings) else 0)
