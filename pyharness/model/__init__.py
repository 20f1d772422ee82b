"""The data types that all other subpackages use: scenes, listings, trajectories and reports."""
