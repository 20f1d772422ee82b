"""Sweeps: many scenes on a grid, solved chunk by chunk and kept in a store that can be resumed."""
