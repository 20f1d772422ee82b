"""Checks: each compares a value with a limit, and names the command that repeats it."""
