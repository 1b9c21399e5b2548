"""What the paper prints, reproduced: its designs, statements and numbers, the reconstruction, the
proved bound.
"""

__all__ = [
    "reconstruct",
    "statements",
    "study",
    "targets",
    "verification",
    "worst_search",
]
