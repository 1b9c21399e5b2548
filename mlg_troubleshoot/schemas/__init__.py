"""JSON Schemas (draft 2020-12) of what ``mlg check``, ``mlg diagnose`` and ``mlg study`` write with
``--json``.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any, Literal

from mlg_troubleshoot.errors import UsageError

NAMES = ("check", "diagnose", "study")
# Of every JSON output: raised when a name or a meaning changes.
SCHEMA_VERSION: Literal[1] = 1


def schema(name: str) -> dict[str, Any]:
    """Return the schema of a command's JSON output.

    Parameters
    ----------
    name : str
        ``check``, ``diagnose`` or ``study``.

    Returns
    -------
    dict
        The schema.

    Raises
    ------
    UsageError
        If there is no schema of that name.
    """
    if name not in NAMES:
        raise UsageError(f"there is no schema {name!r}", f"Give one of {', '.join(NAMES)}.")
    text = (files("mlg_troubleshoot.schemas") / f"{name}.schema.json").read_text(encoding="utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded


__all__ = ["NAMES", "SCHEMA_VERSION", "schema"]
