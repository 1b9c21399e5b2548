"""The shapes that go with verdicts and outcomes, so that each is told apart without colour."""

from __future__ import annotations

import math

from markupsafe import Markup

from mlg_troubleshoot.reporting.figures import INK, PAPER, Canvas

RED, GREEN, BLUE, BROWN = "#a3131a", "#1d6b2a", "#0b4f8a", "#8a4b00"
SIGNS = {
    "OUTSIDE_MARGIN": ("octagon with exclamation mark", RED),
    "WITHIN_MARGIN": ("circle with check mark", GREEN),
    "INCONCLUSIVE": ("diamond with question mark", BROWN),
    "INCOMPLETE": ("open circle, a part missing", BLUE),
    "INVALID": ("crossed square", INK),
    "NAMED": ("filled square with an arrow to one point", RED),
    "AMBIGUOUS": ("two circles that overlap", BROWN),
    "UNLISTED": ("diamond with question mark", BROWN),
    "NONE": ("circle with an equals sign", GREEN),
    "holds": ("circle with check mark", GREEN),
    "holds only under a reading": ("circle, half filled", BROWN),
    "holds on some linkages": ("circle, half filled", BROWN),
    "does not hold": ("crossed circle", RED),
}


def sign(of: str, css_class: str = "sign") -> Markup:
    """Draw the shape of a verdict of a check or of a diagnosis, or of what became of a statement."""
    shape, colour = SIGNS[of]
    canvas = Canvas(60, 60, f"Sign: {shape}")
    if shape.startswith("circle") or shape == "crossed circle":
        canvas.add("circle", cx=30.0, cy=30.0, r=27.0, fill=PAPER, stroke=colour, stroke_width=4.0)
    match shape:
        case "octagon with exclamation mark":
            eighths = [math.pi / 8 + k * math.pi / 4 for k in range(8)]
            corners = [(30 + 28 * math.cos(a), 30 + 28 * math.sin(a)) for a in eighths]
            canvas.polyline(corners, fill=colour, colour=colour, closed=True)
            canvas.rectangle(26.5, 13, 7, 22, fill=PAPER)
            canvas.rectangle(26.5, 40, 7, 7, fill=PAPER)
        case "circle with check mark":
            canvas.polyline([(17, 31), (26, 41), (44, 19)], colour=colour, width=6.0)
        case "diamond with question mark":
            corners = [(30.0, 2.0), (58.0, 30.0), (30.0, 58.0), (2.0, 30.0)]
            canvas.polyline(corners, fill=PAPER, colour=colour, width=4.0, closed=True)
            canvas.text(30, 41, "?", size=32, bold=True, anchor="middle", colour=colour)
        case "open circle, a part missing":
            canvas.add("path", d="M 48.4 48.4 A 26 26 0 1 1 56 30", fill=PAPER, stroke=colour, stroke_width=5.0)
            canvas.line(18, 30, 42, 30, colour=colour, width=5)
        case "crossed square":
            canvas.rectangle(5, 5, 50, 50, fill=PAPER, edge=colour, edge_width=4)
            canvas.line(5, 5, 55, 55, colour=colour, width=4)
            canvas.line(5, 55, 55, 5, colour=colour, width=4)
        case "filled square with an arrow to one point":
            canvas.rectangle(3, 3, 54, 54, fill=colour)
            canvas.line(12, 12, 33, 33, colour=PAPER, width=5)
            canvas.polyline([(37, 20), (37, 37), (20, 37)], colour=PAPER, width=5)
            canvas.marker("circle", 46, 46, 4.5, colour=PAPER)
        case "two circles that overlap":
            for x in (21.0, 39.0):
                canvas.add("circle", cx=x, cy=30.0, r=18.0, fill="none", stroke=colour, stroke_width=4.0)
        case "circle with an equals sign":
            canvas.line(17, 25, 43, 25, colour=colour, width=5)
            canvas.line(17, 36, 43, 36, colour=colour, width=5)
        case "circle, half filled":
            canvas.add("path", d="M 30 4 A 26 26 0 0 0 30 56 Z", fill=colour)
        case "crossed circle":
            canvas.line(12, 12, 48, 48, colour=colour, width=5)
            canvas.line(12, 48, 48, 12, colour=colour, width=5)
    return canvas.svg(css_class)
