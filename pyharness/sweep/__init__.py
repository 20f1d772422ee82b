"""Sweeps: grids of scenes, solved and stored in blocks (chunks), so that a run can be continued."""
