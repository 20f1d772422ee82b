"""Checks of an integrator of rigid bodies, which another program provides."""
