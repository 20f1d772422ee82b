"""Roots of functions of time and state."""
