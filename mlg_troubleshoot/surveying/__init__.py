"""The geometry of a gear from readings of a real one."""

__all__ = [
    "as_gear_file",
    "plan",
    "readings",
    "result",
    "survey",
    "tuned",
]
