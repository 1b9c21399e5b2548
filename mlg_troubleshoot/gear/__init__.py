"""One gear type: its file, joints and limits, and how far worn joints move the plunger."""

__all__ = [
    "adjustment",
    "design",
    "directions",
    "gear",
    "gear_file",
    "model",
    "sources",
]
