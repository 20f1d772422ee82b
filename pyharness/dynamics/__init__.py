"""Right-hand sides of Euler's equations, and ready torques."""
