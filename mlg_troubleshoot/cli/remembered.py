"""What is remembered from run to run in ``mlg.toml``: the unit to show, the paper, how headers are
read.

Never what could change a verdict: unit of entry, convention, side or margin, nor another meaning
for a header that is understood by itself. The file is data: it is checked strictly.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import msgspec
from msgspec import Meta

from mlg_troubleshoot.cli.options import PaperSize
from mlg_troubleshoot.cli.output import say
from mlg_troubleshoot.datafile import Table, decode, read_toml
from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.units import LengthUnit

NAME = "mlg.toml"
HeaderText = Annotated[str, Meta(max_length=200)]
_TURNS_A_VERDICT = re.compile(r"unit|convention|side|margin|_(in|thou|mm)$", re.IGNORECASE)


class SettingsFile(Table):
    """What may stand in ``mlg.toml``."""

    show: LengthUnit = LengthUnit.INCH
    page: PaperSize = PaperSize.A4
    headers: dict[HeaderText, HeaderText] = msgspec.field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Settings:
    """What a run shows and how it reads headers, from flags or else from what is remembered."""

    show: LengthUnit = LengthUnit.INCH
    page: PaperSize = PaperSize.A4
    headers: Mapping[str, str] = field(default_factory=dict)
    note: str = ""


def settings(
    gear: str,
    show: str | None,
    page: PaperSize | None,
    headers: Mapping[str, str] = MappingProxyType({}),
    *,
    keep: bool = False,
) -> Settings:
    """Return the settings of a run and say what was remembered; keep what flags gave if asked to.

    The gear says which headers are understood by themselves.
    """
    if keep:
        say(f"Remembered: {_remember(gear, show, page, headers)}")
    found = _recall(gear, show, page)
    if found.note:
        # Said even where notes are not wanted: a file that happens to lie here shapes what is
        # shown.
        say(f"Note: {found.note}")
    return found


def files() -> tuple[Path, Path]:
    """Where settings may stand: in the working folder, which wins, and in the configuration."""
    from platformdirs import user_config_path

    return Path(NAME), user_config_path("mlg-troubleshoot", appauthor=False) / NAME


def _recall(gear: str, show: str | None, page: PaperSize | None) -> Settings:
    """A flag wins over the working folder, that over the user's configuration."""
    file = next((file for file in files() if file.exists()), None)
    if file is None:
        return Settings(LengthUnit.parse(show or "in"), page or PaperSize.A4)
    known = _read(file, gear)
    used = [f"lengths shown in {known.show}"] * (show is None and known.show is not LengthUnit.INCH)
    used += [f"page {known.page}"] * (page is None and known.page is not PaperSize.A4)
    used += [f"header {header!r} read as {column}" for header, column in known.headers.items()]
    return Settings(
        LengthUnit.parse(show) if show else known.show,
        page or known.page,
        known.headers,
        f"remembered in {file}: {', '.join(used)}" if used else "",
    )


def _remember(
    gear: str, show: str | None, page: PaperSize | None, headers: Mapping[str, str]
) -> Path:
    """Keep what flags said in the working folder, with what is already kept there."""
    import tomli_w

    from mlg_troubleshoot.outputs import write_text

    file = Path(NAME)
    known = _read(file, gear) if file.exists() else Settings()
    kept = {
        "show": LengthUnit.parse(show).value if show else known.show.value,
        "page": (page or known.page).value,
        "headers": {**known.headers, **headers},
    }
    _judged(file, decode(file, kept, SettingsFile), gear)
    write_text(file, tomli_w.dumps(kept))
    return file


def _read(file: Path, gear: str) -> Settings:
    try:
        found = read_toml(file, SettingsFile).content
    except GearFileError as error:
        raise UsageError(
            error.message,
            "Correct or delete it. Only show, page and headers are remembered; give the rest with"
            " each run.",
        ) from error
    return _judged(file, found, gear)


def _judged(file: Path, found: SettingsFile, gear: str) -> Settings:
    """Nothing that is remembered may change a verdict."""
    for header, column in found.headers.items():
        if _TURNS_A_VERDICT.search(column):
            raise UsageError(
                f"{file}: headers: {header!r} = {column!r} states a unit, convention, side or"
                " margin: never remembered",
                "Remember the column without its unit, as clearance_3, and give --unit with each"
                " run.",
            )
    _refuse_understood(file, found.headers, gear)
    return Settings(found.show, found.page, found.headers)


def _refuse_understood(file: Path, headers: Mapping[str, str], gear: str) -> None:
    """Refuse to remember another meaning for a header that is understood, or to drop a doubtful
    one.
    """
    if not headers:
        return
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.records import ReadOptions, why_not_remembered

    options = ReadOptions.of(load_gear(gear))
    for header, column in headers.items():
        why = why_not_remembered(header, column, options)
        if why:
            raise UsageError(
                f"{file}: headers: {header!r} = {column!r} is never remembered: by itself"
                f" {header!r} {why}, and another meaning could change a verdict",
                f'Delete the line from {file}; give --map "{header}={column}" with each run that'
                " needs it.",
            )
