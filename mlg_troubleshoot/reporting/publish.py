"""Documents to files: HTML always, PDF where the engine can; many of them in parallel."""

from __future__ import annotations

import hashlib
import os
import queue
import re
import threading
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.reporting.glyphs import missing_characters, spell_out
from mlg_troubleshoot.reporting.html import Document, render
from mlg_troubleshoot.reporting.pdf import PdfEngine, PdfError, has_missing_glyphs
from mlg_troubleshoot.reporting.tagged import make_tagged_pdf

Progress = Callable[[int, int], None]
FORMATS = ("html", "pdf", "pdf-ua")
USUAL_FORMATS = ("html", "pdf")
PAGES = ("A4", "Letter")


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """Files of one report.

    Parameters
    ----------
    html, pdf, tagged : Path or None
        The files; None if it was not asked for, or could not be made.
    notes : tuple of str
        What the user must know about them.
    """

    html: Path | None
    pdf: Path | None
    tagged: Path | None
    notes: tuple[str, ...]

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that were written."""
        return tuple(path for path in (self.html, self.pdf, self.tagged) if path is not None)


def safe_stem(*identity: str | None) -> str:
    """Make a file name from texts of users: readable, safe on every system, different for different texts.

    Parameters
    ----------
    *identity : str or None
        The texts, for example tail, side and record.

    Returns
    -------
    str
        A name of letters, digits and hyphens that ends in a hash of the texts.
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


def write_file(path: Path, data: bytes) -> None:
    """Write a file completely or not at all.

    Parameters
    ----------
    path : Path
        The file.
    data : bytes
        Its contents.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True) if path.parent.is_dir() else None
        raise OutputError(
            f"{path} cannot be written: {error.strerror or error}",
            "Give a folder that you may write to.",
        ) from error


def publish(
    document: Document,
    directory: Path,
    *,
    formats: Sequence[str],
    page: str,
    created: datetime,
    engine: PdfEngine | None = None,
) -> WrittenReport:
    """Write one document.

    Parameters
    ----------
    document : Document
        Template, context and file name.
    directory : Path
        Folder; it is made if it is missing.
    formats : sequence of str
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged). Where no PDF can be made, the HTML is written in its place.
    page : str
        ``A4`` or ``Letter``.
    created : datetime.datetime
        Creation date of the PDF.
    engine : PdfEngine, optional
        A running engine; without one, one is started for this document.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    UsageError
        If the format or the paper is not known.
    OutputError
        If a file cannot be written.
    """
    unknown = sorted(set(formats) - set(FORMATS))
    if unknown or page not in PAGES:
        asked, known = (unknown[0], FORMATS) if unknown else (page, PAGES)
        raise UsageError(f"a report cannot be written as {asked!r}", f"Give one of {', '.join(known)}.")
    web = directory / f"{document.stem}.html"
    own = PdfEngine() if "pdf" in formats and engine is None else None
    running = engine or own
    try:
        if own is not None:
            _warm_up(own)
        html = render(document, page)
        notes: list[str] = []
        made: dict[str, Path] = {}
        if "html" in formats:
            write_file(web, html.encode("utf-8"))
            made["html"] = web
        for wanted, ending in (("pdf", ".pdf"), ("pdf-ua", "-ua.pdf")):
            if wanted not in formats:
                continue
            try:
                if wanted == "pdf" and running is not None:
                    pdf, found = _pdf(document, page, created, running)
                    notes += found
                else:
                    pdf = make_tagged_pdf(render(document, page, for_pdf=True))
            except PdfError as error:
                kind = "PDF" if wanted == "pdf" else "tagged PDF"
                instead = f"Open {web.name} in a web browser and print it; it is laid out for {page} paper."
                notes.append(f"No {kind}: {error}. {instead}")
                continue
            made[wanted] = directory / f"{document.stem}{ending}"
            write_file(made[wanted], pdf)
        if "html" not in formats and set(formats) - set(made):
            write_file(web, html.encode("utf-8"))
            made["html"] = web
        return WrittenReport(made.get("html"), made.get("pdf"), made.get("pdf-ua"), tuple(notes))
    finally:
        if own is not None:
            own.close()


def _warm_up(engine: PdfEngine) -> None:
    """Start the child while the HTML is being made; if it cannot start, the job says so."""
    try:
        engine.start()
    except PdfError:
        return


def _pdf(document: Document, page: str, created: datetime, engine: PdfEngine) -> tuple[bytes, list[str]]:
    """Make the PDF; characters that no font of this machine can draw are spelled out."""
    html = render(document, page, for_pdf=True)
    made = engine.convert(html, page, created)
    missing = missing_characters(html)
    if not missing or not has_missing_glyphs(made):
        return made, []
    note = (
        f"No font on this computer can draw {' '.join(missing[:12])}{' …' if len(missing) > 12 else ''}: "
        "they stand in the PDF by their sound or code in ‹ ›; the HTML report has them as entered."
    )
    on_paper = "Text in ‹ › stands for characters that this PDF's fonts lack; the HTML report has them as entered."
    html = render(document, page, for_pdf=True, glyph_note=on_paper)
    return engine.convert(spell_out(html, missing), page, created), [note]


def publish_all(
    documents: Iterable[Document],
    total: int,
    directory: Path,
    *,
    formats: Sequence[str],
    page: str,
    created: datetime,
    workers: int | None = None,
    progress: Progress | None = None,
) -> list[WrittenReport]:
    """Write many documents, the PDFs in several child processes.

    Parameters
    ----------
    documents : iterable of Document
        The documents; they may be made while others are being written.
    total : int
        How many there are, for the progress.
    directory : Path
        Folder.
    formats, page, created
        As for :func:`publish`.
    workers : int, optional
        Child processes; the number of processors, at most 4, if not given.
    progress : callable, optional
        Called with the number done and the total after each document.

    Returns
    -------
    list of WrittenReport
        One entry for each document, in order.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    count = max(1, workers or min(4, os.cpu_count() or 1))
    engines: queue.SimpleQueue[PdfEngine] = queue.SimpleQueue()
    started = [PdfEngine() for _ in range(count)]
    for engine in started:
        engines.put(engine)

    def one(document: Document) -> WrittenReport:
        engine = engines.get()
        try:
            return publish(document, directory, formats=formats, page=page, created=created, engine=engine)
        finally:
            engines.put(engine)

    # Documents are handed out a few at a time, so that a long batch does not stand in memory.
    ahead = threading.BoundedSemaphore(2 * count)
    written: list[Future[WrittenReport]] = []
    done = 0
    lock = threading.Lock()

    def finished(_: Future[WrittenReport]) -> None:
        nonlocal done
        ahead.release()
        with lock:
            done += 1
            if progress is not None:
                progress(done, total)

    try:
        with ThreadPoolExecutor(count) as pool:
            try:
                for document in documents:
                    ahead.acquire()
                    future = pool.submit(one, document)
                    future.add_done_callback(finished)
                    written.append(future)
                    if any(f.done() and f.exception() for f in written[-2 * count :]):
                        break
                return [future.result() for future in written]
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
    finally:
        for engine in started:
            engine.close()
