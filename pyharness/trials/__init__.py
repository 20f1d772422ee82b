"""The trials of `stress`, one to a module; each has a `TRIAL`."""
