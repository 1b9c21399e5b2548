"""Child process that turns HTML into PDF; it imports the PDF engine and the standard library only.

It is started by its path (see :mod:`~mlg_troubleshoot.reporting.pdf`), reads jobs from standard input and
answers each on standard output: a line of JSON, then the bytes it announces.
"""

from __future__ import annotations

import io
import json
import sys
from typing import Any, BinaryIO


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer jobs until the input ends.

    Parameters
    ----------
    requests, answers : binary file
        Pipes from and to the parent.
    """
    import plutoprint

    class Refuse(plutoprint.ResourceFetcher):
        """Fetches nothing: ``data:`` URLs never get here, and nothing else is allowed."""

        def fetch_url(self, url: str) -> Any:
            raise PermissionError(f"a report may not fetch {url[:80]}")

    while line := requests.readline():
        job = json.loads(line)
        html = requests.read(job["length"]).decode("utf-8")
        try:
            book = plutoprint.Book(getattr(plutoprint, f"PAGE_SIZE_{job['page'].upper()}"))
            book.custom_resource_fetcher = Refuse()
            # Links within the document become named destinations only where the document has an address.
            book.load_html(html, base_url="https://report.invalid/")
            # Loading forgets what was set before; a date that is not given is today's, and the bytes differ.
            book.set_metadata(plutoprint.PDF_METADATA_CREATION_DATE, job["created"])
            book.set_metadata(plutoprint.PDF_METADATA_MODIFICATION_DATE, job["created"])
            stream = io.BytesIO()
            book.write_to_pdf_stream(stream)
        except (plutoprint.Error, OSError, ValueError) as error:
            answer, pdf = {"error": f"{type(error).__name__}: {error}", "length": 0}, b""
        else:
            pdf = stream.getvalue()
            answer = {"error": None, "length": len(pdf)}
        answers.write(json.dumps(answer).encode("ascii") + b"\n" + pdf)
        answers.flush()


if __name__ == "__main__":
    serve(sys.stdin.buffer, sys.stdout.buffer)
