"""Benchmarks of run time against error, for methods, programs and other solvers.

A contender is a measured solver; its setting is a tolerance or a number of steps. A maker returns,
for an end time (s) and a setting, an integration ready to be timed. A workload is a scene with an
end time; a load is a set of bodies solved at once.
"""
