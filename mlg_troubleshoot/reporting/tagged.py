"""Tagged PDF/UA for screen readers, made by WeasyPrint: an extra, because that needs the Pango libraries."""

from __future__ import annotations

import logging
from typing import Any

from mlg_troubleshoot.reporting.pdf import PdfError, check_fonts

VARIANT = "pdf/ua-1"


def tagged_pdf_engine() -> tuple[bool, str]:
    """Tell whether a tagged PDF can be made here.

    Returns
    -------
    bool
        True if WeasyPrint and the libraries that it needs are there.
    str
        Its version, or what is missing.
    """
    try:
        import weasyprint
    except (ImportError, OSError) as error:
        return False, str(error).strip().splitlines()[0]
    return True, f"WeasyPrint {weasyprint.__version__}"


def make_tagged_pdf(html: str) -> bytes:
    """Make a tagged PDF with structure, reading order and alternative texts.

    Parameters
    ----------
    html : str
        The document, everything it needs inside.

    Returns
    -------
    bytes
        The PDF, which declares PDF/UA-1.

    Raises
    ------
    PdfError
        If WeasyPrint or the Pango libraries are absent, or fail.
    """
    there, why = tagged_pdf_engine()
    if not there:
        raise PdfError(
            "a tagged PDF needs WeasyPrint and the Pango libraries "
            f"(pip install 'mlg-troubleshoot[tagged]'; on Debian also libpango-1.0-0 libpangoft2-1.0-0): {why}"
        )
    import weasyprint

    # What it does not know in the stylesheet is meant for browsers.
    logging.getLogger("weasyprint").setLevel(logging.CRITICAL)
    try:
        made = weasyprint.HTML(string=html, url_fetcher=_refuse).write_pdf(pdf_variant=VARIANT)
    except (OSError, ValueError, TypeError, LookupError, ArithmeticError, AttributeError) as error:
        raise PdfError(f"WeasyPrint failed: {type(error).__name__}: {error}") from error
    pdf = bytes(made)
    check_fonts(pdf)
    return pdf


def _refuse(url: str, *_: Any, **__: Any) -> Any:
    """Fetch nothing but what stands in the document itself."""
    if not url.startswith("data:"):
        raise ValueError(f"a report may not fetch {url[:80]}")
    import weasyprint

    return weasyprint.default_url_fetcher(url)
