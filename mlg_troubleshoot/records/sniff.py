"""What kind of file it is, by its first bytes, not by its name."""

from __future__ import annotations

from pathlib import PurePath

from mlg_troubleshoot.records.refusals import FileRefusedError

OLE_MAGIC = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_WORKBOOK_NAMES = frozenset((".xlsx", ".xlsm", ".xls", ".ods", ".xlsb", ".xltx", ".xltm"))
_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"GIF8", "a picture (GIF)"),
    (b"\x1f\x8b", "a compressed file (gzip)"),
    (b"7z\xbc\xaf", "a compressed file (7z)"),
    (b"Rar!", "a compressed file (RAR)"),
    (b"{\\rtf", "a text document (RTF)"),
    (b"SQLite format 3", "a database"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a program"),
)


def sniff(data: bytes, name: str) -> str:
    if not data.strip(b" \t\r\n\0\xef\xbb\xbf"):
        raise FileRefusedError(
            "file_empty", "the file holds nothing but blanks" if data else "the file is empty"
        )
    if data.startswith((b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")):
        return "zip"
    if data.startswith(OLE_MAGIC):
        return "ole"
    head = data[:2048].lstrip(b"\xef\xbb\xbf \t\r\n")
    for magic, what in _OTHERS:
        if head.startswith(magic):
            raise FileRefusedError("file_kind", what)
    low = head.lower()
    if low.startswith((b"<!doctype html", b"<html", b"<table", b"<head", b"<body")):
        raise FileRefusedError("file_kind", "a web page (HTML), whatever its name")
    if low.startswith(b"<?xml") or low.startswith(b"<workbook"):
        raise FileRefusedError("file_kind", "an XML file, whatever its name")
    suffix = PurePath(name).suffix.lower()
    if suffix in _WORKBOOK_NAMES:
        raise FileRefusedError(
            "file_kind",
            f"a text file under a workbook's name ({suffix})",
            "a workbook",
            "If it is a CSV file, rename it to .csv. Otherwise open it in a spreadsheet program and"
            " save it as .xlsx.",
        )
    return "text"
