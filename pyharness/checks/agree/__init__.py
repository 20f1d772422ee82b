"""Comparison of any programs on the same inputs, cell by cell."""
