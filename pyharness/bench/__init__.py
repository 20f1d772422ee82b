"""Benchmarks of run time against error, for methods, programs and third-party solvers.

A contender is a measured solver; its setting is a tolerance or a number of steps. A maker prepares
an integration to be timed, from an end time (s) and a setting. A workload is a scene with an end
time; a load is a set of bodies solved at once.
"""
