"""Where the templates, the stylesheet and the fonts are: in the wheel, or at the top of a clone."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from mlg_troubleshoot.errors import OutputError

FONT_FILES = {"normal": "fonts/DejaVuSans.ttf", "bold": "fonts/DejaVuSans-Bold.ttf"}


@cache
def templates_folder() -> Path:
    package = Path(str(files("mlg_troubleshoot")))
    candidates = (package / "templates", package.parent / "templates")
    for folder in candidates:
        if (folder / "base.html.j2").is_file():
            return folder
    raise OutputError(
        f"the report templates are missing: neither {candidates[0]} nor {candidates[1]} holds"
        " base.html.j2",
        "Install the package again.",
    )
