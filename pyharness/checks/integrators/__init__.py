"""Checks of an integrator of rigid bodies in another program."""
