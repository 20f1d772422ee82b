"""What the trials of `stress` stand on: derived steps, matrices, noise; nothing is tried here."""
