"""The last results of formulas, put back after openpyxl, which keeps either them or the formulas, has written."""

from __future__ import annotations

import io
import re
import zipfile
from html import escape

from openpyxl.worksheet._reader import FORMULA_TAG, VALUE_TAG

from mlg_troubleshoot.records.xlsx import XlsxFile, XlsxSheet

_FORMULA = re.compile(
    r'<c r="([A-Z]{1,3}\d{1,7})"((?: s="\d+")?)(?: t="\w+")?>(<f\b[^>]*(?:/>|>[^<]*</f>))<v ?(?:/>|></v>)</c>'
)


def restore_results(original: bytes, written: bytes) -> bytes:
    """Put the last results of formulas back into a copy that has lost them."""
    before = {sheet.name: sheet for sheet in XlsxFile(original).sheets}
    after = {sheet.part.lower(): sheet.name for sheet in XlsxFile(written).sheets}
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(written)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for member in old.infolist():
            content = old.read(member)
            sheet = before.get(after.get(member.filename.lower()))
            if sheet is not None and b"<f" in content:
                results = _results(sheet)
                content = _FORMULA.sub(lambda m, r=results: _with_result(m, r), content.decode()).encode()  # type: ignore[misc]
            new.writestr(member, content)
    return out.getvalue()


def _results(sheet: XlsxSheet) -> dict[str, tuple[str, str]]:
    """Return the kind and the text of every last result by its cell, as they stand in the file."""
    found = {}
    for row in sheet.elements():
        for cell in row:
            kind, result = cell.get("t", "n"), cell.findtext(VALUE_TAG)
            if result and kind != "s" and cell.find(FORMULA_TAG) is not None:
                found[cell.get("r", "")] = kind, result
    return found


def _with_result(match: re.Match[str], results: dict[str, tuple[str, str]]) -> str:
    place, style, formula = match.groups()
    if place not in results:
        return match[0]
    kind, result = results[place]
    return f'<c r="{place}"{style} t="{kind}">{formula}<v>{escape(result, quote=False)}</v></c>'
