"""Benchmarks of run time against error: our methods, the thesis programs, third-party solvers."""
