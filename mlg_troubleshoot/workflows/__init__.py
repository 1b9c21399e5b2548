"""One file for each task of a user: options in, result out. No terminal here."""

__all__ = [
    "beliefs_file",
    "check",
    "diagnose",
    "header_file",
    "history",
    "index_tables",
    "keep",
    "kept",
    "study",
    "witness",
]
