"""Sensitivity and amplification indices (Eqs. 1, 2, 7 to 10), and the precomputed table of them."""

__all__ = [
    "index_table",
    "variance",
]
