"""Run time against error: ours, the programs of 1982, and other people's integrators."""
