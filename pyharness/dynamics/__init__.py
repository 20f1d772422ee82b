"""Right-hand sides: Euler's equations with a torque that depends on the state."""
