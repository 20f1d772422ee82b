"""Solution of scenes: methods, prepared solvers, events, sensitivities and torque terms."""
