"""Faults that are planted, so that each check is seen to fail."""
