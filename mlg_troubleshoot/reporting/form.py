"""The one-page form for the shop floor: printed, filled in by hand, entered afterwards."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.html import Document, render
from mlg_troubleshoot.reporting.pdf import PdfEngine, PdfError
from mlg_troubleshoot.reporting.provenance import head, provenance_of
from mlg_troubleshoot.reporting.schematic import blank_schematic
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit


def write_form(
    file: Path, gear: Gear, *, page: str = "A4", unit: LengthUnit = LengthUnit.INCH
) -> None:
    """Write the form as PDF or HTML, as the name ends; limits stand in `unit`."""
    context = {
        **head(
            f"Joint clearances – {gear.name}",
            gear.name,
            gear,
            provenance_of(gear, {}),
            Lengths(unit),
        ),
        "conventions": tuple(ClearanceConvention),
        "drawing": blank_schematic(gear),
    }
    document = Document("form.html.j2", context, file.stem)
    if file.suffix.lower() == ".html":
        write_bytes(file, render(document, page).encode("utf-8"))
        return
    try:
        with closing(PdfEngine()) as engine:
            made, _ = engine.convert(render(document, page, for_pdf=True), page, document.created)
    except PdfError as error:
        instead = file.with_suffix(".html").name
        raise OutputError(
            f"no PDF can be made: {error}", f"Write {instead} and print it from a browser."
        ) from error
    write_bytes(file, made)
