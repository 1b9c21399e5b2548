"""Templates to HTML: one self-contained file, every value escaped.

What a report states of the log that it was made from: paper on which a later change shows.

What every document has: title, footer, disclaimer, assumptions, and where it comes from.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache, partial
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

import msgspec
from jinja2 import Environment, FileSystemLoader, StrictUndefined, pass_context, select_autoescape
from jinja2.runtime import Context
from markupsafe import Markup

from mlg_troubleshoot.errors import OutputError, UsageError, grouped
from mlg_troubleshoot.gear.gear import Gear, SourceKind
from mlg_troubleshoot.reporting import figures as formats
from mlg_troubleshoot.reporting.figures import Lengths
from mlg_troubleshoot.visible import unbroken, visible

# A token is letters and digits alone: it stands in HTML and in PDF as it is.
_TOKEN = re.compile(rb"mlgwitness([0-9a-f]+)")
# A report and what its token says. [bytes]
_MOST_BYTES = 100_000_000
_MOST_SAID = 10_000_000


class ReportedGear(msgspec.Struct, frozen=True):
    """A gear in a report: its newest record and, where the report is about what stands of it, the
    verdict.
    """

    tail_no: str
    side: str
    record: str
    verdict: str | None = None


class Witness(msgspec.Struct, frozen=True):
    """The log behind a report: how many records, the hash of the last one, and the gears.

    extension: what a verdict of the model with an extension rests on, which the log does not hold.
    """

    count: int
    head: str
    program: str
    geometry: str
    gears: tuple[ReportedGear, ...]
    extension: str | None = None

    @property
    def token(self) -> Markup:
        return Markup("mlgwitness" + zlib.compress(msgspec.json.encode(self), 9).hex())


def read_witness(file: Path) -> Witness:
    """Read what a report in HTML or PDF states of its log."""
    try:
        with file.open("rb") as report:
            found = _TOKEN.search(report.read(_MOST_BYTES))
        if found is None:
            raise ValueError
        press = zlib.decompressobj()
        said = press.decompress(bytes.fromhex(found[1].decode()), _MOST_SAID)
        return msgspec.json.decode(said, type=Witness)
    except OSError as error:
        raise UsageError(
            f"{file} cannot be read: {error.strerror}", "Give a report that mlg wrote."
        ) from None
    except (ValueError, zlib.error, msgspec.MsgspecError):
        raise UsageError(
            f"{file} states no log",
            "Give a report of a gear that was kept: mlg check --keep --report, or mlg history"
            " TAIL SIDE --report DIR.",
        ) from None


Facts = list[tuple[str, str]]
DISCLAIMER = (
    "Troubleshooting aid, not maintenance data.",
    "Does not replace the maintenance manual's limits.",
    "Within margin is not an approval for return to service.",
    "In-plane joint clearance only: not hydraulics, friction, doors, switches or structure.",
)


@dataclass(frozen=True, slots=True)
class ReportProvenance:
    """Program, inputs and moment behind a report.

    input_sha256: hash of the bytes of each input file by its name; empty for prompts and the
    command line.
    witness: the log that holds what is reported; None where nothing was kept.
    """

    program_version: str
    created: datetime
    geometry_sha256: str
    input_sha256: Mapping[str, str] = field(default_factory=dict)
    extension: str | None = None
    witness: Witness | None = None

    def about(self, *gear: str | None) -> ReportProvenance:
        """The provenance of the report of one gear, by tail and side, among others."""
        if self.witness is None:
            return self
        own = [each for each in self.witness.gears if (each.tail_no, each.side) == gear]
        return replace(self, witness=msgspec.structs.replace(self.witness, gears=tuple(own)))


def provenance_of(
    gear: Gear,
    input_sha256: Mapping[str, str],
    *,
    extension: str | None = None,
    witness: Witness | None = None,
) -> ReportProvenance:
    made = program_version(), moment_of_report(), gear.geometry_sha256
    return ReportProvenance(*made, dict(input_sha256), extension, witness)


@cache
def program_version() -> str:
    return version("mlg-troubleshoot")


def moment_of_report() -> datetime:
    """Return the present moment, or the one of ``SOURCE_DATE_EPOCH`` where a report must be the
    same bytes again.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH")
    if given is None:
        return datetime.now(UTC).astimezone()
    try:
        return datetime.fromtimestamp(int(given), UTC)
    except (ValueError, OverflowError, OSError):
        raise UsageError(
            f"SOURCE_DATE_EPOCH is {given!r}",
            "Set it to seconds since 1970-01-01 UTC, or leave it out.",
        ) from None


def head(
    title: str, footer: str, gear: Gear, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    """Return what the base template shows; the caller adds its own and may replace any of it."""
    return {
        "title": title,
        "footer_left": footer,
        "disclaimer": DISCLAIMER,
        "source_counts": [
            (sum(n.kind is kind for n in gear.numbers), kind.value) for kind in SourceKind
        ],
        "limits_of": sorted({(j.limit.value, j.limit.kind, j.limit.source) for j in gear.joints}),
        "alike": [
            " = ".join(map("#{}".format, pair)) for pair in gear.link_groups if len(pair) > 1
        ],
        "made": provenance,
        "lengths": lengths,
        "unit": lengths.unit.value,
        "gear": gear,
    }


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
