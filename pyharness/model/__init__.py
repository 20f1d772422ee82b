"""The base layer: plain data types for scenes, listings, trajectories, and their files."""
