"""Sweeps: grids of scenes, solved chunk by chunk; an interrupted sweep can be continued."""
