"""Lines of text for a terminal, without knowing the terminal: parts with a tone, never a colour alone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Tone(StrEnum):
    """What a part of a line is; the terminal decides how it looks."""

    PLAIN = "plain"
    QUIET = "quiet"
    STRONG = "strong"
    CURRENT = "current"
    KEY = "key"
    GOOD = "good"
    WARN = "warn"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Line:
    """One line, wrapped by the terminal if it is too long.

    Parameters
    ----------
    parts : tuple of (str, Tone)
        Its text in order.
    indent : int
        Columns to the left of the text and of its continuation. [columns]
    rigid : bool
        True for a drawing or a table row, which is cut rather than wrapped.
    """

    parts: tuple[tuple[str, Tone], ...]
    indent: int = 1
    rigid: bool = False

    @property
    def text(self) -> str:
        """The line without tones."""
        return " " * self.indent + "".join(text for text, _ in self.parts)


BLANK = Line((), 0)


def line(*parts: str | tuple[str, Tone], indent: int = 1, rigid: bool = False) -> Line:
    """Make a line of parts; a bare text is plain.

    Parameters
    ----------
    *parts : str or (str, Tone)
        Its text in order.
    indent : int
        Columns to the left. [columns]
    rigid : bool
        True to cut rather than wrap.

    Returns
    -------
    Line
        The line.
    """
    return Line(tuple((p, Tone.PLAIN) if isinstance(p, str) else p for p in parts), indent, rigid)


def key(name: str, meaning: str) -> tuple[tuple[str, Tone], ...]:
    """Return a key and what it does, as parts of a line.

    Parameters
    ----------
    name, meaning : str
        The key and its meaning.

    Returns
    -------
    tuple of (str, Tone)
        The parts.
    """
    return ((name, Tone.KEY), (f" = {meaning}", Tone.PLAIN))


def keys(*pairs: tuple[str, str]) -> Line:
    """Return a line of keys with their meanings.

    Parameters
    ----------
    *pairs : (str, str)
        Key and meaning.

    Returns
    -------
    Line
        The line.
    """
    parts: list[tuple[str, Tone]] = []
    for i, (name, meaning) in enumerate(pairs):
        if i:
            parts.append(("   ", Tone.PLAIN))
        parts.extend(key(name, meaning))
    return Line(tuple(parts))


# One character for one character, so that drawings and tables keep their columns.
_PLAIN = str.maketrans(
    {
        "═": "=",
        "─": "-",
        "╭": "+",
        "╮": "+",
        "▲": "^",
        "△": "A",
        "▶": ">",
        "○": "o",
        "■": "#",
        "□": ".",
        "✓": "*",
        "✗": "!",
        "·": "-",
        "—": "-",
        "–": "-",
        "−": "-",
        "→": ">",
        "’": "'",
        "\u00a0": " ",
    }
)


def to_ascii(text: str) -> str:
    """Return a text in ASCII with the same number of characters.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        Drawing characters become their plain likeness, other letters a question mark.
    """
    return text.translate(_PLAIN).encode("ascii", "replace").decode("ascii")


def without_tones(lines: Iterable[Line]) -> str:
    """Return lines as plain text.

    Parameters
    ----------
    lines : iterable of Line
        The lines.

    Returns
    -------
    str
        Their text, one below the other.
    """
    return "\n".join(each.text for each in lines)
