"""Small XML parts of a packed workbook, read without ever following an entity or a document type."""

from __future__ import annotations

from collections.abc import Callable
from xml.parsers import expat

from mlg_troubleshoot.records.model import FileRefusedError
from mlg_troubleshoot.records.zipguard import damaged

Start = Callable[[str, dict[str, str]], None]
End = Callable[[str], None]
Text = Callable[[str], None]


def local(name: str) -> str:
    """Return an element's or attribute's name without its prefix."""
    return name.rpartition(":")[2]


def new_parser(start: Start, end: End | None = None, text: Text | None = None) -> expat.XMLParserType:
    """Make a parser that refuses document types and entities.

    Parameters
    ----------
    start, end, text : callable, optional
        Called with the elements and the text.

    Returns
    -------
    XMLParserType
        The parser.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = start
    if end is not None:
        parser.EndElementHandler = end
    if text is not None:
        parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = _refuse
    parser.EntityDeclHandler = _refuse
    return parser


def _refuse(*_: object) -> None:
    raise FileRefusedError(
        "xml_declaration",
        "a part of the workbook declares a document type or entities, which no spreadsheet program writes",
        "a workbook as a spreadsheet program writes it",
        "Open it in a spreadsheet program, save it again as .xlsx, and read the copy.",
    )


def parse_part(name: str, data: bytes, start: Start, end: End | None = None, text: Text | None = None) -> None:
    """Parse a whole part.

    Parameters
    ----------
    name : str
        Part, for the message.
    data : bytes
        Its content.
    start, end, text : callable, optional
        Called with the elements and the text.

    Raises
    ------
    FileRefusedError
        If it is not well-formed.
    """
    parser = new_parser(start, end, text)
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError):
        raise damaged(f"{name} is not well-formed") from None
