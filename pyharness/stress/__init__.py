"""Numerical stability tried to breaking, each trial with a bound derived beforehand."""
