"""The trials of `stress`, one module for each trial."""
