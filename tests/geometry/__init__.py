"""The geometric engine: vectors, mechanisms as data, and their solution in batch."""
