"""Checks, each of which compares a value with a limit and names the command that repeats it."""
