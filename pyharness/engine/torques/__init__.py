"""Ready torques, and the files of scenes and trajectories."""
