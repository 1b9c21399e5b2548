"""Templates to HTML: one self-contained file, every value escaped."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from mlg_troubleshoot.reporting.glyphs import breakable, font_faces, visible
from mlg_troubleshoot.reporting.resources import templates_folder


@dataclass(frozen=True, slots=True)
class Document:
    """A document to be made from a template that extends ``base.html.j2``.

    Parameters
    ----------
    template : str
        Name of the template.
    context : mapping of str to object
        What it shows; at least the keys of :class:`~mlg_troubleshoot.reporting.context.DocumentContext`.
    stem : str
        File name without its ending.
    landscape : bool
        True for wide tables.
    """

    template: str
    context: Mapping[str, Any]
    stem: str
    landscape: bool = False


@cache
def environment() -> Environment:
    """Return the template environment: everything is escaped, a missing value is an error.

    Returns
    -------
    Environment
        The environment.
    """
    made = Environment(
        loader=FileSystemLoader(templates_folder()),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        # Texts pass through here before they are escaped.
        finalize=_readable,
        auto_reload=False,
    )
    made.filters["css_string"] = css_string
    return made


def _readable(value: Any) -> Any:
    """Make a text fit to be shown; markup of this package is left as it is."""
    return value if isinstance(value, Markup) or not isinstance(value, str) else breakable(visible(value))


def css_string(text: str) -> Markup:
    """Write a text as a CSS string that can end neither itself nor the style element.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    Markup
        The string with its quotes.
    """

    def coded(match: re.Match[str]) -> str:
        return f"\\{ord(match[0]):x} "

    return Markup('"' + re.sub(r"[^0-9A-Za-z .,:·–…\u00a0-\U0010ffff]", coded, visible(text)) + '"')


@cache
def _stylesheet() -> str:
    return (templates_folder() / "report.css").read_text(encoding="utf-8")


def render(document: Document, page: str, *, for_pdf: bool = False, glyph_note: str = "") -> str:
    """Render a document.

    Parameters
    ----------
    document : Document
        Template and context.
    page : str
        Paper it is printed on: ``A4`` or ``Letter``.
    for_pdf : bool
        True to put the fonts inside and to link the headings for the bookmarks.
    glyph_note : str
        What to say about characters that the fonts lack.

    Returns
    -------
    str
        The HTML.
    """
    return (
        environment()
        .get_template(document.template)
        .render(
            **document.context,
            page=page,
            orientation="landscape" if document.landscape else "portrait",
            for_pdf=for_pdf,
            glyph_note=glyph_note,
            font_faces=Markup(font_faces()) if for_pdf else Markup(""),
            stylesheet=Markup(_stylesheet()),
        )
    )
