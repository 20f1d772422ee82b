"""Scenes prepared for many calls."""
