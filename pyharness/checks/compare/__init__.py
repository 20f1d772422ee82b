"""Comparison of programs, methods, prepared solvers and the reference."""
