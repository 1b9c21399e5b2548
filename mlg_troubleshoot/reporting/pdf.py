"""HTML to PDF in a child process with a time limit, with a check that the fonts are inside."""

from __future__ import annotations

import html as html_text
import importlib.util
import json
import re
import subprocess
import sys
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mlg_troubleshoot.reporting.html import FONT_FILES, templates_folder

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
        body = html.encode("utf-8")
        dated = created.astimezone(UTC).strftime("D:%Y%m%d%H%M%SZ")
        about = {
            "title": _found(_TITLE, html),
            "created": dated,
            "keywords": _found(_KEYWORDS, html),
        }
        job = {"length": len(body), "page": page, **about}
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
            answer: dict[str, Any] = (
                json.loads(line) if line else {"error": "it ended without an answer", "length": 0}
            )
            made = process.stdout.read(answer["length"])
        except (BrokenPipeError, ConnectionResetError, OSError) as error:
            answer = {"error": str(error), "length": 0}
            made = b""
        finally:
            timer.cancel()
        if stopped.is_set():
            self.close()
            raise PdfError(
                f"the PDF engine was stopped: it took longer than {self.time_limit_s:g} s"
            )
        if answer["error"] is not None:
            self.close()
            raise PdfError(f"the PDF engine failed: {answer['error']}")
        return made, bool(answer["boxes"])


_TITLE = re.compile(r"<title>(.*?)</title>", re.DOTALL)
_KEYWORDS = re.compile(r'<meta name="keywords" content="(\w+)">')


def _found(pattern: re.Pattern[str], html: str) -> str:
    found = pattern.search(html)
    return html_text.unescape(found[1]).strip() if found else ""
