"""A figure of the reports as an object of its own: shown in a notebook, saved as a file."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from markupsafe import Markup, escape

from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.reporting.html import font_faces
from mlg_troubleshoot.reporting.pdf import PdfEngine, PdfError

_FONT = "DejaVu Sans, Verdana, sans-serif"
# Between two drawings of one picture. [px]
_GAP = 12
_FORMATS = (".svg", ".png", ".pdf")


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture, as text of an SVG file.

    Parameters
    ----------
    title : str
        What it shows.
    svg : str
        The text of the file.
    width, height : float
        Its size. [px]
    """

    title: str
    svg: str
    width: float
    height: float

    @classmethod
    def of(cls, title: str, *drawings: Markup) -> Picture:
        """Put figures of a report side by side."""
        x = height = 0.0
        placed = []
        for drawing in drawings:
            wide, high = (float(_attribute(drawing, name)) for name in ("width", "height"))
            placed.append(drawing.replace("<svg ", Markup(f'<svg x="{x:g}" '), 1))
            x = x + wide + _GAP
            height = max(height, high)
        width = x - _GAP
        svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
            f'width="{width:g}" height="{height:g}" font-family="{_FONT}" role="img">'
            f"<title>{escape(title)}</title>{''.join(placed)}</svg>"
        )
        return cls(title, svg, width, height)

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"Picture({self.title!r}, {self.width:.0f} × {self.height:.0f})"

    def save(self, file: str | Path) -> Path:
        """Write the picture as the name of the file ends.

        Parameters
        ----------
        file : str or Path
            A name that ends in .svg, .png or .pdf.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        OutputError
            If it cannot be written, or the name ends otherwise.
        """
        path = Path(file)
        kind = path.suffix.lower()
        if kind not in _FORMATS:
            raise OutputError(
                f"a picture cannot be written as {path.name!r}",
                f"Give a name that ends in {', '.join(_FORMATS)}.",
            )
        write_bytes(path, self.svg.encode() if kind == ".svg" else self._drawn(kind[1:]))
        return path

    def _drawn(self, kind: str) -> bytes:
        page = (
            f'<!doctype html><html lang="en"><title>{escape(self.title)}</title><style>'
            f"{font_faces()} @page {{ size: {self.width:g}px {self.height:g}px; margin: 0 }} "
            f"body {{ margin: 0; font-family: {_FONT} }}"
            "body > svg { display: block; width: 100%; height: auto }</style>"
            f"<body>{self.svg}</body></html>"
        )
        try:
            with closing(PdfEngine()) as engine:
                moment = datetime.fromtimestamp(0, UTC)
                return engine.convert(page, "A4", moment, kind, self.width)[0]
        except PdfError as error:
            raise OutputError(
                f"the picture cannot be drawn: {error}", "Write it as .svg instead."
            ) from error


def _attribute(drawing: str, name: str) -> str:
    return drawing.partition(f' {name}="')[2].partition('"')[0]
