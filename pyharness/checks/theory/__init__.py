"""Error bounds and stability limits, derived before any program runs."""
