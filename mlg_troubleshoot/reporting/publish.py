"""Documents to files: HTML always, PDF where the engine can."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.reporting.html import Document, render
from mlg_troubleshoot.reporting.pdf import PdfEngine, PdfError

Progress = Callable[[int, int], None]
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
    document: Document,
    directory: Path,
    *,
    formats: Sequence[str] = FORMATS,
    page: str = "A4",
    engine: PdfEngine | None = None,
    replace_files: bool = True,
) -> WrittenReport:
    unknown = sorted(set(formats) - set(FORMATS))
    if unknown or page not in PAGES:
        asked, known = (unknown[0], FORMATS) if unknown else (page, PAGES)
        raise UsageError(
            f"a report cannot be written as {asked!r}", f"Give one of {', '.join(known)}."
        )
    real = Path(os.path.realpath(directory))
    files = [real / f"{document.stem}.{each}" for each in FORMATS]
    old = next((file for file in files if file.exists()), None)
    if old is not None and not replace_files:
        raise UsageError(
            f"--report {old} exists: it was not replaced",
            "Give --report another folder, or --force to replace the file.",
        )
    running = engine or PdfEngine()
    wanted = set(formats)
    notes = []
    made: dict[str, Path] = {}
    web = directory / f"{document.stem}.html"
    try:
        if "pdf" in wanted:
            # The child starts while the HTML is being made; if it cannot, the job says so.
            with suppress(PdfError):
                running.start()
        if "pdf" in wanted:
            try:
                html = render(document, page, for_pdf=True)
                pdf, boxes = running.convert(html, page, document.created)
                if boxes:
                    notes.append(_BOXES)
                    wanted.add("html")
                made["pdf"] = _written(directory / f"{document.stem}.pdf", pdf)
            except PdfError as error:
                instead = f"Open {web.name} in a web browser and print it"
                notes.append(f"No PDF: {error}. {instead}; it is laid out for {page} paper.")
                wanted.add("html")
        if "html" in wanted:
            made["html"] = _written(web, render(document, page).encode("utf-8"))
        return WrittenReport(made.get("html"), made.get("pdf"), tuple(notes))
    finally:
        if engine is None:
            running.close()


def _written(file: Path, data: bytes) -> Path:
    write_bytes(file, data)
    return file


def publish_all(
    documents: Iterable[Document],
    total: int,
    directory: Path,
    *,
    formats: Sequence[str],
    page: str,
    progress: Progress | None,
    replace_files: bool = True,
) -> list[WrittenReport]:
    """Write many documents, the PDFs in one child process."""
    engine = PdfEngine()
    seen: Counter[str] = Counter()
    written: list[WrittenReport] = []
    try:
        for document in documents:
            # Files of inspections that carry the same identity are numbered: none overwrites
            # another.
            seen[document.stem] += 1
            again = seen[document.stem]
            own = document if again == 1 else replace(document, stem=f"{document.stem}-{again}")
            report = publish(
                own,
                directory,
                formats=formats,
                page=page,
                engine=engine,
                replace_files=replace_files,
            )
            written.append(report)
            if progress is not None:
                progress(len(written), total)
        return written
    finally:
        engine.close()
