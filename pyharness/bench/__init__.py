"""Run time against error: ours, the programs of the thesis, and other people's integrators."""
