"""What is remembered from run to run in ``mlg.toml``: the unit to show, the paper, how headers are read.

Never what could turn a verdict: unit of entry, convention, side or margin. The file is data: it is checked strictly.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mlg_troubleshoot.cli.options import Page
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
    page: Page = Page.A4
    headers: Mapping[str, str] = field(default_factory=dict)
    note: str = ""


def settings(show: str | None, page: Page | None, headers: Mapping[str, str], *, keep: bool, quiet: bool) -> Settings:
    """Return the settings of a run and say what was remembered; keep what flags gave if that was asked."""
    if keep:
        say(f"Remembered: {_remember(show, page, headers)}")
    found = _recall(show, page)
    if found.note and not quiet:
        say(f"Note: {found.note}")
    return found


def _recall(show: str | None, page: Page | None) -> Settings:
    """A flag wins over the working folder, that over the user's configuration."""
    from platformdirs import user_config_path

    files = (Path(NAME), user_config_path("mlg-troubleshoot", appauthor=False) / NAME)
    file = next((file for file in files if file.exists()), None)
    if file is None:
        return Settings(LengthUnit.parse(show or "in"), page or Page.A4)
    known = _read(file)
    used = [f"lengths shown in {known.show}"] * (show is None and known.show is not LengthUnit.INCH)
    used += [f"page {known.page}"] * (page is None and known.page is not Page.A4)
    used += [f"header {header!r} read as {column}" for header, column in known.headers.items()]
    return Settings(
        LengthUnit.parse(show) if show else known.show,
        page or known.page,
        known.headers,
        f"remembered in {file}: {', '.join(used)}" if used else "",
    )


def _remember(show: str | None, page: Page | None, headers: Mapping[str, str]) -> Path:
    """Keep what flags said in the working folder, beside what is kept there already."""
    import tomli_w

    from mlg_troubleshoot.outputs import write_text

    file = Path(NAME)
    known = _read(file) if file.exists() else Settings()
    kept = {
        "show": LengthUnit.parse(show).value if show else known.show.value,
        "page": (page or known.page).value,
        "headers": {**known.headers, **headers},
    }
    _judged(file, kept)
    write_text(file, tomli_w.dumps(kept))
    return file


def _read(file: Path) -> Settings:
    if not file.is_file() or file.stat().st_size > _MOST_BYTES:
        raise UsageError(f"{file} is no file of at most {_MOST_BYTES} bytes", "Delete it, or write it anew.")
    try:
        raw = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{file} cannot be read as TOML: {str(error)[:200]}", "Mend or delete it.") from error
    return _judged(file, raw)


def _judged(file: Path, raw: Mapping[str, object]) -> Settings:
    """Check every key and value: what is remembered is data, and nothing in it may turn a verdict."""
    unknown = [key for key in raw if key not in _KEYS]
    if unknown:
        raise UsageError(
            f"{file}: {unknown[0]!r} is never remembered", f"Only {', '.join(_KEYS)} are; give the rest with each run."
        )
    headers = raw.get("headers", {})
    if not isinstance(headers, dict) or len(headers) > _MOST_HEADERS:
        raise UsageError(f"{file}: headers is no table of at most {_MOST_HEADERS} entries", "Mend or delete it.")
    for header, column in headers.items():
        texts = (header, column)
        if not all(isinstance(t, str) and len(t) <= _MOST_CHARACTERS and t.isprintable() for t in texts):
            raise UsageError(f"{file}: headers: {header!r} = {column!r} is no text", "Mend or delete it.")
        if _TURNS_A_VERDICT.search(column):
            raise UsageError(
                f"{file}: headers: {header!r} = {column!r} states a unit, convention, side or margin: never remembered",
                "Remember the column without its unit, as clearance_3, and give --unit with each run.",
            )
    try:
        return Settings(LengthUnit(str(raw.get("show", "in"))), Page(str(raw.get("page", "A4"))), dict(headers))
    except ValueError as error:
        raise UsageError(f"{file}: {error}", "show is in, thou or mm; page is A4 or Letter.") from None
