"""Bits between languages, error against the truth, and what changed since recorded."""
