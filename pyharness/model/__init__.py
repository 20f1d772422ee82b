"""Data types of all subpackages: scenes, listings, trajectories and reports."""
