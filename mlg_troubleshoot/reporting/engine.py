"""Child process that turns HTML into PDF, and what it does to the PDF; it imports the two PDF
libraries only.

It is started by its path (see :mod:`~mlg_troubleshoot.reporting.publish`), reads jobs from standard
input (HTML, page, title, date, keywords) and answers each on standard output (error, PDF, whether
it shows boxes). Its arguments are the fonts that a document may name.
"""

from __future__ import annotations

import io
import marshal
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

from pypdf import PdfReader, PdfWriter
from pypdf.errors import PyPdfError
from pypdf.generic import (
    ArrayObject,
    BooleanObject,
    DictionaryObject,
    NameObject,
    NumberObject,
    TextStringObject,
)

_HERE = "https://report.invalid/"


def serve(requests: BinaryIO, answers: BinaryIO, fonts: Mapping[str, bytes]) -> None:
    import plutoprint

    class OwnFonts(plutoprint.ResourceFetcher):
        """Fetches the fonts of reports and nothing else; ``data:`` URLs never get here."""

        def fetch_url(self, url: str) -> Any:
            font = fonts.get(url.removeprefix(_HERE))
            if font is not None:
                return plutoprint.ResourceData(font, "font/ttf", "")
            raise PermissionError(f"a report may not fetch {url[:80]}")

    while True:
        try:
            html, page, *about = marshal.load(requests)
        except EOFError:
            return
        try:
            size = getattr(plutoprint, f"PAGE_SIZE_{page.upper()}")
            book = plutoprint.Book(size)
            book.custom_resource_fetcher = OwnFonts()
            # A link to a file next to the document is one only where the document has an address.
            book.load_html(html, base_url=_HERE)
            stream = io.BytesIO()
            book.write_to_pdf_stream(stream)
            answer = ("", *finished(stream.getvalue(), *about))
        except (plutoprint.Error, PyPdfError, OSError, ValueError) as error:
            answer = (str(error) or type(error).__name__, b"", False)
        marshal.dump(answer, answers)
        answers.flush()


def finished(pdf: bytes, title: str, created: str, keywords: str) -> tuple[bytes, bool]:
    """Give a PDF its title, keywords, language and dates.

    Also tell whether it shows the box that stands for a character that no font has. The dates are
    those given, so that the same document always has the same bytes.
    """
    writer = PdfWriter(clone_from=io.BytesIO(pdf))
    boxes = check_fonts(writer)
    for annotation in (
        each.get_object() for page in writer.pages for each in page.get("/Annots", ())
    ):
        address = str(annotation.get("/A", {}).get("/URI", ""))
        if address.startswith(_HERE):
            # A link to a file in the same folder, which the PDF viewer opens.
            annotation[NameObject("/A")] = DictionaryObject(
                {
                    NameObject("/S"): NameObject("/GoToR"),
                    NameObject("/F"): TextStringObject(unquote(address.removeprefix(_HERE))),
                    NameObject("/D"): ArrayObject([NumberObject(0), NameObject("/Fit")]),
                }
            )
    root = writer.root_object
    root[NameObject("/Lang")] = TextStringObject("en")
    root[NameObject("/ViewerPreferences")] = DictionaryObject(
        {NameObject("/DisplayDocTitle"): BooleanObject(True)}
    )
    writer.metadata = {
        "/Title": title,
        "/Keywords": keywords,
        "/Creator": "mlg-troubleshoot",
        "/Producer": "PlutoBook, cairo",
        "/CreationDate": created,
        "/ModDate": created,
    }
    made = io.BytesIO()
    writer.write(made)
    return made.getvalue(), boxes


def check_fonts(document: PdfReader | PdfWriter) -> bool:
    """Refuse a PDF that does not carry its fonts: without any, the engine writes blank pages and
    reports success.

    Return whether a font draws the box that stands for a missing character (U+FFFD in its map to
    text).
    """
    fonts = {
        str(font.get("/BaseFont")): font
        for page in document.pages
        for font in (
            each.get_object() for each in page.get("/Resources", {}).get("/Font", {}).values()
        )
    }
    if not fonts:
        raise ValueError("it drew no text: no font is embedded")
    boxes = False
    for name, font in fonts.items():
        drawn = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
        if not {"/FontFile", "/FontFile2", "/FontFile3"} & set(drawn.get("/FontDescriptor", {})):
            raise ValueError(f"the font {name.lstrip('/')} is not embedded in the PDF")
        boxes = boxes or (
            "/ToUnicode" in font and b"<fffd>" in font["/ToUnicode"].get_data().lower()
        )
    return boxes


if __name__ == "__main__":
    files = map(Path, sys.argv[1:])
    named = {file.name: file.read_bytes() for file in files}
    serve(sys.stdin.buffer, sys.stdout.buffer, named)
