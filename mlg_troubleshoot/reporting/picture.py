"""A figure of the reports as an object of its own: shown in a notebook, saved as a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup, escape

from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.outputs import write_text

_FONT = "DejaVu Sans, Verdana, sans-serif"
# Between two drawings of one picture. [px]
_GAP = 12


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
        """Write the picture as SVG.

        Parameters
        ----------
        file : str or Path
            A name that ends in .svg.

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
        if path.suffix.lower() != ".svg":
            raise OutputError(
                f"a picture cannot be written as {path.name!r}",
                "Give a name that ends in .svg; a browser prints it.",
            )
        write_text(path, self.svg)
        return path


def _attribute(drawing: str, name: str) -> str:
    return drawing.partition(f' {name}="')[2].partition('"')[0]
