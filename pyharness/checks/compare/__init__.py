"""Comparison of programs, methods and prepared solvers with each other and with the reference."""
