"""Text that a page can show: hostile and invisible characters made visible, missing glyphs told apart."""

from __future__ import annotations

import base64
import re
import struct
import unicodedata
from functools import cache

from mlg_troubleshoot.reporting.resources import FONT_FILES, templates_folder

_PLAIN_SPACE = {"\t", "\n", "\r"}
_LONGEST_WORD = 64
_LONG_WORD = re.compile(rf"\S{{{_LONGEST_WORD + 1},}}")
_SOUNDS = re.compile(r"^(?:HANGUL SYLLABLE|HIRAGANA LETTER|KATAKANA LETTER) (?:SMALL )?(.+)$")


def visible(text: str) -> str:
    """Make characters visible that a page would swallow or that would reorder the text around them.

    Parameters
    ----------
    text : str
        Text from a user or a file.

    Returns
    -------
    str
        The text; control, direction-override, unassigned and surrogate characters stand as ``‹U+202E›``.
    """
    if text.isprintable():
        return text
    return "".join(c if _is_shown(c) else f"‹U+{ord(c):04X}›" for c in text)


def breakable(text: str) -> str:
    """Let a word that is wider than a page be broken: the PDF engine would shrink the whole page to fit it.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text, with zero-width spaces inside words of more than 64 characters.
    """
    if len(text) <= _LONGEST_WORD:
        return text
    return _LONG_WORD.sub(lambda word: "\u200b".join(re.findall(".{1,32}", word[0])), text)


def _is_shown(character: str) -> bool:
    if character in _PLAIN_SPACE or character.isprintable():
        return True
    # Joiners belong to the writing of Persian and Indic names; every other format character is shown as a code.
    return character in "\u00a0\u00ad\u200c\u200d\u202f\u2009\u3000" or unicodedata.category(character) == "Zs"


@cache
def font_coverage() -> frozenset[int]:
    """Return the code points that both bundled fonts can draw.

    Returns
    -------
    frozenset of int
        Code points.
    """
    folder = templates_folder()
    normal, bold = (_code_points((folder / name).read_bytes()) for name in FONT_FILES.values())
    return normal & bold


def _code_points(font: bytes) -> frozenset[int]:
    """Code points of a TrueType font's character map, formats 4 and 12."""
    tables = struct.unpack_from(">H", font, 4)[0]
    for i in range(tables):
        tag, _, offset, _ = struct.unpack_from(">4sIII", font, 12 + 16 * i)
        if tag == b"cmap":
            break
    else:
        return frozenset()
    found: set[int] = set()
    for i in range(struct.unpack_from(">H", font, offset + 2)[0]):
        start = offset + struct.unpack_from(">HHI", font, offset + 4 + 8 * i)[2]
        kind = struct.unpack_from(">H", font, start)[0]
        if kind == 12:
            for group in range(struct.unpack_from(">I", font, start + 12)[0]):
                first, last, _ = struct.unpack_from(">III", font, start + 16 + 12 * group)
                found.update(range(first, last + 1))
        elif kind == 4:
            n = struct.unpack_from(">H", font, start + 6)[0] // 2
            ends = struct.unpack_from(f">{n}H", font, start + 14)
            starts = struct.unpack_from(f">{n}H", font, start + 16 + 2 * n)
            for first, last in zip(starts, ends, strict=True):
                found.update(range(first, last + 1))
    found.discard(0xFFFF)
    return frozenset(found)


def missing_characters(text: str) -> str:
    """Return the characters of a text that the bundled fonts cannot draw, each once, in order.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The characters.
    """
    if text.isascii():
        return ""
    covered = font_coverage()
    return "".join(dict.fromkeys(c for c in text if ord(c) not in covered and c not in _PLAIN_SPACE))


def spell_out(text: str, missing: str) -> str:
    """Write characters that cannot be drawn by their sound or their code: ``‹GIM-MIN-SU›``.

    Parameters
    ----------
    text : str
        Any text.
    missing : str
        The characters that cannot be drawn.

    Returns
    -------
    str
        The text without them.
    """
    if not missing:
        return text
    run = re.compile(f"[{re.escape(missing)}]+")
    return run.sub(lambda match: "‹" + "-".join(_sound(c) for c in match[0]) + "›", text)


def _sound(character: str) -> str:
    match = _SOUNDS.match(unicodedata.name(character, ""))
    return match[1].title() if match else f"U+{ord(character):04X}"


@cache
def font_faces() -> str:
    """Return the ``@font-face`` rules of the bundled fonts, the fonts themselves inside.

    Returns
    -------
    str
        CSS.
    """
    rules = []
    for weight, name in FONT_FILES.items():
        data = base64.b64encode((templates_folder() / name).read_bytes()).decode("ascii")
        rules.append(
            f"@font-face{{font-family:'Report Sans';font-weight:{weight};"
            f"src:url(data:font/ttf;base64,{data}) format('truetype')}}"
        )
    return "".join(rules)
