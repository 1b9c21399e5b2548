"""JSON Schemas (draft 2020-12), made from the declarations of the records that the commands write
with ``--json`` and of the files that they read.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cache, reduce
from inspect import get_annotations
from operator import or_
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.json_form import paths_of
from mlg_troubleshoot.results import SCHEMA_VERSION

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
    kinds = _kinds(name)
    roots, parts = msgspec.json.schema_components(
        [kind if name in FILES else _form(kind) for kind in kinds], ref_template="#/$defs/{name}"
    )
    if name == "check":
        roots, (row,) = roots[:1], roots[1:]
        rows = parts["CheckResult"]["properties"]["inspections"]
        invalid = {"properties": {"verdict": {"const": "INVALID"}}}
        rows["items"] = {"if": invalid, "then": row, "else": rows["items"]}
    if name == "diagnose":
        parts["DiagnoseResult"]["allOf"] = [_only("causes", "NAMED")]
        parts["DiagnoseResult"]["allOf"] += [_only("also_possible", "AMBIGUOUS")]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:mlg-troubleshoot:{name}:{SCHEMA_VERSION}",
        **(roots[0] if len(roots) == 1 else {"anyOf": list(roots)}),
        "$defs": parts,
    }


def _only(listed: str, verdict: str) -> dict[str, Any]:
    """That a list holds something with one verdict, and is empty with the others."""
    return {
        "if": {"properties": {"verdict": {"const": verdict}}},
        "then": {"properties": {listed: {"minItems": 1}}},
        "else": {"properties": {listed: {"maxItems": 0}}},
    }


def _kinds(name: str) -> list[Any]:
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
    from mlg_troubleshoot.decision.assessment import Rejected
    from mlg_troubleshoot.errors import InconclusiveDataError
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.life.forecast import LifeAhead
    from mlg_troubleshoot.paper.study import StudyFindings
    from mlg_troubleshoot.paper.verification import Verification
    from mlg_troubleshoot.workflows.check import CheckResult
    from mlg_troubleshoot.workflows.diagnose import DiagnoseResult
    from mlg_troubleshoot.workflows.history import Lives

    outputs: tuple[list[type], ...] = (
        [CheckResult, Rejected],
        [DiagnoseResult, InconclusiveDataError],
        [StudyFindings],
        [Lives],
        [Lives, LifeAhead],
        [LifeAhead],
        [Gear],
        [Verification],
    )
    return dict(zip(NAMES, outputs, strict=True))[name]


def _form(kind: Any) -> Any:
    """A type as its JSON has it: records by their names, arrays as lists of numbers."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is float or (origin is Annotated and arguments[0] is float):
        # What is not a finite number is null.
        return kind | None
    if origin is ClassVar:
        return _form(*arguments)
    # Newer NumPy names its arrays by an alias.
    alias = getattr(origin, "__value__", origin)
    if np.ndarray in (alias, get_origin(alias)):
        return list[float | None]
    if origin in (Union, UnionType):
        # What is null but for its names is described apart.
        return reduce(or_, (_form(each) for each in arguments if not hasattr(each, "json_nulls")))
    if origin not in (None, Annotated, Literal):
        return origin[tuple(each if each is Ellipsis else _form(each) for each in arguments)]
    return _record(kind) if any(hasattr(kind, name) for name in _RECORDS) else kind


# What a class has whose names stand for its values.
_RECORDS = ("json_names", "__dataclass_fields__", "__struct_fields__", "_fields")


@cache
def _record(kind: type) -> type:
    return _struct(kind.__name__, _fields_of(kind), kind.__doc__)


def _struct(name: str, types: Mapping[str, Any], doc: str | None = None) -> type:
    return msgspec.defstruct(
        name, [*types.items()], namespace={"__doc__": doc}, forbid_unknown_fields=True
    )


def _fields_of(kind: type) -> dict[str, Any]:
    """The type of each name of a record."""
    nulls = getattr(kind, "json_nulls", None)
    found: dict[str, Any] = dict.fromkeys(_fields_of(nulls) if nulls else (), NoneType)
    groups: dict[str, dict[str, Any]] = {}
    for name, path in paths_of(kind):
        of: Any = kind
        for step in path.split("."):
            of = _type_of(of, step)
        group, _, last = name.rpartition(".")
        if name == "*":
            found |= _fields_of(of)
        elif group:
            groups.setdefault(group, {})[last] = _form(of)
            found[group] = _struct(f"{kind.__name__}{group.title()}", groups[group])
        else:
            found[name] = _form(of)
    return found


def _type_of(kind: type, name: str) -> Any:
    """What stands in an attribute of a class, be it a field or a property."""
    from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension

    for each in kind.__mro__:
        if name in (own := get_annotations(each)):
            # What a workflow only names is imported when it is needed.
            named = {"Diagnosis": Diagnosis, "ModelExtension": ModelExtension}
            known = named | vars(sys.modules[each.__module__])
            said = type("", (), {"__annotations__": {name: own[name]}})
            return get_type_hints(said, known, include_extras=True)[name]
    member = getattr(kind, name)
    function = getattr(member, "fget", None) or getattr(member, "func", None)
    if function is None:
        return type(member)
    return get_type_hints(function, include_extras=True)["return"]


__all__ = ["FILES", "NAMES", "schema"]
