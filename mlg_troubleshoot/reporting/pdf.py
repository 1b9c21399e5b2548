"""HTML to PDF in a child process with a time limit, with bookmarks and a check that the fonts are inside."""

from __future__ import annotations

import html as html_text
import importlib.util
import json
import re
import subprocess
import sys
import threading
import zlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

TIME_LIMIT_S = 30.0


class PdfError(Exception):
    """A PDF that could not be made, or that must not be handed out; its text is meant for the user."""


def engine_is_installed() -> bool:
    """Tell whether the PDF engine can be used on this machine.

    Returns
    -------
    bool
        True if plutoprint can be imported.
    """
    return importlib.util.find_spec("plutoprint") is not None


class PdfEngine:
    """One child process that makes PDFs, started at the first job and again after it had to be stopped.

    Parameters
    ----------
    time_limit_s : float
        Longest time for one document. [s]
    """

    def __init__(self, time_limit_s: float = TIME_LIMIT_S) -> None:
        self.time_limit_s = time_limit_s
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop the child process."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.communicate()

    def start(self) -> subprocess.Popen[bytes]:
        """Start the child process if it is not running, so that it is ready when the first job comes."""
        if not engine_is_installed():
            raise PdfError("the PDF engine plutoprint is not installed")
        if self._process is None or self._process.poll() is not None:
            # -P keeps this folder off the child's module path: html.py here would shadow the standard library's.
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(Path(__file__).with_name("engine.py"))],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process

    def convert(self, html: str, page: str, created: datetime) -> bytes:
        """Make one PDF.

        Parameters
        ----------
        html : str
            The document, everything it needs inside.
        page : str
            ``A4`` or ``Letter``.
        created : datetime.datetime
            Creation date that is written into the PDF.

        Returns
        -------
        bytes
            The PDF, with bookmarks for the sections of the document.

        Raises
        ------
        PdfError
            If the engine is absent, fails, takes too long, or leaves a font out.
        """
        body = html.encode("utf-8")
        job = {"length": len(body), "page": page, "created": _iso(created)}
        process = self.start()
        if process.stdin is None or process.stdout is None:
            raise PdfError("the PDF engine has no pipes")
        stopped = threading.Event()

        def stop() -> None:
            stopped.set()
            process.kill()

        timer = threading.Timer(self.time_limit_s, stop)
        timer.start()
        try:
            process.stdin.write(json.dumps(job).encode("ascii") + b"\n" + body)
            process.stdin.flush()
            line = process.stdout.readline()
            answer: dict[str, Any] = json.loads(line) if line else {"error": "it ended without an answer", "length": 0}
            made = process.stdout.read(answer["length"])
        except (BrokenPipeError, ConnectionResetError, OSError) as error:
            answer, made = {"error": str(error), "length": 0}, b""
        finally:
            timer.cancel()
        if stopped.is_set():
            self.close()
            raise PdfError(f"the PDF engine was stopped: it took longer than {self.time_limit_s:g} s")
        if answer["error"] is not None:
            self.close()
            raise PdfError(f"the PDF engine failed: {answer['error']}")
        check_fonts(made)
        return add_outline(made, sections_of(html), title_of(html), created)


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a document, for the bookmarks.

    Parameters
    ----------
    anchor : str
        Identifier of its heading.
    title : str
        Its heading.
    """

    anchor: str
    title: str


_HEADING = re.compile(r'<h2\b[^>]*\bid="(?P<id>[a-z0-9-]+)"[^>]*><a href="#(?P=id)">(?P<text>.*?)</a></h2>', re.DOTALL)
_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)


def sections_of(html: str) -> tuple[Section, ...]:
    """Return the sections of a document made from the base template.

    Parameters
    ----------
    html : str
        The document, its headings linked to themselves.

    Returns
    -------
    tuple of Section
        Sections in the order of the document.
    """
    return tuple(
        Section(found["id"], " ".join(html_text.unescape(re.sub(r"<[^>]*>", " ", found["text"])).split()))
        for found in _HEADING.finditer(html)
    )


def title_of(html: str) -> str:
    """Return the title of a document.

    Parameters
    ----------
    html : str
        The document.

    Returns
    -------
    str
        Its title.
    """
    found = _TITLE.search(html)
    return html_text.unescape(found[1]).strip() if found else ""


def check_fonts(pdf: bytes) -> None:
    """Refuse a PDF that does not carry its fonts: without any, the engine writes blank pages and reports success.

    Parameters
    ----------
    pdf : bytes
        The PDF.

    Raises
    ------
    PdfError
        If there is no font, or one without its font file.
    """
    objects = list(_objects(pdf))
    fonts = [text for text in objects if re.search(rb"/Type\s*/FontDescriptor\b", text)]
    if not fonts:
        raise PdfError("the PDF engine drew no text: no font is embedded")
    for text in fonts:
        if not re.search(rb"/FontFile[23]?\s+\d+ 0 R", text):
            name = re.search(rb"/FontName\s*/(\S+)", text)
            raise PdfError(f"the font {name[1].decode('latin-1') if name else '?'} is not embedded in the PDF")


def has_missing_glyphs(pdf: bytes) -> bool:
    """Tell whether a PDF shows the box that stands for a character that no font has.

    Parameters
    ----------
    pdf : bytes
        The PDF.

    Returns
    -------
    bool
        True if a glyph maps to U+FFFD.
    """
    return any(b"beginbfchar" in text and b"<fffd>" in text.lower() for text in _streams(pdf))


def add_outline(pdf: bytes, sections: tuple[Section, ...], title: str, created: datetime) -> bytes:
    """Append bookmarks, language, title and dates to a PDF, as an incremental update.

    Parameters
    ----------
    pdf : bytes
        A PDF whose headings are named destinations.
    sections : tuple of Section
        The bookmarks.
    title : str
        Title shown by a viewer.
    created : datetime.datetime
        Creation date.

    Returns
    -------
    bytes
        The PDF, longer.

    Raises
    ------
    PdfError
        If the PDF is not built as the engine builds it.
    """
    end = re.search(rb"startxref\s+(\d+)\s+%%EOF\s*$", pdf)
    trailer = _dictionary_at(pdf, int(end[1])) if end else b""
    root, size = re.search(rb"/Root (\d+) 0 R", trailer), re.search(rb"/Size (\d+)", trailer)
    catalog = _find_object(pdf, int(root[1])) if root else None
    if end is None or root is None or size is None or catalog is None:
        raise PdfError("the PDF engine wrote a PDF of a kind that is not known")
    first = int(size[1])
    outline, info = first, first + 1
    entries = range(first + 2, first + 2 + len(sections))
    body = catalog.strip().removeprefix(b"<<").removesuffix(b">>").strip()
    new: dict[int, bytes] = {}
    extra = b" /Lang (en) /ViewerPreferences << /DisplayDocTitle true >>"
    if sections:
        extra += b" /PageMode /UseOutlines /Outlines %d 0 R" % outline
    new[int(root[1])] = b"<< " + body + extra + b" >>"
    if sections:
        new[outline] = b"<< /Type /Outlines /First %d 0 R /Last %d 0 R /Count %d >>" % (
            entries[0],
            entries[-1],
            len(sections),
        )
    else:
        new[outline] = b"null"
    date = _pdf_date(created)
    new[info] = b"<< /Title %s /Creator (mlg-troubleshoot) /Producer (PlutoBook, cairo) " % _pdf_text(title)
    new[info] += b"/CreationDate (%s) /ModDate (%s) >>" % (date, date)
    for n, (number, section) in enumerate(zip(entries, sections, strict=True)):
        entry = b"<< /Title %s /Parent %d 0 R" % (_pdf_text(section.title), outline)
        if n > 0:
            entry += b" /Prev %d 0 R" % (number - 1)
        if n < len(sections) - 1:
            entry += b" /Next %d 0 R" % (number + 1)
        new[number] = entry + b" /Dest (%s) >>" % section.anchor.encode("ascii")
    return _append(pdf, new, int(root[1]), info, int(end[1]))


def _append(pdf: bytes, new: dict[int, bytes], root: int, info: int, previous: int) -> bytes:
    """Append objects with a cross-reference stream, as section 7.5.6 of ISO 32000-1 has it."""
    out = bytearray(pdf if pdf.endswith(b"\n") else pdf + b"\n")
    places: dict[int, int] = {}
    for number, text in new.items():
        places[number] = len(out)
        out += b"%d 0 obj\n%s\nendobj\n" % (number, text)
    table = max(new) + 1
    places[table] = len(out)
    index = b" ".join(b"%d 1" % number for number in sorted(places))
    rows = b"".join(b"\x01" + places[n].to_bytes(4, "big") + b"\x00\x00" for n in sorted(places))
    out += b"%d 0 obj\n<< /Type /XRef /Size %d /W [1 4 2] /Index [%s] " % (table, table + 1, index)
    out += b"/Root %d 0 R /Info %d 0 R /Prev %d /Length %d >>\n" % (root, info, previous, len(rows))
    out += b"stream\n%s\nendstream\nendobj\nstartxref\n%d\n%%%%EOF\n" % (rows, places[table])
    return bytes(out)


_OBJECT = re.compile(rb"(?<![0-9])(\d+) 0 obj\b")
_STREAM = re.compile(rb"\bstream\r?\n")


def _dictionary_at(pdf: bytes, place: int) -> bytes:
    end = pdf.find(b"stream", place)
    return pdf[place : end if end > 0 else len(pdf)]


def _streams(pdf: bytes) -> list[bytes]:
    """Streams of a PDF that can be unpacked."""
    found = []
    for match in _STREAM.finditer(pdf):
        try:
            found.append(zlib.decompressobj().decompress(pdf[match.end() :]))
        except zlib.error:
            continue
    return found


def _objects(pdf: bytes) -> list[bytes]:
    """Texts of the objects outside streams, and of the object streams unpacked."""
    plain = [pdf[match.end() : match.end() + 4096].split(b"endobj", 1)[0] for match in _OBJECT.finditer(pdf)]
    packed = [text for text in _streams(pdf) if re.match(rb"\s*\d+ \d+(?:\s+\d+ \d+)*\s*<<", text)]
    return plain + packed


def _find_object(pdf: bytes, number: int) -> bytes | None:
    """Text of one object, packed or not."""
    found = re.search(rb"(?<![0-9])%d 0 obj\s*(<<.*?>>)\s*endobj" % number, pdf, re.DOTALL)
    if found:
        return found[1]
    for text in _streams(pdf):
        header = re.match(rb"\s*((?:\d+ \d+\s+)+)<<", text)
        if not header:
            continue
        pairs = [int(value) for value in header[1].split()]
        numbers, places = pairs[0::2], pairs[1::2]
        if number in numbers:
            start = header.end(1)
            k = numbers.index(number)
            stop = start + places[k + 1] if k + 1 < len(places) else len(text)
            return text[start + places[k] : stop]
    return None


def _iso(moment: datetime) -> str:
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _pdf_date(moment: datetime) -> bytes:
    return moment.astimezone(UTC).strftime("D:%Y%m%d%H%M%SZ").encode("ascii")


def _pdf_text(text: str) -> bytes:
    return b"<feff" + text.encode("utf-16-be", "replace").hex().encode("ascii") + b">"
