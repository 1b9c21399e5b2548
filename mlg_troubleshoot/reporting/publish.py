"""Documents to files: HTML always, PDF where the engine can."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.reporting.html import Document, render
from mlg_troubleshoot.reporting.pdf import PdfEngine, PdfError

FORMATS = ("html", "pdf")
PAGES = ("A4", "Letter")
_BOXES = (
    "Some characters stand as boxes in the PDF: no font on this computer has them. The HTML report"
    " has them as entered."
)
_NAME = re.compile(r"(mlg-.*|fleet)\.(html|pdf)", re.IGNORECASE)


def could_be_report(path: Path) -> bool:
    """Tell whether a file has a name that a report can have."""
    return _NAME.fullmatch(path.name) is not None


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """Files of one report.

    html, pdf: the files; None if it was not asked for, or could not be made.
    """

    html: Path | None
    pdf: Path | None
    notes: tuple[str, ...]

    @property
    def files(self) -> tuple[Path, ...]:
        return tuple(path for path in (self.html, self.pdf) if path is not None)


def safe_stem(*identity: str | None) -> str:
    """Make a file name from texts of users: readable, safe on every system, different for different
    texts.
    """
    parts = []
    for text in identity:
        plain = unicodedata.normalize("NFKD", text or "").encode("ascii", "ignore").decode("ascii")
        cleaned = re.sub(r"[^A-Za-z0-9]+", "-", plain).strip("-")[:32].strip("-")
        if cleaned:
            parts.append(cleaned)
    whole = "\x1f".join("\x00" if text is None else text for text in identity)
    mark = hashlib.sha256(whole.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return "-".join(["mlg", *parts, mark])


def publish(
    documents: Iterable[Document],
    directory: Path,
    *,
    formats: Sequence[str] = FORMATS,
    page: str = "A4",
    progress: Callable[[int], object] = lambda _done: None,
    replace_files: bool = True,
) -> list[WrittenReport]:
    """Write documents, the PDFs in one child process; files of documents that carry the same
    identity are numbered.
    """
    unknown = sorted(set(formats) - set(FORMATS))
    if unknown or page not in PAGES:
        asked, known = (unknown[0], FORMATS) if unknown else (page, PAGES)
        raise UsageError(
            f"a report cannot be written as {asked!r}", f"Give one of {', '.join(known)}."
        )
    seen: Counter[str] = Counter()
    written: list[WrittenReport] = []
    with closing(PdfEngine()) as engine:
        if "pdf" in formats:
            # The child starts while the first page is being made; if it cannot, the job says so.
            with suppress(PdfError):
                engine.start()
        for document in documents:
            seen[document.stem] += 1
            again = seen[document.stem]
            file = directory / (document.stem if again == 1 else f"{document.stem}-{again}")
            if not replace_files:
                _require_new(file)
            written.append(_written(document, file, set(formats), page, engine))
            progress(len(written))
    return written


def _require_new(file: Path) -> None:
    for kind in FORMATS:
        old = Path(os.path.realpath(file)).with_suffix(f".{kind}")
        if old.exists():
            raise UsageError(
                f"--report {old} exists: it was not replaced",
                "Give --report another folder, or --force to replace the file.",
            )


def _written(
    document: Document, file: Path, wanted: set[str], page: str, engine: PdfEngine
) -> WrittenReport:
    notes = []
    web = file.with_suffix(".html")
    paper = None
    if "pdf" in wanted:
        try:
            html = render(document, page, for_pdf=True)
            pdf, boxes = engine.convert(html, page, document.created)
            paper = file.with_suffix(".pdf")
            write_bytes(paper, pdf)
            notes += [_BOXES] * boxes
        except PdfError as error:
            instead = f"Open {web.name} in a web browser and print it"
            notes.append(f"No PDF: {error}. {instead}; it is laid out for {page} paper.")
    # What the PDF cannot show stands in the HTML.
    if "html" not in wanted and not notes:
        return WrittenReport(None, paper, ())
    write_bytes(web, render(document, page).encode("utf-8"))
    return WrittenReport(web, paper, tuple(notes))
