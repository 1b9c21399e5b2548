"""The shipped gear as a file of one's own, with other lines."""

from __future__ import annotations

import shutil
from pathlib import Path

from mlg_troubleshoot.gear.gear_file import load_gear


def own_gear(folder: Path, *changes: tuple[str, str], file: str = "hawker-800xp.toml") -> Path:
    """A copy of the gear and of what lies beside it, in one file of which texts are others."""
    for each in load_gear().path.parent.glob("hawker-800xp*"):
        shutil.copy(each, folder)
    text = (folder / file).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / file).write_text(text, encoding="utf-8")
    return folder / "hawker-800xp.toml"
