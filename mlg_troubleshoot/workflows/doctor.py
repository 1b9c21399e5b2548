"""Try what an installation must be able to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.workflows.check import (
    CheckOptions,
    check_inspection,
    trial_inspection,
    write_reports,
)
from mlg_troubleshoot.workflows.index_tables import load_index_table


@dataclass(frozen=True, slots=True)
class Ability:
    """One thing that an installation can do, or cannot; what only makes things faster or nicer is
    not needed.
    """

    ability: str
    detail: str
    works: bool
    needed: bool = True
    remedy: str = ""


def examine_installation(gear: str) -> tuple[Ability, ...]:
    """Try what an installation must be able to do: shipped tables, prediction, report, PDF with
    fonts.
    """
    import sys
    import tempfile

    from mlg_troubleshoot.geometry.kernel import numba_is_installed

    python = f"{sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}"
    found = [
        Ability(
            "Python", python, sys.version_info >= (3, 11), remedy="Install Python 3.11 or later."
        )
    ]
    try:
        loaded = load_gear(gear)
        found.append(
            Ability("gear", f"{loaded.name}, geometry {loaded.geometry_sha256[:12]}", True)
        )
        renewed: list[str] = []
        load_index_table(loaded, renewed.append)
        said = "; ".join(renewed) or "match the geometry"
        found.append(Ability("precomputed indices", said, True))
        result = check_inspection(trial_inspection(loaded), CheckOptions(gear=gear, advice=False))
        found.append(
            Ability("prediction", f"{result.counts[Verdict.OUTSIDE_MARGIN]} trial judged", True)
        )
        with tempfile.TemporaryDirectory() as folder:
            written = write_reports(result, CheckOptions(gear=gear), Path(folder))[0]
            found.append(Ability("HTML report", "written", written.html is not None))
            why = "written, fonts embedded" if written.pdf is not None else "; ".join(written.notes)
            found.append(
                Ability(
                    "PDF report",
                    why,
                    written.pdf is not None,
                    remedy="Print the HTML report instead.",
                )
            )
    except TroubleshootError as error:
        found.append(Ability("gear, tables and reports", error.message, False, remedy=error.remedy))
    speed = (
        "numba installed"
        if numba_is_installed()
        else "numba not installed: large studies run on numpy alone"
    )
    found.append(
        Ability(
            "fast kernel",
            speed,
            numba_is_installed(),
            needed=False,
            remedy="pip install 'mlg-troubleshoot[fast]'",
        )
    )
    return tuple(found)
