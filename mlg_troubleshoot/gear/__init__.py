"""One gear type: its file, joints and limits, and how far worn joints move the plunger."""

__all__ = [
    "DEFAULT_GEAR",
    "assembly",
    "gear",
    "gear_file",
    "gear_tables",
    "linkage",
]

DEFAULT_GEAR = "hawker-800xp"
