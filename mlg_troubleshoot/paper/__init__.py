"""What the paper prints, reproduced: its designs, statements and numbers, the reconstruction, the
proved bound.
"""
