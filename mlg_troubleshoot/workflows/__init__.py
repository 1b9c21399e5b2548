"""One file for each task of a user: options in, result out. No terminal here."""

__all__ = [
    "check",
    "diagnose",
    "header_file",
    "history",
    "keep",
    "study",
    "visit",
    "witness",
]
