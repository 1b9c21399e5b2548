"""Documents to files: HTML always, PDF where the engine can.

HTML to PDF in a child process with a time limit, with a check that the fonts are inside.

A figure of the reports as an object of its own: shown in a notebook, saved as a file.
"""

from __future__ import annotations

import hashlib
import html as html_text
import importlib.util
import marshal
import os
import re
import subprocess
import sys
import threading
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from markupsafe import Markup, escape

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.outputs import write_bytes, write_text
from mlg_troubleshoot.reporting.html import FONT_FILES, Document, render, templates_folder

# A page takes 0.03 to 0.1 s: what takes longer than this does not end. [s]
TIME_LIMIT_S = 30


class PdfError(Exception):
    """A PDF that could not be made, or that must not be handed out; its text is meant for the
    user.
    """


def engine_is_installed() -> bool:
    return importlib.util.find_spec("plutoprint") is not None


class PdfEngine:
    """One child process that makes PDFs, started at the first job and again after it had to be
    stopped.
    """

    def __init__(self, time_limit_s: float = TIME_LIMIT_S) -> None:
        self.time_limit_s = time_limit_s
        self._process: subprocess.Popen[bytes] | None = None

    def close(self) -> None:
        process = self._process
        self._process = None
        if process is None:
            return
        process.kill()
        process.communicate()

    def start(self) -> subprocess.Popen[bytes]:
        """Start the child process if it is not running, so that it is ready when the first job
        comes.
        """
        if not engine_is_installed():
            raise PdfError("the PDF engine plutoprint is not installed")
        if self._process is None or self._process.poll() is not None:
            fonts = [str(templates_folder() / name) for name in FONT_FILES.values()]
            # -P keeps this folder off the child's module path: html.py here would shadow the
            # standard library's.
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(Path(__file__).with_name("engine.py")), *fonts],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process

    def convert(self, html: str, page: str, created: datetime) -> tuple[bytes, bool]:
        """Make one PDF; also tell whether it shows the box that stands for a character that no font
        has.
        """
        dated = created.astimezone(UTC).strftime("D:%Y%m%d%H%M%SZ")
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
            job = html, page, _found(_TITLE, html), dated, _found(_KEYWORDS, html)
            marshal.dump(job, process.stdin)
            process.stdin.flush()
            error, made, boxes = marshal.load(process.stdout)
        except EOFError:
            error = "it ended without an answer"
        except OSError as refused:
            error = str(refused)
        finally:
            timer.cancel()
        if stopped.is_set():
            error = f"was stopped: it took longer than {self.time_limit_s:g} s"
        elif error:
            error = f"failed: {error}"
        if error:
            self.close()
            raise PdfError(f"the PDF engine {error}")
        return made, boxes


_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_KEYWORDS = re.compile(r'<meta name="keywords" content="(\w+)">')


def _found(pattern: re.Pattern[str], html: str) -> str:
    found = pattern.search(html)
    return html_text.unescape(found[1]).strip() if found else ""


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
    for asked, known in (*((each, FORMATS) for each in formats), (page, PAGES)):
        if asked not in known:
            raise UsageError(
                f"a report cannot be written as {asked!r}", f"Give one of {', '.join(known)}."
            )
    seen: Counter[str] = Counter()
    written: list[WrittenReport] = []
    standing: list[str] = []
    with closing(PdfEngine()) as engine:
        if "pdf" in formats:
            # The child starts while the first page is being made; if it cannot, the job says so.
            with suppress(PdfError):
                engine.start()
        for document in documents:
            seen[document.stem] += 1
            again = f"-{seen[document.stem]}".removesuffix("-1")
            file = directory / f"{document.stem}{again}"
            files = (os.path.realpath(f"{file}.{kind}") for kind in FORMATS)
            old = [path for path in files if Path(path).exists()]
            if old and not replace_files:
                standing += old[:1]
                continue
            written.append(_written(document, file, set(formats), page, engine))
            progress(len(written))
    if standing:
        raise UsageError(
            f"--report {', '.join(standing)} exists: it was not replaced"
            + "".join(f"\n{path} was written" for report in written for path in report.files),
            "Give --report another folder, or --force to replace the files.",
        )
    return written


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


_FONT = "DejaVu Sans, Verdana, sans-serif"
# Between two drawings of one picture. [px]
_GAP = 12


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture, as text of an SVG file.

    Parameters
    ----------
    title : str
        What it shows.
    svg : str
        The text of the file.
    width, height : float
        Its size. [px]
    """

    title: str
    svg: str
    width: float
    height: float

    @classmethod
    def of(cls, title: str, *drawings: Markup) -> Picture:
        """Put figures of a report side by side."""
        x = height = 0.0
        placed = []
        for drawing in drawings:
            wide, high = (float(_attribute(drawing, name)) for name in ("width", "height"))
            placed.append(drawing.replace("<svg ", Markup(f'<svg x="{x:g}" '), 1))
            x = x + wide + _GAP
            height = max(height, high)
        width = x - _GAP
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
            f'width="{width:g}" height="{height:g}" font-family="{_FONT}" role="img">'
            f"<title>{escape(title)}</title>{''.join(placed)}</svg>"
        )
        return cls(title, svg, width, height)

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"Picture({self.title!r}, {self.width:.0f} × {self.height:.0f})"

    def save(self, file: str | Path) -> Path:
        """Write the picture as SVG.

        Parameters
        ----------
        file : str or Path
            A name that ends in .svg.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        OutputError
            If it cannot be written, or the name ends otherwise.
        """
        path = Path(file)
        if path.suffix.lower() != ".svg":
            raise OutputError(
                f"a picture cannot be written as {path.name!r}",
                "Give a name that ends in .svg; a browser prints it.",
            )
        write_text(path, self.svg)
        return path


def _attribute(drawing: str, name: str) -> str:
    return drawing.partition(f' {name}="')[2].partition('"')[0]
