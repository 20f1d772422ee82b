"""Planted faults, which show that each check can fail."""
