"""Sensitivity and amplification indices (Eqs. 1, 2 and 7 to 10), and the precomputed table of
them.
"""
