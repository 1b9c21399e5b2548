"""Tests of what is kept of a gear's life."""
