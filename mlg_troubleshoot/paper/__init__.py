"""What the paper prints, reproduced: its designs, statements and numbers, the reconstruction."""

__all__ = [
    "reconstruct",
    "statements",
    "study",
    "targets",
    "verification",
]
