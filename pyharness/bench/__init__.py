"""Benchmarks of run time against error, for our methods, the programs and other solvers."""
