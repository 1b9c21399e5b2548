"""Which files a command may write: checked before anything is read."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError

WRITE_TABLE = "--write-table"
_STANDARD_INPUT = "-"
Outputs = Sequence[tuple[str, str | Path | None]]


def claim(
    gear: str | None,
    inputs: Iterable[str | Path | None],
    outputs: Outputs,
    report: Path | None = None,
    *,
    store: str | None = None,
    force: bool = False,
) -> None:
    """Refuse, before anything is read, an output that would replace what it must not.

    Inputs of every command are the store, the gear file and what it names. The names of reports
    follow from what is read: here none of the inputs may have one, in the folder of the reports.
    """
    wanted = [(option, path) for option, path in outputs if path is not None]
    if not wanted and report is None:
        return
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.outputs import claim_outputs
    from mlg_troubleshoot.store import files_of

    files: list[str | Path | int] = [*files_of(store)]
    files += [path for _, path in wanted if _is_gear_file(Path(path))]
    for name in inputs:
        files += _read(name)
    if gear is not None:
        known = load_gear(gear)
        writes_table = any(option == WRITE_TABLE for option, _ in wanted)
        # The table of indices may be written again, unless it is the gear file that is named so.
        own = {known.indices_file} - {known.path} if writes_table else set()
        files += [file for file in known.files if file not in own]
    claim_outputs(files, wanted, force=force)
    if report is not None:
        claim_outputs(files, _reports(report, wanted), force=True)


def _read(name: str | Path | None) -> Sequence[str | Path | int]:
    """Return the files that an argument stands for; standard input by its descriptor."""
    from mlg_troubleshoot.records import expand

    if name is None:
        return ()
    if str(name) != _STANDARD_INPUT:
        return [Path(str(file)) for file in expand(str(name))]
    try:
        return [sys.stdin.fileno()]
    except (OSError, ValueError):
        return ()


def _is_gear_file(path: Path) -> bool:
    """Whether a gear file stands there, in use or not."""
    from mlg_troubleshoot.gear.gear_file import load_gear

    if path.suffix != ".toml" or not path.is_file():
        return False
    try:
        load_gear(str(path))
    except TroubleshootError:
        return False
    return True


def _reports(folder: Path, others: Outputs) -> Outputs:
    """Return the files of a folder that a report could replace."""
    from mlg_troubleshoot.reporting.publish import could_be_report

    real = Path(os.path.realpath(folder))
    for option, other in others:
        path = Path(os.path.realpath(str(other)))
        if could_be_report(path) and path.parent == real:
            raise UsageError(
                f"{option} {other} has the name of a report in --report {folder}",
                f"Give {option} another name.",
            )
    try:
        known = [*real.iterdir()] if real.exists() else []
    except OSError as error:
        raise OutputError(
            f"--report {folder} cannot be read: {error.strerror}",
            "Give a folder that you may read and write.",
        ) from error
    return [("--report", path) for path in known if could_be_report(path)]
