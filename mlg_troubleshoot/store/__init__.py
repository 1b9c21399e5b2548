"""The records of a gear's life: an append-only, hash-chained store on SQLite or PostgreSQL."""

from mlg_troubleshoot.store.database import (
    Added,
    Broken,
    Record,
    RecordKind,
    Store,
    StoreError,
    canonical,
    files_of,
    login,
    packed,
)
from mlg_troubleshoot.store.inspections import (
    NOT_CONTENT,
    RETIRED,
    Draft,
    Drafts,
    cells_of,
    inspection_from,
    inspection_record,
    record_of,
    said_of,
)

__all__ = [
    "NOT_CONTENT",
    "RETIRED",
    "Added",
    "Broken",
    "Draft",
    "Drafts",
    "Record",
    "RecordKind",
    "Store",
    "StoreError",
    "canonical",
    "cells_of",
    "files_of",
    "inspection_from",
    "inspection_record",
    "login",
    "packed",
    "record_of",
    "said_of",
]
