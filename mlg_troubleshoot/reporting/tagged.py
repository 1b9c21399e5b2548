"""Tagged PDF/UA for screen readers, made by WeasyPrint: an extra, because that needs the Pango libraries."""

from __future__ import annotations

import io
import logging
import warnings
from typing import Any

from mlg_troubleshoot.reporting.engine import check_fonts
from mlg_troubleshoot.reporting.pdf import PdfError

VARIANT = "pdf/ua-1"


def tagged_pdf_engine() -> tuple[bool, str]:
    try:
        # A system library that it will need one day is not a fault of this document.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            import weasyprint
    except (ImportError, OSError) as error:
        return False, str(error).strip().splitlines()[0]
    return True, f"WeasyPrint {weasyprint.__version__}"


def make_tagged_pdf(html: str) -> bytes:
    """Make a tagged PDF with structure, reading order and alternative texts."""
    there, why = tagged_pdf_engine()
    if not there:
        raise PdfError(
            "a tagged PDF needs WeasyPrint and the Pango libraries "
            f"(pip install 'mlg-troubleshoot[tagged]'; on Debian also libpango-1.0-0 libpangoft2-1.0-0): {why}"
        )
    import weasyprint
    from pypdf import PdfReader

    # What it does not know in the stylesheet is meant for browsers.
    logging.getLogger("weasyprint").setLevel(logging.CRITICAL)
    try:
        made = bytes(weasyprint.HTML(string=html, url_fetcher=_refuse).write_pdf(pdf_variant=VARIANT))
        check_fonts(PdfReader(io.BytesIO(made)))
    except (OSError, ValueError, TypeError, LookupError, ArithmeticError, AttributeError) as error:
        raise PdfError(f"WeasyPrint failed: {type(error).__name__}: {error}") from error
    return made


def _refuse(url: str, *_: Any, **__: Any) -> Any:
    """Fetch nothing but what stands in the document itself."""
    if not url.startswith("data:"):
        raise ValueError(f"a report may not fetch {url[:80]}")
    import weasyprint

    return weasyprint.default_url_fetcher(url)
