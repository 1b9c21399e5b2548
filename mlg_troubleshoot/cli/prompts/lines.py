"""Lines of text for a terminal, without knowing the terminal: parts with a tone, never a colour
alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

# Stands for a space at which no line is wrapped.
GLUE = "\u2800"


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
    """One line, wrapped where it is too long; a rigid one, as of a drawing or a table, is cut."""

    parts: tuple[tuple[str, Tone], ...]
    indent: int = 1
    rigid: bool = False

    @property
    def text(self) -> str:
        return " " * self.indent + "".join(text for text, _ in self.parts).replace(GLUE, " ")


BLANK = Line((), 0)


def line(*parts: str | tuple[str, Tone], indent: int = 1, rigid: bool = False) -> Line:
    """Make a line of parts; a bare text is plain."""
    return Line(tuple((p, Tone.PLAIN) if isinstance(p, str) else p for p in parts), indent, rigid)


def note(*parts: str | tuple[str, Tone]) -> Line:
    """A line that stands below another."""
    return line(*parts, indent=3)


def warning(text: str, *more: str | tuple[str, Tone]) -> Line:
    return line((text, Tone.WARN), *more)


def keys(*pairs: tuple[str, str]) -> Line:
    parts: list[tuple[str, Tone]] = []
    for name, meaning in pairs:
        said = f" = {meaning}".replace(" ", GLUE)
        parts += [(name, Tone.KEY), (said, Tone.PLAIN), ("   ", Tone.PLAIN)]
    return Line(tuple(parts[:-1]))
