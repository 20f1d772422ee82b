"""Bounds of the errors of our own sines, cosines and double-double operations.

The bounds are computed from the constants and statements of the sources, and are compared with
measured errors. The page docs/contributing/function-errors.md states them.
"""
