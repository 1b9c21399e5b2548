"""Text of data as a reader may see it: nothing in it acts on the page or the terminal that shows
it.
"""

from __future__ import annotations

import re
import unicodedata

_MEASURE = re.compile(r"(?<=\d) (?=(?:%|in|thou|mm|min)(?!\w))")
_LINE_ENDS = "\t\n\r"
# Joiners belong to the writing of Persian and Indic names; every other format character is shown as
# a code.
_HARMLESS = "\u00a0\u00ad\u200c\u200d"


def visible(text: str, *, one_line: bool = False) -> str:
    """Write characters that a reader would not see, or that would act, as their codes:
    ``‹U+001B›``.

    Those are control characters (escape sequences of terminals begin with one), marks and overrides
    of the writing direction, and lone surrogates. Tabulators and line ends are kept unless the text
    must stay on one line.
    """
    if text.isprintable():
        return text
    kept = _HARMLESS if one_line else _HARMLESS + _LINE_ENDS
    return "".join(
        (
            c
            if c.isprintable() or c in kept or unicodedata.category(c) == "Zs"
            else f"‹U+{ord(c):04X}›"
        )
        for c in text
    )


def unbroken(text: str, glue: str = "\u00a0") -> str:
    """Put a character that no line breaks at between a number and its unit."""
    return _MEASURE.sub(glue, text)
