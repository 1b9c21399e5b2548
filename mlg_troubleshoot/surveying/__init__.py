"""The geometry of a gear from readings of a real one."""

__all__ = [
    "plan",
    "readings",
    "result",
    "survey",
]
