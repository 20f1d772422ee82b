"""Error bounds and stability limits, derived before any method is run."""
