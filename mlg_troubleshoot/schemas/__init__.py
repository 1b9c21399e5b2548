"""JSON Schemas (draft 2020-12), made from the types of what the commands write with ``--json`` and
of the files that they read.
"""

from __future__ import annotations

from typing import Any

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.outputs import SCHEMA_VERSION

NAMES = (
    "check",
    "diagnose",
    "study",
    "fleet",
    "history",
    "life",
    "gear",
    "verify",
)
FILES = ("gear-file", "ensemble", "targets", "indices", "extension", "headers", "beliefs")


def schema(name: str) -> dict[str, Any]:
    """Return the schema of a command's JSON output, or of a file.

    Parameters
    ----------
    name : str
        ``check``, ``diagnose``, ``study``, ``fleet``, ``history``, ``life``, ``gear`` or
        ``verify``; of files ``gear-file``, ``ensemble``, ``targets``, ``indices``,
        ``extension``, ``headers`` or ``beliefs``.

    Returns
    -------
    dict
        The schema.

    Raises
    ------
    UsageError
        If the name is not that of a schema.
    """
    if name not in NAMES + FILES:
        known = ", ".join(NAMES + FILES)
        raise UsageError(f"there is no schema {name!r}", f"Give one of {known}.")
    import msgspec

    kinds = _kinds(name)
    roots, parts = msgspec.json.schema_components(kinds, ref_template="#/$defs/{name}")
    for part in parts.values():
        _close(part)
    if name == "check":
        row = parts["CheckedInspection"]
        joint = parts["CheckedJoint"]
        row.update(_of_an_invalid_row(row, joint))
    if name == "diagnose":
        parts["DiagnoseOutput"]["allOf"] = _by_verdict()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:mlg-troubleshoot:{name}:{SCHEMA_VERSION}",
        **(roots[0] if len(roots) == 1 else {"anyOf": list(roots)}),
        "$defs": parts,
    }


def _kinds(name: str) -> list[Any]:
    from mlg_troubleshoot import json_outputs as outputs

    if name in FILES:
        from mlg_troubleshoot.diagnosis.extension import ExtensionFile
        from mlg_troubleshoot.gear.gear_tables import EnsembleFile, GearFile
        from mlg_troubleshoot.indices.index_table import IndexTable
        from mlg_troubleshoot.paper.verification import TargetsFile
        from mlg_troubleshoot.workflows.diagnose import BeliefsFile
        from mlg_troubleshoot.workflows.header_file import HeaderFile

        files = (
            GearFile,
            EnsembleFile,
            TargetsFile,
            IndexTable,
            ExtensionFile,
            HeaderFile,
            BeliefsFile,
        )
        return [dict(zip(FILES, files, strict=True))[name]]
    kinds: dict[str, list[Any]] = {
        "diagnose": [outputs.DiagnoseOutput, outputs.NotConcluded],
        "history": [outputs.FleetOutput],
    }
    return kinds.get(name) or [getattr(outputs, f"{name.capitalize()}Output")]


def _close(part: dict[str, Any]) -> None:
    """Allow no further names in an object; the fields of a record are always written."""
    if "properties" not in part or part.get("additionalProperties") is False:
        return
    part["additionalProperties"] = False
    written = [name for name, of in part["properties"].items() if of.pop("default", part) != part]
    part["required"] = [*part["required"], *written]


def _of_an_invalid_row(row: dict[str, Any], joint: dict[str, Any]) -> dict[str, Any]:
    """Say which values of a row are null, and which are not, by its verdict."""
    null = {"type": "null"}
    identity = ("record_id", "tail_no", "side")
    of_row = {n: null for n, of in row["properties"].items() if null in of.get("anyOf", ())}
    measured = {"clearance_in", "contribution_in", "allowance_in"}
    of_joint = {n: {"not": null} for n in joint["properties"] if n not in measured}
    return {
        "if": {"properties": {"verdict": {"const": "INVALID"}}},
        "then": {
            "properties": {n: null for n in of_row if n not in identity}
            | {"end": {"const": "CORRECT"}}
        },
        "else": {
            "properties": {
                **{n: {"not": null} for n in (*identity, "margin_in", "basis")},
                "joints": {"items": {"properties": of_joint}},
            }
        },
    }


def _by_verdict() -> list[dict[str, Any]]:
    """Say which lists of causes are filled, by the verdict."""
    return [
        {
            "if": {"properties": {"verdict": {"const": verdict}}},
            "then": {"properties": {key: {"minItems": least}}},
            "else": {"properties": {key: {"maxItems": 0}}},
        }
        for verdict, key, least in (
            ("NAMED", "causes", 1),
            ("AMBIGUOUS", "also_possible", 2),
            ("NAMED", "beside", 0),
        )
    ]


__all__ = ["FILES", "NAMES", "schema"]
