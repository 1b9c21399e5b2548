"""What is remembered from run to run in ``mlg.toml``: the unit to show, the paper, how headers are
read.

Never what could change a verdict: unit of entry, convention, side or margin, nor another meaning
for a header that is understood by itself. The file is data: it is checked strictly.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from mlg_troubleshoot.cli.options import PaperSize
from mlg_troubleshoot.cli.output import say
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.units import LengthUnit

NAME = "mlg.toml"
_KEYS = ("show", "page", "headers")
_MOST_BYTES, _MOST_HEADERS, _MOST_CHARACTERS = 65_536, 200, 200
_TURNS_A_VERDICT = re.compile(r"unit|convention|side|margin|_(in|thou|mm)$", re.IGNORECASE)


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
    _judged(file, kept, gear)
    write_text(file, tomli_w.dumps(kept))
    return file


def _read(file: Path, gear: str) -> Settings:
    if not file.is_file() or file.stat().st_size > _MOST_BYTES:
        raise UsageError(
            f"{file} is not a file of at most {_MOST_BYTES} bytes", "Delete it or write a new one."
        )
    try:
        raw = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(
            f"{file} cannot be read as TOML: {str(error)[:200]}", "Correct or delete it."
        ) from error
    return _judged(file, raw, gear)


def _judged(file: Path, raw: Mapping[str, object], gear: str) -> Settings:
    """Check every key and value: what is remembered is data, and nothing in it may change a
    verdict.
    """
    unknown = [key for key in raw if key not in _KEYS]
    if unknown:
        raise UsageError(
            f"{file}: {unknown[0]!r} is never remembered",
            f"Only {', '.join(_KEYS)} are; give the rest with each run.",
        )
    headers = raw.get("headers", {})
    if not isinstance(headers, dict) or len(headers) > _MOST_HEADERS:
        raise UsageError(
            f"{file}: headers is not a table of at most {_MOST_HEADERS} entries",
            "Correct or delete it.",
        )
    for header, column in headers.items():
        texts = (header, column)
        if not all(
            isinstance(t, str) and len(t) <= _MOST_CHARACTERS and t.isprintable() for t in texts
        ):
            raise UsageError(
                f"{file}: headers: {header!r} = {column!r} is not a text", "Correct or delete it."
            )
        if _TURNS_A_VERDICT.search(column):
            raise UsageError(
                f"{file}: headers: {header!r} = {column!r} states a unit, convention, side or"
                " margin: never remembered",
                "Remember the column without its unit, as clearance_3, and give --unit with each"
                " run.",
            )
    _refuse_understood(file, headers, gear)
    try:
        return Settings(
            LengthUnit(str(raw.get("show", "in"))),
            PaperSize(str(raw.get("page", "A4"))),
            dict(headers),
        )
    except ValueError as error:
        raise UsageError(
            f"{file}: {error}", "show is in, thou or mm; page is A4 or Letter."
        ) from None


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
