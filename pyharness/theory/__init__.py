"""Error bounds and stability limits of programs and methods, derived before any of them runs."""
