"""The words of the house as plain data: scenes, listings, trajectories, and their files."""
