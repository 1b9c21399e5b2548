"""The last results of formulas, put back after a library that drops them has written the workbook."""

from __future__ import annotations

import io
import re
import zipfile
from html import escape

from mlg_troubleshoot.records.cells import Cell, OddCell, OddKind, column_letters
from mlg_troubleshoot.records.model import FileRefusedError
from mlg_troubleshoot.records.xlsx import XlsxFile

_FORMULA = re.compile(
    r'<c r="([A-Z]{1,3}\d{1,7})"((?: s="\d+")?)(?: t="\w+")?>(<f\b[^>]*(?:/>|>[^<]*</f>))<v ?(?:/>|></v>)</c>'
)


def restore_results(original: bytes, written: bytes) -> bytes:
    """Put the last results of formulas back into a copy that has lost them.

    Parameters
    ----------
    original : bytes
        The workbook that was read.
    written : bytes
        Its copy, in which formulas have no results.

    Returns
    -------
    bytes
        The copy with the results; without them, a reader would take the formulas for never calculated.
    """
    before = {sheet.name: sheet for sheet in XlsxFile(original).sheets}
    after = {sheet.part: sheet.name for sheet in XlsxFile(written).sheets}
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(written)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for member in old.infolist():
            content = old.read(member)
            name = after.get(member.filename.lower())
            if name is not None and name in before and b"<f" in content:
                try:
                    results = {
                        f"{column_letters(index)}{number}": cell
                        for number, cells in before[name].rows()
                        for index, cell in enumerate(cells)
                        if cell is not None
                    }
                except FileRefusedError:
                    results = {}
                content = _FORMULA.sub(lambda m, r=results: _with_result(m, r), content.decode()).encode()  # type: ignore[misc]
            new.writestr(member, content)
    return out.getvalue()


def _with_result(match: re.Match[str], results: dict[str, Cell]) -> str:
    cell = results.get(match[1])
    kind, text = "", None
    if isinstance(cell, float):
        text = repr(cell)
    elif isinstance(cell, str):
        kind, text = ' t="str"', escape(cell, quote=False)
    elif isinstance(cell, OddCell):
        kind, text = _odd_result(cell)
    if text is None:
        return match[0]
    return f'<c r="{match[1]}"{match[2]}{kind}>{match[3]}<v>{text}</v></c>'


def _odd_result(cell: OddCell) -> tuple[str, str | None]:
    if cell.kind is OddKind.ERROR:
        return ' t="e"', escape(cell.text, quote=False)
    if cell.kind is OddKind.BOOLEAN:
        return ' t="b"', "1" if cell.text == "TRUE" else "0"
    return "", repr(cell.number) if cell.number is not None else None
