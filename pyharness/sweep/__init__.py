"""Sweeps: grids of scenes, stored chunk by chunk, so that an interrupted run can be continued."""
