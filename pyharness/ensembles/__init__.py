"""Sweeps: many scenes on a grid, solved chunk by chunk, kept in a store that resumes."""
