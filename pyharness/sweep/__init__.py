"""Sweeps: grids of scenes, solved and stored chunk by chunk, which can be continued."""
