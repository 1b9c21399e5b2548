"""One file for each task of a user: options in, result out. No terminal here."""

__all__ = [
    "beliefs_file",
    "check",
    "diagnose",
    "doctor",
    "history",
    "keep",
    "kept",
    "reconstruct",
    "separable",
    "study",
    "survey",
]
