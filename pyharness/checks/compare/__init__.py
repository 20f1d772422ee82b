"""Comparison of programs, methods and prepared solvers with each other and the true solution."""
