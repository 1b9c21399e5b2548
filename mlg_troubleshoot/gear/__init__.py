"""One gear type: its file, joints and limits, and how far worn joints move the plunger."""

__all__ = [
    "DEFAULT_GEAR",
    "adjustment",
    "design",
    "directions",
    "from_pylinkage",
    "gauges",
    "gear",
    "gear_file",
    "model",
    "short_form",
]

DEFAULT_GEAR = "hawker-800xp"
