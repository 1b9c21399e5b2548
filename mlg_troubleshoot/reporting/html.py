"""Templates to HTML: one self-contained file, every value escaped."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cache, partial
from importlib.resources import files
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined, pass_context, select_autoescape
from jinja2.runtime import Context
from markupsafe import Markup

from mlg_troubleshoot.errors import OutputError, grouped
from mlg_troubleshoot.reporting import formats
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.visible import unbroken, visible

FONT_FILES = {"normal": "fonts/DejaVuSans.ttf", "bold": "fonts/DejaVuSans-Bold.ttf"}
_LONGEST_WORD = 64
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")


@dataclass(frozen=True, slots=True)
class Document:
    """A document of a template that extends ``base.html.j2``; its context holds at least what
    `common.head` says.

    script: of the templates' folder, for the HTML alone; what it adds is never needed to read it.
    """

    template: str
    context: Mapping[str, Any]
    stem: str
    landscape: bool = False
    script: str | None = None

    @property
    def created(self) -> datetime:
        """The moment of the document: the same input and the same moment give the same bytes."""
        made: ReportProvenance = self.context["made"]
        return made.created


@cache
def templates_folder() -> Path:
    package = Path(str(files("mlg_troubleshoot")))
    candidates = (package / "templates", package.parent / "templates")
    for folder in candidates:
        if (folder / "base.html.j2").is_file():
            return folder
    raise OutputError(
        f"the report templates are missing: neither {candidates[0]} nor {candidates[1]} holds"
        " base.html.j2",
        "Install the package again.",
    )


@cache
def environment() -> Environment:
    """Return the template environment: everything is escaped, a missing value is an error."""
    made = Environment(
        loader=FileSystemLoader(templates_folder()),
        autoescape=select_autoescape(("html.j2",)),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        # Texts pass through here before they are escaped.
        finalize=_readable,
        auto_reload=False,
    )
    made.filters.update(
        css_string=css_string,
        address=address,
        **{
            name: _in_its_unit(how)
            for name, how in (("length", "full"), ("bare", "bare"), ("said", "said"))
        },
        number=formats.number,
        percent=formats.percent,
        joints=formats.joint_list,
        several=formats.several,
        landings=formats.landings,
        minutes=formats.minutes,
        landings_count=formats.landings_count,
        grouped=grouped,
        zip=partial(zip, strict=True),
        file_name=lambda name: PurePath(name).name,
        moment=formats.moment,
    )
    return made


def _in_its_unit(how: str) -> Callable[..., str]:
    """A filter that writes a length, or says a sentence, in the unit of the document."""

    @pass_context
    def written(context: Context, value: float | str | None, *more: Any, **options: Any) -> str:
        return str(getattr(context["lengths"], how)(value, *more, **options))

    return written


def _readable(value: Any) -> Any:
    """Make a text fit to be shown; markup of this package is left as it is."""
    return (
        value
        if isinstance(value, Markup) or not isinstance(value, str)
        else breakable(unbroken(visible(value)))
    )


def breakable(text: str) -> str:
    """Let a word that is wider than a page be broken: the PDF engine would shrink the whole page to
    fit it.
    """
    if len(text) <= _LONGEST_WORD:
        return text
    return _LONG_WORD.sub(lambda word: "\u200b".join(re.findall(".{1,32}", word[0])), text)


def address(file_name: str) -> Markup:
    """Write the name of a file next to the document as a link's address, which nothing may be added
    to.
    """
    return Markup(quote(file_name, safe=""))


def css_string(text: str) -> Markup:
    """Write a text as a CSS string that can end neither itself nor the style element."""
    coded = re.sub(
        r"[^0-9A-Za-z .,:·–…\u00a0-\U0010ffff]",
        lambda found: f"\\{ord(found[0]):x} ",
        visible(text),
    )
    return Markup(f'"{coded}"')


@cache
def font_faces() -> str:
    """Return the ``@font-face`` rules of the bundled fonts, which the PDF engine knows by name."""
    return "".join(
        f"@font-face{{font-family:'Report Sans';font-weight:{weight};"
        f"src:url({PurePath(name).name}) format('truetype')}}"
        for weight, name in FONT_FILES.items()
    )


@cache
def _stylesheet() -> str:
    return (templates_folder() / "report.css").read_text(encoding="utf-8")


def _scripted(name: str | None) -> dict[str, Markup]:
    """The script of a page, and the hash by which its policy lets it run and no other."""
    text = "" if name is None else (templates_folder() / name).read_text(encoding="utf-8")
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    mark = base64.b64encode(digest).decode("ascii")
    return {"script": Markup(text), "script_hash": Markup(mark)}


def render(document: Document, page: str, *, for_pdf: bool = False) -> str:
    return (
        environment()
        .get_template(document.template)
        .render(
            **document.context,
            page=page,
            orientation="landscape" if document.landscape else "portrait",
            for_pdf=for_pdf,
            **_scripted(None if for_pdf else document.script),
            font_faces=Markup(font_faces()) if for_pdf else Markup(""),
            stylesheet=Markup(_stylesheet()),
        )
    )
