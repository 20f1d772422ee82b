"""Benchmarks of run time against error, for methods, programs and other solvers.

A contender is a solver that is measured. Its setting is a tolerance or a number of steps. A maker
takes the end time (s) and the setting, and returns an integration that is ready to be timed. A
workload is a scene with an end time; a load is a set of bodies.
"""
