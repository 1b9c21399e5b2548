"""What the paper prints, reproduced: its designs, statements and numbers."""

__all__ = [
    "study",
    "verification",
]
