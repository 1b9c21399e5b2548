"""Text that a page can show: long words made breakable, missing glyphs distinguished."""

from __future__ import annotations

import re
import struct
import unicodedata
from functools import cache
from importlib.resources import files
from pathlib import Path, PurePath

from mlg_troubleshoot.errors import OutputError

FONT_FILES = {"normal": "fonts/DejaVuSans.ttf", "bold": "fonts/DejaVuSans-Bold.ttf"}
_PLAIN_SPACE = {"\t", "\n", "\r"}
_LONGEST_WORD = 64
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")
_SOUNDS = re.compile(r"^(?:HANGUL SYLLABLE|HIRAGANA LETTER|KATAKANA LETTER) (?:SMALL )?(.+)$")


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


def breakable(text: str) -> str:
    """Let a word that is wider than a page be broken: the PDF engine would shrink the whole page to
    fit it.
    """
    if len(text) <= _LONGEST_WORD:
        return text
    return _LONG_WORD.sub(lambda word: "\u200b".join(re.findall(".{1,32}", word[0])), text)


@cache
def font_coverage() -> frozenset[int]:
    folder = templates_folder()
    normal, bold = (_code_points((folder / name).read_bytes()) for name in FONT_FILES.values())
    return normal & bold


def _code_points(font: bytes) -> frozenset[int]:
    """Code points of a TrueType font's character map, of which the bundled ones have the full one
    (format 12).
    """
    found: set[int] = set()
    directory = font[12 : 12 + 16 * font[5]]
    tables = {tag: start for tag, _, start, _ in struct.iter_unpack(">4sIII", directory)}
    cmap = tables[b"cmap"]
    for i in range(struct.unpack_from(">H", font, cmap + 2)[0]):
        start = cmap + struct.unpack_from(">I", font, cmap + 8 + 8 * i)[0]
        if struct.unpack_from(">H", font, start)[0] == 12:
            count = struct.unpack_from(">I", font, start + 12)[0]
            for first, last, _ in struct.iter_unpack(
                ">III", font[start + 16 : start + 16 + 12 * count]
            ):
                found.update(range(first, last + 1))
    return frozenset(found)


def missing_characters(text: str) -> str:
    """Return the characters of a text that the bundled fonts cannot draw, each once, in order."""
    if text.isascii():
        return ""
    covered = font_coverage()
    return "".join(
        c for c in dict.fromkeys(text) if ord(c) not in covered and c not in _PLAIN_SPACE
    )


def spell_out(text: str, missing: str) -> str:
    """Write characters that cannot be drawn by their sound or their code: ``‹GIM-MIN-SU›``."""
    if not missing:
        return text
    run = re.compile(f"[{re.escape(missing)}]+")
    return run.sub(lambda match: "‹" + "-".join(_sound(c) for c in match[0]) + "›", text)


def _sound(character: str) -> str:
    match = _SOUNDS.match(unicodedata.name(character, ""))
    return match[1].title() if match else f"U+{ord(character):04X}"


@cache
def font_faces() -> str:
    """Return the ``@font-face`` rules of the bundled fonts, which the PDF engine knows by name."""
    return "".join(
        f"@font-face{{font-family:'Report Sans';font-weight:{weight};"
        f"src:url({PurePath(name).name}) format('truetype')}}"
        for weight, name in FONT_FILES.items()
    )
